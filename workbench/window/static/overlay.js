// What was detected, drawn over the image: candidates, spots, labels, truth.

import { t as words } from "./words.js";

export const STRING_COLOURS = { "A": "#ffd166", "B": "#4cc9f0", "C": "#8ce99a", "B'": "#ff9f6b", "C'": "#c3a6ff", "D'": "#f28ab2" };
let strings = []; // the jig's, in its order: by it, strings of other names take the colours of the pillar's
export const nameStrings = (names) => { strings = names; };
export const pillarName = (label) => {
  if (STRING_COLOURS[label] || !strings.includes(label)) return label;
  const names = Object.keys(STRING_COLOURS);
  return names[strings.indexOf(label) % names.length];
};
export const colourOf = (label) => STRING_COLOURS[pillarName(label)] ?? "#3fd0c9";
export const nameOf = (label) => label; // as files have it: a typographic prime is too fine to tell C' from C
const GOOD = "#4de08a", BAD = "#ff8a7a", SPOT = "#3fd0c9", TRUE = "#ff8df0", FALSE = "#ff5d5d";
export const LABEL_FONT = "700 15px system-ui, sans-serif";
const GAIN = 150; // error vectors are drawn this much longer

export function drawOverlay(context, view, answer, show) {
  if (!answer) return;
  answer.candidates.forEach((c, i) => { if (seen(c, show)) candidate(context, view, c, show.selected === `c${i}`); });
  if (show.spots || show.labels) answer.spots.forEach((s, i) => spot(context, view, s, show, show.selected === `s${i}`));
  if (show.truth && answer.truth) truth(context, view, answer);
}

const seen = (c, show) => (c.reason ? show.rejected : show.accepted);

function candidate(context, view, c, selected) {
  const [x0, y0] = view.toScreen(c.box[0] - 0.5, c.box[1] - 0.5);
  const [x1, y1] = view.toScreen(c.box[2] + 0.5, c.box[3] + 0.5);
  const w = Math.max(9, x1 - x0), h = Math.max(9, y1 - y0);
  context.strokeStyle = c.reason ? BAD : GOOD;
  context.lineWidth = selected ? 3 : 1.3;
  context.setLineDash(c.reason ? [4, 3] : []);
  context.strokeRect((x0 + x1 - w) / 2, (y0 + y1 - h) / 2, w, h);
  context.setLineDash([]);
}

function spot(context, view, s, show, selected) {
  const [x, y] = view.toScreen(s.u, s.v);
  const colour = show.labels && s.label ? colourOf(s.label) : SPOT;
  const dim = show.labels && strings.length && !s.label;
  context.globalAlpha = dim ? 0.6 : 1;
  context.strokeStyle = colour;
  context.lineWidth = selected ? 2.6 : 1.4;
  context.beginPath();
  const long = Math.max(6, 2 * s.width[0] * view.scale), thin = Math.max(4, 2 * s.width[1] * view.scale);
  context.ellipse(x, y, long + 2, thin + 2, s.angle, 0, 2 * Math.PI);
  context.stroke();
  if (view.scale > 2.5) cross(context, x, y, 5);
  if (s.flag) {
    context.setLineDash([2, 3]);
    context.beginPath();
    context.arc(x, y, long + 7, 0, 2 * Math.PI);
    context.stroke();
    context.setLineDash([]);
  }
  if (show.labels && s.label) tag(context, nameOf(s.label), x + long + 5, y - 9, colour);
  context.globalAlpha = 1;
}

function cross(context, x, y, r) {
  context.beginPath();
  context.moveTo(x - r, y);
  context.lineTo(x + r, y);
  context.moveTo(x, y - r);
  context.lineTo(x, y + r);
  context.stroke();
}

export function tag(context, text, x, y, colour) {
  context.font = LABEL_FONT;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.lineWidth = 3;
  context.strokeStyle = "rgb(0 0 0 / .75)";
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

function truth(context, view, answer) {
  for (const t of answer.truth.strings) {
    const [x, y] = view.toScreen(t.u, t.v);
    context.strokeStyle = t.visible >= 0.9 && t.spot < 0 ? FALSE : TRUE;
    context.lineWidth = 1.4;
    if (t.spot < 0) {
      context.setLineDash(t.visible >= 0.9 ? [] : [2, 3]);
      context.strokeRect(x - 9, y - 9, 18, 18);
      context.setLineDash([]);
      if (t.visible >= 0.9) tag(context, words`${nameOf(t.label)} missed`, x + 13, y, FALSE);
      continue;
    }
    cross(context, x, y, 3);
    const gain = view.scale < GAIN ? GAIN : view.scale;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + t.px[0] * gain, y + t.px[1] * gain);
    context.stroke();
    if (t.mislabelled) tag(context, words`is ${nameOf(t.label)}`, x + 13, y + 12, FALSE);
  }
  for (const k of answer.truth.false) {
    const s = answer.spots[k];
    const [x, y] = view.toScreen(s.u, s.v);
    context.strokeStyle = FALSE;
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(x - 7, y - 7);
    context.lineTo(x + 7, y + 7);
    context.moveTo(x + 7, y - 7);
    context.lineTo(x - 7, y + 7);
    context.stroke();
  }
}

// The thing under the pointer: { kind, index } or null. Spots win over candidates.
export function hit(view, answer, show, [a, b]) {
  if (!answer) return null;
  let best = null, nearest = 14;
  const offer = (kind, index, distance) => { if (distance < nearest) { nearest = distance; best = { kind, index }; } };
  if (show.spots || show.labels) answer.spots.forEach((s, i) => {
    const [x, y] = view.toScreen(s.u, s.v);
    offer("spot", i, Math.hypot(a - x, b - y));
  });
  if (best) return best;
  let closest = Infinity;
  answer.candidates.forEach((c, i) => {
    if (!seen(c, show)) return;
    const [x0, y0] = view.toScreen(c.box[0] - 0.5, c.box[1] - 0.5), [x1, y1] = view.toScreen(c.box[2] + 0.5, c.box[3] + 0.5);
    const pad = Math.max(3, 7 - (x1 - x0) / 2), [x, y] = view.toScreen(c.u, c.v), distance = Math.hypot(a - x, b - y);
    if (a > x0 - pad && a < x1 + pad && b > y0 - pad && b < y1 + pad && distance < closest) {
      closest = distance;
      best = { kind: "candidate", index: i };
    }
  });
  return best;
}

export function legend(show, hasTruth) {
  const entries = [];
  if (show.mask) entries.push(["l-mask", words("lit")]);
  if (show.clipped) entries.push(["l-clip", words("clipped")]);
  if (show.accepted) entries.push(["l-good box", words("accepted")]);
  if (show.rejected) entries.push(["l-bad box", words("rejected (click: why)")]);
  if (show.spots) entries.push(["l-spot", words("spot, ring: 2 σ of its light; dashed: in doubt")]);
  if (show.truth && hasTruth) entries.push(["l-true", words`truth, error × ${GAIN}`], ["l-false", words("missed or false")]);
  return entries;
}
