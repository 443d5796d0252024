// The sets of parameters of this session with what each reached over all images: use one again, or compare with it.

import { $, clear, el } from "./dom.js";
import { listen, replace, state, text } from "./state.js";
import { onTab, selectTab } from "./tabs.js";
import { number, t } from "./words.js";
import { compareWith } from "./wipe.js";
import { toggle } from "./layers.js";

const sets = []; // { name, text, at, score }
const scores = new Map(); // by the parameters' text

export function startHistory() {
  keep(t("as opened"));
  listen((what) => { if (what === "saved") keep(state.savedName); if (state.view === "history") render(); });
  onTab((id) => { if (id === "history") render(); });
}

export function keep(name) {
  const now = text(), known = sets.find((s) => s.text === now);
  if (known) known.name = name;
  else sets.push({ name, text: now, at: new Date() });
  if (state.view === "history") render();
}

export function scored(config, score) {
  scores.set(config, score);
  if (state.view === "history") render();
}

const COLUMNS = [
  ["images", "images", 0], ["failed", "failed", 0], ["out", "values out of tolerance", 0], ["found", "found", 0], ["labelled", "labelled", 0],
  ["missed", "missed", 0], ["false", "false", 0], ["rms", "rms [mm]", 4],
];

function render() {
  const shown = COLUMNS.filter(([key]) => sets.some((s) => scores.get(s.text)?.[key] !== null && scores.get(s.text)?.[key] !== undefined));
  const now = text();
  clear($("history"), el("div", { class: "page-head" }, el("h2", {}, t("Sets of parameters")),
    el("button", { id: "keep-set", onclick: () => keep(t`set ${sets.length + 1}`) }, t("Keep as it stands"))),
  el("table", { id: "sets" }, el("thead", {}, el("tr", {}, el("th", {}, t("set")), el("th", {}, t("time")), shown.map(([, title]) => el("th", {}, t(title))), el("td", {}))),
    el("tbody", {}, sets.map((s) => el("tr", { "aria-current": String(s.text === now) },
      el("td", {}, s.name), el("td", {}, s.at.toLocaleTimeString(document.documentElement.lang)),
      shown.map(([key, , digits]) => el("td", {}, scores.has(s.text) ? number(scores.get(s.text)[key], digits) : "…")),
      el("td", {}, el("button", { onclick: () => replace(JSON.parse(s.text)) }, t("Use")), " ",
        state.session.has_images ? el("button", { onclick: () => against(s) }, t("Compare on the image")) : null))))));
}

function against(set) {
  compareWith(set.text, set.name);
  selectTab("image");
  if (!state.layers.before) toggle("before");
  compareWith(set.text, set.name);
}
