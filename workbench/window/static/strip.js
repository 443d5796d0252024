// The image strip: thumbnails with a badge each.

import { $, clear, el } from "./dom.js";
import { state } from "./state.js";
import { show } from "./stage.js";

export const WORDS = { all: "all found", some: "some found", none: "none found", count: "spots, of no known jig", error: "error" };
const SIGNS = { all: "✓", none: "0", error: "!" };

export function buildStrip() {
  clear($("strip"), state.session.images.map(entry));
}

// The images that came since.
export function addToStrip() {
  const there = $("strip").childElementCount;
  $("strip").append(...state.session.images.slice(there).map((image, k) => entry(image, there + k)));
}

const entry = (image, i) => el("button", {
    title: image.name, data: { index: i }, onclick: () => go(i), onkeydown: arrows, tabIndex: i ? -1 : 0,
    "aria-label": `Image ${image.frame}, ${image.name}`,
  },
  el("img", { src: `api/thumbnail/${i}`, alt: "", loading: "lazy", decoding: "async" }),
  el("span", { class: "badge", data: { badge: "" } }, "…"),
  el("span", { class: "name" }, el("b", {}, image.name.split("/").pop()), el("span", {}, image.location)));

// The strip is one stop of the Tab key; arrows go along it.
function arrows(event) {
  const last = state.session.images.length - 1;
  const to = { ArrowDown: state.index + 1, ArrowUp: state.index - 1, Home: 0, End: last }[event.key];
  if (to === undefined || to < 0 || to > last) return;
  event.preventDefault();
  go(to);
  $("strip").children[to].focus();
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
  if (row.badge === "count") return String(row.spots.length);
  return row.badge === "some" ? String(row.labelled) : SIGNS[row.badge];
}

export function setBadge(row) {
  const button = $("strip").children[row.index];
  const node = button.querySelector(".badge");
  node.className = `badge ${row.badge}`;
  node.dataset.badge = row.badge;
  node.textContent = badgeText(row);
  button.title = `${state.session.images[row.index].name}: ${row.error || WORDS[row.badge]}`;
}
