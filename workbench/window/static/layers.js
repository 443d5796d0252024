// What lies over the picture: each layer has a switch, and several may be on.

import { $, clear, el } from "./dom.js";
import { state } from "./state.js";

export const LAYERS = [
  { id: "background", title: "Background", key: "g", help: "The estimated background in place of the image" },
  { id: "mask", title: "Mask", key: "m", help: "Pixels that are lit" },
  { id: "clipped", title: "Clipped", key: "o", help: "Pixels at full scale, in red" },
  { id: "accepted", title: "Accepted", key: "a", help: "Candidates that became spots" },
  { id: "rejected", title: "Rejected", key: "x", help: "Candidates that were refused; a click says why" },
  { id: "spots", title: "Spots", key: "s", help: "Spots, two σ" },
  { id: "labels", title: "Labels", key: "l", help: "Names of the strings" },
  { id: "truth", title: "Truth", key: "t", help: "Errors against the truth" },
];
const listeners = [];
export const onLayers = (f) => listeners.push(f);

export function buildLayers() {
  const { session } = state;
  state.layers = { background: false, mask: false, clipped: true, accepted: false, rejected: false, spots: true, labels: true, truth: true };
  const there = LAYERS.filter((l) => (l.id !== "truth" || session.has_truth) && (l.id !== "labels" || session.strings.length));
  clear($("layers"), there.map(({ id, title, key, help }) => el("button", {
    data: { layer: id }, title: `${help} (${key.toUpperCase()})`, onclick: () => toggle(id),
  }, title)));
  mark();
}

export function toggle(id) {
  if (!$("layers").querySelector(`[data-layer="${id}"]`)) return;
  state.layers[id] = !state.layers[id];
  mark();
  listeners.forEach((f) => f(id));
}

function mark() {
  for (const button of $("layers").children) button.setAttribute("aria-pressed", state.layers[button.dataset.layer]);
}
