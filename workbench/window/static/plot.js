// The (y, z) plot of the laser plane [mm]: field of view, surface points, axis points, σ and truth.

import { el, clear, fitCanvas, style } from "./dom.js";
import { LABEL_FONT, colourOf, nameOf, pillarName, tag } from "./overlay.js";
import { drawProfilePoints, sigmaGain } from "./stripe.js";
import { number, t as words } from "./words.js";

export const SIGMA_GAIN = 200, ERROR_GAIN = 200;

// What the plot fits to: the points with room around them; without points the field of view.
export function plotBox(session, answer) {
  const s = answer?.stripe;
  const found = s?.y ? s.y.map((y, i) => [y, s.z[i]]) : (answer?.spots ?? []).map((p) => p.surface).filter((p) => p[0] !== null);
  const points = found.length > 1 ? found : session.sensor.field_of_view;
  if (!points.length) return [-100, 0, 100, 300];
  const ys = points.map((p) => p[0]), zs = points.map((p) => p[1]);
  const pad = 0.06 * Math.max(Math.max(...zs) - Math.min(...zs), Math.max(...ys) - Math.min(...ys), 20);
  return [Math.min(...ys) - pad, Math.min(...zs) - pad, Math.max(...ys) + pad, Math.max(...zs) + pad];
}

export function drawPlot(canvas, view, session, answer, show) {
  const { context, width, height } = fitCanvas(canvas);
  context.fillStyle = style("--raised");
  context.fillRect(0, 0, width, height);
  grid(context, view, width, height);
  outline(context, view, session.sensor.field_of_view);
  if (show.spots || show.labels) answer?.spots.forEach((s, i) => point(context, view, s, show.selected === `s${i}`));
  if (show.truth && answer?.truth) answer.truth.strings.forEach((t) => trueString(context, view, t));
  drawProfilePoints(context, view, answer, show);
  return { context, width, height };
}

function grid(context, view, width, height) {
  const rough = 90 / view.scale, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough);
  const digits = Math.max(0, -Math.floor(Math.log10(step)));
  const [y0, z0] = view.toContent(0, 0), [y1, z1] = view.toContent(width, height);
  context.font = "11px system-ui, sans-serif";
  context.strokeStyle = style("--edge-soft");
  context.fillStyle = style("--quiet");
  context.lineWidth = 1;
  context.textBaseline = "bottom";
  for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) {
    const x = view.toScreen(y, 0)[0];
    line(context, x, 0, x, height);
    context.textAlign = "center";
    if (x > 46 && x < width - 16) context.fillText(number(y + 0, digits), x, height - 3); // whole or not at all
  }
  for (let z = Math.ceil(z0 / step) * step; z <= z1; z += step) {
    const y = view.toScreen(0, z)[1];
    line(context, 0, y, width, y);
    context.textAlign = "left";
    if (y > 34 && y < height - 6) context.fillText(number(z + 0, digits), 4, y - 1); // above it the axis is named
  }
  context.textAlign = "right";
  context.fillText("y [mm] →", width - 6, height - 16);
  context.textBaseline = "top";
  context.textAlign = "left";
  context.fillText("z [mm] ↓", 4, 4);
}

function line(context, a, b, c, d) {
  context.beginPath();
  context.moveTo(a, b);
  context.lineTo(c, d);
  context.stroke();
}

function outline(context, view, polygon) {
  if (!polygon.length) return;
  context.strokeStyle = style("--quiet");
  context.setLineDash([6, 4]);
  context.beginPath();
  polygon.forEach(([y, z]) => context.lineTo(...view.toScreen(y, z)));
  context.closePath();
  context.stroke();
  context.setLineDash([]);
}

function point(context, view, s, selected) {
  if (s.surface[0] === null) return;
  const [x, y] = view.toScreen(...s.surface);
  const colour = inkOf(s.label);
  ellipse(context, x, y, s.cov, view.scale * SIGMA_GAIN, colour);
  context.lineWidth = selected ? 3 : 1.5;
  context.strokeStyle = colour;
  context.beginPath();
  context.arc(x, y, 4, 0, 2 * Math.PI);
  context.stroke();
  if (!s.axis) return;
  const [a, b] = view.toScreen(...s.axis);
  context.fillStyle = colour;
  context.beginPath();
  context.arc(a, b, 2.5, 0, 2 * Math.PI);
  context.fill();
  word(context, nameOf(s.label), x + 9, y - 9, colour);
}

const dark = () => document.documentElement.dataset.theme === "dark";
const DARK_INK = { "A": "#8a6400", "B": "#0b6bcb", "C": "#14773a", "B'": "#b34a12", "C'": "#6b3fc4", "D'": "#b02a68" };
const inkOf = (label) => dark() ? colourOf(label) : DARK_INK[pillarName(label)] ?? "#0b7d77";

function word(context, text, x, y, colour) {
  if (dark()) { tag(context, text, x, y, colour); return; }
  context.font = LABEL_FONT;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

function ellipse(context, x, y, [a, b, , d], gain, colour) {
  const mean = (a + d) / 2, root = Math.hypot((a - d) / 2, b);
  const long = Math.sqrt(Math.max(mean + root, 0)) * gain, thin = Math.sqrt(Math.max(mean - root, 0)) * gain;
  if (!(long < 1e4)) return;
  context.globalAlpha = 0.22;
  context.fillStyle = colour;
  context.beginPath();
  context.ellipse(x, y, long, thin, 0.5 * Math.atan2(2 * b, a - d), 0, 2 * Math.PI);
  context.fill();
  context.globalAlpha = 1;
}

function trueString(context, view, t) {
  const to = t.of === "axis" ? t.axis : t.surface;
  if (!to || to[0] === null) return;
  const [x, y] = view.toScreen(...to);
  context.strokeStyle = t.spot < 0 && t.visible >= 0.9 ? style("--bad") : dark() ? "#ff8df0" : "#b01aa0";
  context.lineWidth = 1.5;
  line(context, x - 4, y, x + 4, y);
  line(context, x, y - 4, x, y + 4);
  if (t.mm) line(context, x, y, x + t.mm[0] * view.scale * ERROR_GAIN, y + t.mm[1] * view.scale * ERROR_GAIN);
}

export function plotLegend(node, hasTruth, stripe) {
  const spots = words`○ lit surface · • string axis · ellipse: σ × ${SIGMA_GAIN}` + (hasTruth ? ` · ${words`+ truth, error × ${ERROR_GAIN}`}` : "");
  clear(node, el("em", {}, stripe ? words`▪ point of the stripe · bar: σ × ${sigmaGain()}` : spots));
}

export function hitPlot(view, answer, [a, b]) {
  let best = null, nearest = 14;
  answer?.spots.forEach((s, i) => {
    if (s.surface[0] === null) return;
    const [x, y] = view.toScreen(...s.surface), d = Math.hypot(a - x, b - y);
    if (d < nearest) { nearest = d; best = { kind: "spot", index: i }; }
  });
  return best;
}
