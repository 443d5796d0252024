// The pages: one image with its laser plane, all images, the calibration, the sets of parameters.

import { $, clear, el } from "./dom.js";
import { state } from "./state.js";
import { t } from "./words.js";

export const TABS = [{ id: "image", title: "Image" }, { id: "sheet", title: "All images" }, { id: "calibration", title: "Calibration" }, { id: "history", title: "History" }];
const listeners = [];
export const onTab = (f) => listeners.push(f);

export function selectTab(id) {
  state.view = id;
  if (!$("tabs").childElementCount) build();
  for (const button of $("tabs").children) {
    const chosen = button.dataset.tab === id;
    button.setAttribute("aria-selected", chosen);
    button.tabIndex = chosen ? 0 : -1;
  }
  for (const part of ["stage", "drawer", "tools", "layers"]) $(part).hidden = id !== "image";
  $("sheet").hidden = id !== "sheet";
  $("calibration").hidden = id !== "calibration";
  $("history").hidden = id !== "history";
  listeners.forEach((f) => f(id));
}

function build() {
  clear($("tabs"), TABS.map(({ id, title }) => el("button", {
    role: "tab", id: `tab-${id}`, data: { tab: id }, "aria-controls": { image: "stage" }[id] ?? id, onclick: () => selectTab(id), onkeydown: arrows,
  }, t(title))));
}

function arrows(event) {
  const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
  if (!by) return;
  event.preventDefault();
  const all = [...$("tabs").children];
  const next = all[(all.indexOf(event.currentTarget) + by + all.length) % all.length];
  selectTab(next.dataset.tab);
  next.focus();
}
