// The image strip: thumbnails with a badge each.

import { thumbnailOf } from "./api.js";
import { $, clear, el } from "./dom.js";
import { filtering, onFilter, passes } from "./filter.js";
import { state } from "./state.js";
import { show } from "./stage.js";
import { t } from "./words.js";

export const WORDS = { all: "all found", some: "some found", none: "none found", count: "found; nothing says how many there should be", out: "out of tolerance", error: "error" };
const SIGNS = { all: "✓", none: "0", error: "!" };

// Ten thousand images: the browser lays out and paints the parcels in sight alone, and is told how high the others are.
const PARCEL = 50, HEIGHT_PX = 116;
const entries = [], parcels = [], latest = [];
let marked = -1;

export function buildStrip() {
  Object.assign(entries, { length: 0 });
  Object.assign(parcels, { length: 0 });
  clear($("strip"));
  addToStrip();
  onFilter(sift);
}

// Hide what the filter does not let through; the shown image stays.
function sift() {
  entries.forEach((node, i) => { node.hidden = i !== state.index && !passes(latest[i], i); });
  parcels.forEach(measureParcel);
}

function measureParcel(node) {
  const seen = [...node.children].filter((child) => !child.hidden).length;
  node.hidden = !seen;
  node.style.containIntrinsicHeight = `auto ${seen * HEIGHT_PX}px`;
}

// The images that came since, those of the beginning too.
export function addToStrip() {
  const first = entries.length, touched = new Set();
  state.session.images.slice(first).forEach((image, k) => {
    const i = first + k, parcel = parcels[Math.floor(i / PARCEL)] ?? newParcel();
    entries.push(entry(image, i));
    parcel.append(entries[i]);
    touched.add(parcel);
  });
  touched.forEach(measureParcel);
}

function newParcel() {
  const node = el("div", { class: "parcel" });
  parcels.push(node);
  $("strip").append(node);
  return node;
}

export const entryOf = (index) => entries[index];

// Small pictures are asked for once the first large one is there.
let pictured = false;
export function showThumbnails() {
  pictured = true;
  entries.forEach((node, i) => { node.firstChild.src ||= thumbnailOf(i); });
}

const entry = (image, i) => el("button", {
    title: image.name, data: { index: i }, onclick: () => go(i), onkeydown: arrows, tabIndex: -1,
  },
  el("img", { ...(pictured ? { src: thumbnailOf(i) } : {}), alt: "", loading: "lazy", decoding: "async" }),
  el("span", { class: "badge", data: { badge: "" } }, "…"),
  el("span", { class: "name" }, el("b", {}, image.name.split("/").pop()), el("span", {}, image.location)));

// The strip is one stop of the Tab key; arrows go along it.
function arrows(event) {
  const last = state.session.images.length - 1;
  const to = { ArrowDown: near(state.index, 1), ArrowUp: near(state.index, -1), Home: near(-1, 1), End: near(last + 1, -1) }[event.key];
  if (to === undefined || to < 0 || to > last) return;
  event.preventDefault();
  go(to);
  entries[to].focus();
}

// The next image to either side that the filter lets through.
export function near(index, by) {
  let to = index + by;
  while (to >= 0 && to < state.session.images.length && entries[to].hidden) to += by;
  return to;
}

export function go(index) {
  if (index < 0 || index >= state.session.images.length) return;
  state.index = index;
  state.selected = null;
  show();
}

const followers = [];
export const onMark = (f) => followers.push(f);

export function mark() {
  followers.forEach((f) => f());
  if (marked === state.index) return;
  [[entries[marked], false], [entries[state.index], true]].forEach(([button, current]) => {
    button?.setAttribute("aria-current", current);
    if (button) button.tabIndex = current ? 0 : -1;
  });
  marked = state.index;
  const button = entries[marked];
  if (button.hidden) { button.hidden = false; measureParcel(button.parentNode); }
  button.scrollIntoView({ block: "nearest" });
}

export function badgeText(row) {
  if (row.badge === "count" || row.badge === "out") return String(found(row));
  return row.badge === "some" ? String(row.labelled) : SIGNS[row.badge];
}

// How many spots, points or corners there are.
export const found = (row) => row.found ?? 0;

export function setBadge(row) {
  const button = entries[row.index];
  latest[row.index] = row;
  if (filtering()) {
    const hidden = row.index !== state.index && !passes(row, row.index);
    if (hidden !== button.hidden) { button.hidden = hidden; measureParcel(button.parentNode); }
  }
  const node = button.querySelector(".badge"), badge = badgeText(row);
  if (node.dataset.badge !== row.badge) Object.assign(node.dataset, { badge: row.badge }), (node.className = `badge ${row.badge}`);
  if (node.textContent !== badge) node.textContent = badge;
  button.title = `${state.session.images[row.index].name}: ${row.error || t(WORDS[row.badge])}`;
}
