// Which of all frames are shown: failed ones, those of a location, those with a flag; by it the strip and the sheet.

import { $, clear, el } from "./dom.js";
import { state } from "./state.js";
import { t, word } from "./words.js";

const FAILED = ["error", "none", "some", "out"];
const chosen = { show: "all", location: "", flag: "" };
const listeners = [];
export const onFilter = (f) => listeners.push(f);
export const isFailed = (row) => FAILED.includes(row?.badge);

const flagsOf = (row) => (row.stripe ? Object.keys(row.stripe.flags) : row.spots.map((s) => s.flag).filter((f) => f));

export function passes(row, index) {
  if (chosen.location && state.session.images[index].location !== chosen.location) return false;
  if (!row) return chosen.show === "all" && !chosen.flag;
  if (chosen.show === "failed" && !isFailed(row)) return false;
  return !chosen.flag || flagsOf(row).includes(chosen.flag);
}

export const filtering = () => chosen.show !== "all" || chosen.location !== "" || chosen.flag !== "";

export function buildFilter() {
  const places = [...new Set(state.session.images.map((i) => i.location))].filter((x) => x);
  const list = (id, title, options) => el("select", { id, "aria-label": t(title), onchange: (e) => { chosen[id.slice(7)] = e.target.value; listeners.forEach((f) => f()); } },
    options.map(([value, text]) => el("option", { value }, text)));
  clear($("filters"),
    list("filter-show", "Which frames", [["all", t("all frames")], ["failed", t("failed")]]),
    places.length ? list("filter-location", "Location", [["", t("every location")], ...places.map((p) => [p, p])]) : null,
    list("filter-flag", "Flag", [["", t("any flag")]]));
}

// The flags that there are in the rows so far.
export function offerFlags(rows) {
  const node = $("filter-flag"), known = new Set([...node.options].map((o) => o.value));
  for (const row of rows) for (const flag of row ? flagsOf(row) : []) {
    if (known.has(flag)) continue;
    known.add(flag);
    node.append(el("option", { value: flag }, word(flag.replaceAll("_", " "))));
  }
  node.hidden = node.options.length < 2;
}
