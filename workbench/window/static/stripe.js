// A stripe, a profile or a board, drawn over the image and in the laser plane.

import { style } from "./dom.js";
import { number, t } from "./words.js";

const SATURATED = 1, AMBIGUOUS = 8;
export const GOOD = "#4de08a", DOUBT = "#58aefb", CLIPPED = "#ff5d5d", RIVAL = "#ffb84d", FEATURE = "#ff8df0", CORNER = "#ffd166";
export const SIGMA_GAIN_PX = 20;
const GAINS = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000], TYPICAL_PX = 14;
let gain = 100; // of σ in the laser plane: so that a usual one is some pixels long on the screen

export const sigmaGain = () => gain;

function chooseGain([a, , d], n, scale) {
  const typical = Math.sqrt(Math.max(a[n >> 1] + d[n >> 1], 1e-12)) * scale;
  gain = GAINS.findLast((g) => g * typical <= TYPICAL_PX) ?? 1;
}

export const colourOfFlag = (flag) => (flag & AMBIGUOUS ? RIVAL : flag & SATURATED ? CLIPPED : flag ? DOUBT : GOOD);
const inkOfFlag = (flag, dark) => (dark ? colourOfFlag(flag) : flag & AMBIGUOUS ? "#b06500" : flag & SATURATED ? "#c0232c" : flag ? "#0b6bcb" : "#14773a");

const dark = () => document.documentElement.dataset.theme === "dark";

export function drawStripe(context, view, answer, show) {
  const s = answer?.stripe;
  if (answer?.board) board(context, view, answer.board, show);
  if (!s?.u || !show.points) return;
  const on = new Set(answer.feature?.points ?? []), size = Math.max(2, Math.min(6, view.scale));
  for (let i = 0; i < s.n; i++) {
    if (s.flag[i] && !show.doubtful) continue;
    const [x, y] = view.toScreen(s.u[i], s.v[i]);
    if (x < -9 || y < -9 || x > context.canvas.width || y > context.canvas.height) continue;
    const colour = show.feature && on.has(i) ? FEATURE : colourOfFlag(s.flag[i]);
    context.strokeStyle = context.fillStyle = colour;
    if (show.width && view.scale > 1.5) bar(context, x, y, s.normal, i, s.width[i] * view.scale, 0.35);
    if (view.scale >= 6) bar(context, x, y, s.normal, i, s.sigma[i] * SIGMA_GAIN_PX * view.scale, 1);
    context.fillRect(x - size / 2, y - size / 2, size, size);
  }
  const i = show.selected?.[0] === "p" ? Number(show.selected.slice(1)) : null;
  if (i !== null && i < s.n) {
    const [x, y] = view.toScreen(s.u[i], s.v[i]);
    context.strokeStyle = "#ffffff";
    context.lineWidth = 2;
    context.strokeRect(x - 6, y - 6, 12, 12);
  }
}

function bar(context, x, y, normal, i, half, alpha) {
  context.globalAlpha = alpha;
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(x - normal[0][i] * half, y - normal[1][i] * half);
  context.lineTo(x + normal[0][i] * half, y + normal[1][i] * half);
  context.stroke();
  context.globalAlpha = 1;
}

function board(context, view, found, show) {
  if (!show.corners) return;
  context.strokeStyle = CORNER;
  context.lineWidth = 1.4;
  found.u.forEach((u, i) => {
    const [x, y] = view.toScreen(u, found.v[i]), r = Math.max(4, Math.min(9, 3 * view.scale));
    context.beginPath();
    context.moveTo(x - r, y);
    context.lineTo(x + r, y);
    context.moveTo(x, y - r);
    context.lineTo(x, y + r);
    context.stroke();
  });
}

export function drawProfilePoints(context, view, answer, show) {
  const s = answer?.stripe;
  if (!s?.y || !show.points) return;
  const on = new Set(answer.feature?.points ?? []), theme = dark(), feature = theme ? FEATURE : "#b01aa0";
  if (s.n) chooseGain(s.cov, s.n, view.scale);
  for (let i = 0; i < s.n; i++) {
    const flag = s.flag?.[i] ?? 0;
    if (flag && !show.doubtful) continue;
    const [x, y] = view.toScreen(s.y[i], s.z[i]);
    context.strokeStyle = context.fillStyle = show.feature && on.has(i) ? feature : inkOfFlag(flag, theme);
    sigma(context, x, y, s.cov, i, view.scale);
    context.fillRect(x - 1.25, y - 1.25, 2.5, 2.5);
  }
  const i = show.selected?.[0] === "p" ? Number(show.selected.slice(1)) : null;
  if (i !== null && i < s.n) {
    const [x, y] = view.toScreen(s.y[i], s.z[i]);
    context.strokeStyle = style("--text");
    context.lineWidth = 1.5;
    context.strokeRect(x - 5, y - 5, 10, 10);
  }
  if (show.feature && answer.feature) features(context, view, answer.feature, feature);
  if (show.feature && answer.gap && !answer.gap.text) gap(context, view, answer.gap, answer.values);
}

// σ along its long axis, as a stripe's covariance has rank one; where it has not, its ellipse.
function sigma(context, x, y, [a, b, d], i, scale) {
  const half = Math.hypot((a[i] - d[i]) / 2, b[i]), mean = (a[i] + d[i]) / 2;
  const long = Math.sqrt(Math.max(mean + half, 0)) * scale * gain, thin = Math.sqrt(Math.max(mean - half, 0)) * scale * gain;
  if (!(long > 2) || long > 4000) return;
  const turn = 0.5 * Math.atan2(2 * b[i], a[i] - d[i]), dx = Math.cos(turn) * long, dy = Math.sin(turn) * long;
  if (thin > 0.3 * long) {
    context.globalAlpha = 0.12;
    context.beginPath();
    context.ellipse(x, y, long, thin, turn, 0, 2 * Math.PI);
    context.fill();
    context.globalAlpha = 1;
    return;
  }
  context.globalAlpha = 0.22;
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(x - dx, y - dy);
  context.lineTo(x + dx, y + dy);
  context.stroke();
  context.globalAlpha = 1;
}

function features(context, view, found, colour) {
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 1.6;
  for (const c of found.curves) {
    context.beginPath();
    if (c.line) c.line.forEach((p) => context.lineTo(...view.toScreen(...p)));
    else {
      const [x, y] = view.toScreen(...c.centre);
      context.setLineDash([4, 4]);
      context.arc(x, y, c.radius * view.scale, 0, 2 * Math.PI);
      context.stroke();
      context.setLineDash([]);
      context.beginPath();
      context.arc(x, y, c.radius * view.scale, ...c.angles);
      context.stroke();
      context.beginPath();
      context.moveTo(x - 6, y);
      context.lineTo(x + 6, y);
      context.moveTo(x, y - 6);
      context.lineTo(x, y + 6);
    }
    context.stroke();
  }
  if (!found.corner) return;
  const [x, y] = view.toScreen(...found.corner);
  context.beginPath();
  context.arc(x, y, 6, 0, 2 * Math.PI);
  context.stroke();
}

function gap(context, view, found, values) {
  const ink = style("--bad"), panel = style("--accent"), to = (p) => view.toScreen(...p);
  context.lineWidth = 1.8;
  context.strokeStyle = panel;
  for (const { face, centre, radius } of found.edges) {
    context.beginPath();
    face.forEach((p) => context.lineTo(...to(p)));
    context.stroke();
    if (radius > 0) {
      context.setLineDash([4, 4]);
      context.beginPath();
      context.arc(...to(centre), radius * view.scale, 0, 2 * Math.PI);
      context.stroke();
      context.setLineDash([]);
    }
  }
  const value = (key) => values.find((v) => v.key === key)?.value;
  context.strokeStyle = context.fillStyle = ink;
  arrow(context, ...found.gap.map(to), `${t("gap")} ${number(value("gap_mm"), 3)} mm`, 22);
  arrow(context, ...found.flush.map(to), `${t("flush")} ${number(value("flush_mm"), 3)} mm`, 0);
}

function arrow(context, [x0, y0], [x1, y1], text, drop) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x0, y0 + drop);
  context.lineTo(x1, y1 + drop);
  context.lineTo(x1, y1);
  context.stroke();
  for (const [x, y] of [[x0, y0], [x1, y1]]) {
    context.beginPath();
    context.arc(x, y, 3, 0, 2 * Math.PI);
    context.fill();
  }
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "bottom";
  context.fillText(text, (x0 + x1) / 2, Math.min(y0, y1) + drop - 4 + (drop ? 18 + drop : -8));
}

// The nearest point under the pointer, in the image or in the laser plane.
export function hitStripe(view, answer, [a, b], inPlane) {
  const s = answer?.stripe, across = inPlane ? s?.y : s?.u, down = inPlane ? s?.z : s?.v;
  if (!across) return null;
  let best = null, nearest = 14;
  for (let i = 0; i < s.n; i++) {
    const [x, y] = view.toScreen(across[i], down[i]), d = Math.abs(x - a) + Math.abs(y - b);
    if (d < nearest) { nearest = d; best = { kind: "point", index: i }; }
  }
  return best;
}

export function stripeLegend(show, answer) {
  if (!answer?.stripe) return [];
  const entries = [];
  if (show.points) entries.push(["l-good", t("point")]);
  const flags = answer.stripe.flags ?? {};
  if (show.doubtful && flags.ambiguous) entries.push(["l-rival", t("ambiguous")]);
  if (show.doubtful && flags.saturated) entries.push(["l-clip", t("saturated")]);
  if (show.doubtful && (flags.shape || flags.edge)) entries.push(["l-doubt", t("doubted otherwise")]);
  if (show.feature && answer.feature?.points.length) entries.push(["l-true", t("on the feature")]);
  if (show.corners && answer.board?.u.length) entries.push(["l-mask", t("corner")]);
  return entries;
}

