// All frames below: one dot a frame for the chosen value, the last saved set as a grey line; a click opens the frame.

import { $, clear, el, fitCanvas, style } from "./dom.js";
import { isFailed, onFilter, passes } from "./filter.js";
import { titleOf } from "./recipe.js";
import { state } from "./state.js";
import { go, onMark } from "./strip.js";
import { number, t } from "./words.js";

const worst = (r, of) => r.spots.reduce((most, s) => Math.max(most, of(s) ?? 0), 0);
const SPOTS = [
  { id: "labelled", title: "strings labelled", jig: true, of: (r) => r.labelled, digits: 0 },
  { id: "spots", title: "spots", of: (r) => r.spots.length, digits: 0 },
  { id: "rejected", title: "candidates rejected", of: (r) => r.candidates, digits: 0 },
  { id: "rms", title: "rms against the truth [mm]", truth: true, of: (r) => r.truth?.statistics.rms ?? null, digits: 4 },
  { id: "missed", title: "missed", truth: true, of: (r) => r.truth?.statistics.missed ?? null, digits: 0 },
  { id: "sigma", title: "largest σ [mm]", of: (r) => r.values.find((v) => v.key === "sigma_mm")?.value ?? null, digits: 4 },
  { id: "peak", title: "highest peak [DN]", of: (r) => worst(r, (s) => s.peak), digits: 0 },
  { id: "flagged", title: "spots in doubt", of: (r) => r.spots.filter((s) => s.flag).length, digits: 0 },
  { id: "ms", title: "detection [ms]", of: (r) => r.ms, digits: 0 },
];
const MS = SPOTS.find((v) => v.id === "ms");
const shown = { now: [], saved: [] };
let there = [];
let value = null, over = null;

export function buildTrend() {
  clear($("trend-head"), el("select", { id: "trend-value", "aria-label": t("Value of every frame"), onchange: (e) => { value = there[e.target.selectedIndex]; drawTrend(); } }), el("span", { id: "trend-text", class: "quiet" }));
  offer();
  onFilter(drawTrend);
  const canvas = $("trend");
  canvas.addEventListener("pointermove", (event) => { over = frameAt(event); drawTrend(); });
  canvas.addEventListener("pointerleave", () => { over = null; drawTrend(); });
  canvas.addEventListener("click", (event) => { const index = frameAt(event); if (index !== null) go(index); });
  onMark(drawTrend);
  new ResizeObserver(drawTrend).observe(canvas);
}

// The values that the rows have: of strings a fixed list, of stripes and boards what was measured.
function offer() {
  const { session } = state, row = shown.now.find((r) => r && !r.error);
  if (!row && there.length) return; // nothing is measured yet by these parameters: the values stay on offer
  const measured = (row?.stripe ? row.values : []).map((v) => ({
    id: v.key, title: titleOf(v.key) + (v.unit ? ` [${v.unit}]` : ""), digits: v.digits, of: (r) => r.values.find((x) => x.key === v.key)?.value ?? null, range: v.tool === "feature" || v.tool === "gapflush",
  }));
  const spots = SPOTS.filter((v) => (!v.truth || session.has_truth) && (!v.jig || session.strings.length)).map((v) => ({ ...v, title: t(v.title) }));
  const list = row?.stripe ? [...measured.filter((v) => v.id !== "clipped_px"), ...measured.filter((v) => v.id === "clipped_px"), { ...MS, title: t(MS.title) }] : spots;
  if (list.map((v) => v.id).join() === there.map((v) => v.id).join()) return;
  there = list;
  value = there.find((v) => v.id === value?.id) ?? there[0];
  clear($("trend-value"), there.map((v) => el("option", {}, v.title)));
  $("trend-value").selectedIndex = there.indexOf(value);
}

export function feedTrend(now, saved) {
  Object.assign(shown, { now, saved });
  offer();
  drawTrend();
}

const LEFT = 44, RIGHT = 10;
const count = () => state.session.images.length;

function frameAt(event) {
  const box = $("trend").getBoundingClientRect(), width = box.width - LEFT - RIGHT;
  const index = Math.floor((event.clientX - box.left - LEFT) / width * count());
  return index >= 0 && index < count() ? index : null;
}

export function drawTrend() {
  if (!value || $("drawer").hidden) return;
  const { context, width, height } = fitCanvas($("trend"));
  context.clearRect(0, 0, width, height);
  const of = (rows) => rows.map((r) => (r && !r.error ? value.of(r) : null));
  const now = of(shown.now), saved = of(shown.saved), all = [...now, ...saved].filter((x) => x !== null && x !== undefined);
  const [low, top] = limits(all);
  const x = (i) => LEFT + (width - LEFT - RIGHT) * (i + 0.5) / count(), y = (g) => height - 8 - (height - 16) * (g - low) / (top - low);
  frame(context, y, low, top, width);
  here(context, x, height);
  line(context, saved, x, y);
  const radius = Math.max(1, Math.min(3.2, (width - LEFT) / count() / 2.2));
  const colours = { out: style("--bad"), all: style("--good"), some: style("--warn"), none: style("--bad") }, other = style("--accent");
  now.forEach((g, i) => {
    if (g === null || g === undefined) {
      if (shown.now[i]?.error) cross(context, x(i), height - 12);
      return;
    }
    context.globalAlpha = passes(shown.now[i], i) ? 1 : 0.18;
    context.fillStyle = colours[shown.now[i].badge] ?? other;
    context.beginPath();
    context.arc(x(i), y(g), i === over ? radius + 2 : radius, 0, 2 * Math.PI);
    context.fill();
    context.globalAlpha = 1;
  });
  words(now);
}

// From nothing for counts and errors; for sizes the range that there is.
function limits(all) {
  const high = Math.max(...all, value.digits ? 1e-4 : 1), low = Math.min(...all);
  if (!value.range || !all.length) return [0, high * 1.08];
  const room = 0.12 * (high - low) || 0.05 * Math.abs(high) || 1e-3;
  return [low - room, high + room];
}

function frame(context, y, low, top, width) {
  context.strokeStyle = style("--edge-soft");
  context.fillStyle = style("--quiet");
  context.font = "10.5px system-ui, sans-serif";
  context.textAlign = "right";
  context.textBaseline = "middle";
  context.lineWidth = 1;
  for (const g of value.range ? [low, top] : [0, top / 1.08]) {
    context.beginPath();
    context.moveTo(LEFT, y(g));
    context.lineTo(width - RIGHT, y(g));
    context.stroke();
    context.fillText(number(g, value.digits), LEFT - 5, y(g));
  }
}

function here(context, x, height) {
  context.strokeStyle = style("--accent");
  context.globalAlpha = 0.5;
  context.beginPath();
  context.moveTo(x(state.index), 2);
  context.lineTo(x(state.index), height - 2);
  context.stroke();
  context.globalAlpha = 1;
}

function line(context, values, x, y) {
  context.strokeStyle = style("--quiet");
  context.globalAlpha = 0.55;
  context.beginPath();
  let open = false;
  values.forEach((g, i) => {
    if (g === null || g === undefined) { open = false; return; }
    if (open) context.lineTo(x(i), y(g));
    else context.moveTo(x(i), y(g));
    open = true;
  });
  context.stroke();
  context.globalAlpha = 1;
}

function cross(context, x, y) {
  context.strokeStyle = style("--bad");
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(x - 3, y - 3);
  context.lineTo(x + 3, y + 3);
  context.moveTo(x + 3, y - 3);
  context.lineTo(x - 3, y + 3);
  context.stroke();
}

function words(now) {
  const index = over ?? state.index, image = state.session.images[index], g = now[index];
  const name = image.name.split("/").pop(), figure = g === null || g === undefined ? "–" : number(g, value.digits);
  $("trend-text").textContent = `${name}  ${figure}`;
}

// The next image that is not whole: an error, or strings missing.
export function nextFailed(by) {
  for (let k = 1; k <= count(); k++) {
    const index = (((state.index + by * k) % count()) + count()) % count();
    if (isFailed(shown.now[index])) { go(index); return; }
  }
}
