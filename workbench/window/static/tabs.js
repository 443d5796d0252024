// The stages as tabs, and the two pages beside them.

import { $, clear, el } from "./dom.js";
import { state } from "./state.js";

export const TABS = [
  { id: "raw", title: "Raw" }, { id: "background", title: "Background" }, { id: "mask", title: "Mask" },
  { id: "candidates", title: "Candidates" }, { id: "spots", title: "Spots" }, { id: "labels", title: "Labels" },
  { id: "plot", title: "(y, z)" }, { id: "sheet", title: "All images", apart: true }, { id: "calibration", title: "Calibration" },
];
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
  const page = id === "sheet" || id === "calibration";
  $("stage").hidden = $("drawer").hidden = page;
  $("tools").hidden = page;
  $("sheet").hidden = id !== "sheet";
  $("calibration").hidden = id !== "calibration";
  listeners.forEach((f) => f(id));
}

function build() {
  clear($("tabs"), TABS.map(({ id, title, apart }) => el("button", {
    role: "tab", class: apart ? "apart" : "", data: { tab: id }, onclick: () => selectTab(id), onkeydown: arrows,
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
