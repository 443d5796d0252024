// The image strip: thumbnails with a badge each.

import { $, clear, el } from "./dom.js";
import { filtering, onFilter, passes } from "./filter.js";
import { state } from "./state.js";
import { show } from "./stage.js";
import { t } from "./words.js";

export const WORDS = { all: "all found", some: "some found", none: "none found", count: "found; nothing says how many there should be", out: "out of tolerance", error: "error" };
const SIGNS = { all: "✓", none: "0", error: "!" };

export function buildStrip() {
  clear($("strip"), state.session.images.map(entry));
  onFilter(sift);
}

const latest = [];

// Hide what the filter does not let through; the shown image stays.
function sift() {
  [...$("strip").children].forEach((node, i) => { node.hidden = i !== state.index && !passes(latest[i], i); });
}

// The images that came since.
export function addToStrip() {
  const there = $("strip").childElementCount;
  $("strip").append(...state.session.images.slice(there).map((image, k) => entry(image, there + k)));
}

// Small pictures are asked for once the first large one is there.
let pictured = false;
export function showThumbnails() {
  pictured = true;
  for (const node of $("strip").querySelectorAll("img:not([src])")) node.src = `api/thumbnail/${node.parentNode.dataset.index}`;
}

const entry = (image, i) => el("button", {
    title: image.name, data: { index: i }, onclick: () => go(i), onkeydown: arrows, tabIndex: i ? -1 : 0,
  },
  el("img", { ...(pictured ? { src: `api/thumbnail/${i}` } : {}), alt: "", loading: "lazy", decoding: "async" }),
  el("span", { class: "badge", data: { badge: "" } }, "…"),
  el("span", { class: "name" }, el("b", {}, image.name.split("/").pop()), el("span", {}, image.location)));

// The strip is one stop of the Tab key; arrows go along it.
function arrows(event) {
  const last = state.session.images.length - 1;
  const to = { ArrowDown: near(state.index, 1), ArrowUp: near(state.index, -1), Home: near(-1, 1), End: near(last + 1, -1) }[event.key];
  if (to === undefined || to < 0 || to > last) return;
  event.preventDefault();
  go(to);
  $("strip").children[to].focus();
}

// The next image to either side that the filter lets through.
export function near(index, by) {
  let to = index + by;
  while (to >= 0 && to < state.session.images.length && $("strip").children[to].hidden) to += by;
  return to;
}

export function go(index) {
  if (index < 0 || index >= state.session.images.length) return;
  state.index = index;
  state.selected = null;
  show();
}

const marked = [];
export const onMark = (f) => marked.push(f);

export function mark() {
  marked.forEach((f) => f());
  for (const button of $("strip").children) {
    const current = Number(button.dataset.index) === state.index;
    if (current && button.getAttribute("aria-current") !== "true") button.scrollIntoView({ block: "nearest" });
    button.setAttribute("aria-current", current);
    button.tabIndex = current ? 0 : -1;
  }
}

export function badgeText(row) {
  if (row.badge === "count" || row.badge === "out") return String(found(row));
  return row.badge === "some" ? String(row.labelled) : SIGNS[row.badge];
}

// How many spots, points or corners there are.
export const found = (row) => row.found ?? 0;

export function setBadge(row) {
  const button = $("strip").children[row.index];
  latest[row.index] = row;
  if (filtering()) button.hidden = row.index !== state.index && !passes(row, row.index);
  const node = button.querySelector(".badge");
  node.className = `badge ${row.badge}`;
  node.dataset.badge = row.badge;
  node.textContent = badgeText(row);
  button.title = `${state.session.images[row.index].name}: ${row.error || t(WORDS[row.badge])}`;
}
