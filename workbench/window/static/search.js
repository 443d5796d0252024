// Auto-tune: search parameters on half of the images, judge them on the other half, and use them or not.

import { get, post } from "./api.js";
import { $, clear, el } from "./dom.js";
import { cancel, close, open } from "./dialog.js";
import { replace, state, text } from "./state.js";
import { number, t } from "./words.js";

export function askSearch() {
  const trials = el("input", { type: "text", id: "trials", inputMode: "numeric", value: "100" });
  const body = el("div", { class: "body", id: "search" }, el("h2", {}, t("Auto-tune")),
    el("p", {}, t("Searches the parameters on half of the images and judges on the other half, which the search never sees. The same search goes on where it ended.")),
    el("label", { class: "row" }, t("Trials"), trials), el("p", { class: "error", id: "search-error" }),
    el("div", { class: "buttons" }, cancel(), el("button", { class: "strong", id: "search-go", onclick: () => begin(Number(trials.value)) }, t("Search"))));
  open(body);
}

async function begin(trials) {
  try {
    await post("search", { config: text(), trials });
  } catch (error) { $("search-error").textContent = error.message; return; }
  const bar = el("progress", { id: "search-progress", max: trials, value: 0, "aria-label": t("Trials done") }), said = el("p", { id: "search-said" }, t("Reading the images…"));
  open(el("div", { class: "body" }, el("h2", {}, t("Auto-tune")), bar, said, el("div", { class: "buttons" }, el("button", { onclick: close }, t("Go on in the background")))));
  watch(bar, said);
}

async function watch(bar, said) {
  let now;
  try { now = await get("search"); } catch (error) { said.textContent = error.message; return; }
  if (now.state === "running") {
    if (now.done !== undefined) {
      bar.value = now.done;
      said.textContent = t`${now.done} of ${now.of} trials, best ${number(now.best_mm, 4)} mm`;
    }
    setTimeout(() => watch(bar, said), 400);
    return;
  }
  if (now.state === "failed") { open(el("div", { class: "body" }, el("h2", {}, t("No answer")), el("p", { class: "error" }, now.error), el("div", { class: "buttons" }, cancel()))); return; }
  tell(now.result);
}

function tell(r) {
  const row = (name, s) => el("tr", {}, el("td", {}, t(name)), el("td", {}, number(s.loss_mm, 4)), el("td", {}, number(s.rms_mm, 4)), el("td", {}, `${s.missed} / ${s.of}`), el("td", {}, String(s.false)));
  const gain = `${number(100 * r.gain, 0)} % (90 %: ${number(100 * r.gain_90[0], 0)} … ${number(100 * r.gain_90[1], 0)} %)`;
  open(el("div", { class: "body", id: "search-done" }, el("h2", {}, r.better ? t("Better settings were found") : t("The settings as they stood are as good")),
    el("table", {}, el("thead", {}, el("tr", {}, ["held-out images", "loss, mm", "rms, mm", "missed", "false"].map((x) => el("th", {}, t(x))))), el("tbody", {}, row("start", r.scores.start), row("found", r.scores.found))),
    el("p", {}, t`gain ${gain}, of ${r.held_out} held-out images`),
    r.changes.length ? el("pre", {}, r.changes.join("\n")) : null,
    r.skipped.length ? el("p", {}, r.skipped.join("; ")) : null,
    el("div", { class: "buttons" }, cancel(), el("button", { class: r.better ? "strong" : "", id: "search-use", onclick: () => { replace({ ...r.parameters, what: state.parameters.what }); close(); } }, t("Use what was found")))));
}

export function searchButton() {
  return clear(el("div", { class: "line own" }), state.session.can_search ? el("button", { id: "auto-tune", onclick: askSearch }, t("Auto-tune…")) : null);
}
