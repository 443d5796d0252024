// The three pages: one image with its laser plane, all images, the calibration.

import { $, clear, el } from "./dom.js";
import { state } from "./state.js";

export const TABS = [{ id: "image", title: "Image" }, { id: "sheet", title: "All images" }, { id: "calibration", title: "Calibration" }];
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
  listeners.forEach((f) => f(id));
}

function build() {
  clear($("tabs"), TABS.map(({ id, title }) => el("button", {
    role: "tab", data: { tab: id }, onclick: () => selectTab(id), onkeydown: arrows,
  }, title)));
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
