// The A/B wipe: left of a line the last saved set (or one of the history), right of it the parameters as they stand.

import { hashOf, post } from "./api.js";
import { onLayers } from "./layers.js";
import { listen, state } from "./state.js";
import { onMark } from "./strip.js";
import { t } from "./words.js";

export const wipe = { at: 0.5, answer: null, text: null, name: "" };
const HOLD_PX = 9; // of the line to either side
let redraw = () => {}, asked = "";

export function startWipe(draw) {
  redraw = draw;
  listen(look);
  onMark(look);
  onLayers((id) => { if (id === "before") look(); });
}

// Another set of the history to compare with; null: the last saved one.
export function compareWith(text, name = "") {
  Object.assign(wipe, { text, name, answer: null });
  asked = "";
  look();
}

const other = () => wipe.text ?? state.savedText;

async function look() {
  if (!state.layers?.before) return;
  const { index } = state, config = other(), key = `${index} ${config}`;
  if (asked === key) return;
  asked = key;
  try {
    const answer = await post("process", { index, config });
    if (asked !== key || answer.hash !== (await hashOf(config))) return;
    wipe.answer = answer;
    redraw();
  } catch { wipe.answer = null; }
}

export function drawWipe(context, width, height, paint) {
  if (!state.layers.before || wipe.answer?.index !== state.index) return;
  const x = Math.round(wipe.at * width);
  context.save();
  context.beginPath();
  context.rect(0, 0, x, height);
  context.clip();
  context.clearRect(0, 0, x, height);
  paint(wipe.answer);
  context.restore();
  context.fillStyle = "#ffffff";
  context.fillRect(x - 1, 0, 2, height);
  context.beginPath();
  context.arc(x, height / 2, 7, 0, 2 * Math.PI);
  context.fill();
  context.font = "600 12px system-ui, sans-serif";
  context.textBaseline = "top";
  for (const [text, align, at] of [[`A  ${wipe.name || t("last saved")}`, "right", x - 10], [`B  ${t("as it stands")}`, "left", x + 10]]) {
    context.textAlign = align;
    context.lineWidth = 3;
    context.strokeStyle = "rgb(0 0 0 / .75)";
    context.strokeText(text, at, 8);
    context.fillText(text, at, 8);
  }
}

// Whether the line is held at this place of the canvas; with `moved`, it goes there.
export function dragWipe([x], moved, width) {
  if (!state.layers.before) return false;
  if (moved) {
    wipe.at = Math.min(1, Math.max(0, x / width));
    redraw();
    return true;
  }
  return Math.abs(x - wipe.at * width) <= HOLD_PX;
}

