// What lies over the picture: each layer has a switch, and several may be on. Strings and stripes have layers of their own.

import { $, clear, el } from "./dom.js";
import { listen, state } from "./state.js";
import { t } from "./words.js";

const strings = () => looksFor() === "strings", stripe = () => looksFor() !== "strings";
const images = () => state.session.has_images;
export const looksFor = () => (state.session.board ? "board" : state.session.has_images ? state.parameters.what : "stripe");

export const LAYERS = [
  { id: "background", title: "Background", key: "g", help: "The estimated background in place of the image", when: strings },
  { id: "mask", title: "Mask", key: "m", help: "Pixels that are lit", when: strings },
  { id: "clipped", title: "Clipped", key: "o", help: "Pixels at full scale, in red", when: images },
  { id: "region", title: "Region", key: "r", help: "The part of the image that is looked at", when: () => images() && !state.session.board },
  { id: "accepted", title: "Accepted", key: "a", help: "Candidates that became spots", when: strings },
  { id: "rejected", title: "Rejected", key: "x", help: "Candidates that were refused; a click says why", when: strings },
  { id: "spots", title: "Spots", key: "s", help: "Spots, two σ", when: strings },
  { id: "labels", title: "Labels", key: "l", help: "Names of the strings", when: () => strings() && state.session.strings.length > 0 },
  { id: "truth", title: "Truth", key: "t", help: "Errors against the truth", when: () => strings() && state.session.has_truth },
  { id: "points", title: "Points", key: "p", help: "Points of the stripe", when: stripe },
  { id: "doubtful", title: "In doubt", key: "v", help: "Points with a flag: ambiguous, clipped, odd or cut", when: stripe },
  { id: "width", title: "Width", key: "w", help: "The stripe's width at each point, one σ to both sides", when: () => stripe() && images() },
  { id: "feature", title: "Feature", key: "h", help: "The ball, line, edge or wedge and the points on it", when: () => stripe() && state.session.plane && !state.session.board },
  { id: "corners", title: "Corners", key: "q", help: "Corners of the board", when: () => Boolean(state.session.board) },
  { id: "before", title: "A/B", key: "i", help: "Left of the wipe the last saved set, right of it the parameters as they stand", when: () => images() },
];
const listeners = [];
let built = "";
export const onLayers = (f) => listeners.push(f);

export function buildLayers() {
  state.layers = {
    background: false, mask: false, clipped: true, region: true, accepted: false, rejected: false, spots: true, labels: true, truth: true,
    points: true, doubtful: true, width: false, feature: true, corners: true, before: false,
  };
  build();
  listen((what) => { if (what === "parameters" && built !== looksFor()) build(); });
}

function build() {
  built = looksFor();
  clear($("layers"), LAYERS.filter((l) => l.when()).map(({ id, title, key, help }) => el("button", {
    data: { layer: id }, title: `${t(help)} (${key.toUpperCase()})`, onclick: () => toggle(id),
  }, t(title))));
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
