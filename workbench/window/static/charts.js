// The calibration's charts: Fig. 7, and the residuals of every frame. A click on a dot opens its frame.

import { fitCanvas, style } from "./dom.js";
import { number, t } from "./words.js";

const LEFT = 46, RIGHT = 12;
const STEPS = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50];

// Runs of frames by location with a gap between; gives each frame's place and the frame at a place.
function layout(groups, width) {
  const count = groups.reduce((n, g) => n + g.frames.length + 1, -1) || 1;
  const x = (k) => LEFT + (width - LEFT - RIGHT) * (k + 0.5) / count;
  return { x, at: (px) => {
    const k = Math.round((px - LEFT) / (width - LEFT - RIGHT) * count - 0.5);
    let from = 0;
    for (const g of groups) {
      if (k >= from && k < from + g.frames.length) return g.frames[k - from];
      from += g.frames.length + 1;
    }
    return null;
  } };
}

function axis(context, y, low, top, width) {
  context.font = "11.5px system-ui, sans-serif";
  context.textBaseline = "alphabetic";
  const step = STEPS.find((s) => (top - low) / s <= 6) ?? 100;
  for (let d = Math.ceil(low / step) * step; d <= top; d += step) {
    context.strokeStyle = Math.abs(d) < 1e-9 ? style("--quiet") : style("--edge-soft");
    context.lineWidth = 1;
    context.beginPath();
    context.moveTo(LEFT, y(d));
    context.lineTo(width - 8, y(d));
    context.stroke();
    context.fillStyle = style("--quiet");
    context.textAlign = "right";
    context.fillText(number(d + 0, step < 0.1 ? 2 : step < 1 ? 1 : 0), LEFT - 6, y(d) + 4);
  }
  context.textAlign = "left";
  context.fillText("mm", 8, 14);
}

function places(context, groups, x, height) {
  let k = 0;
  context.fillStyle = style("--quiet");
  context.textAlign = "center";
  for (const g of groups) {
    context.fillText(`${g.name}${g.role === "verify" ? ` (${t("verify")})` : ""}`, (x(k) + x(k + g.frames.length - 1)) / 2, height - 6);
    k += g.frames.length + 1;
  }
}

function dots(context, values, x, y, from, colour, filled, join = true) {
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 1.5;
  if (join) {
    context.globalAlpha = 0.55;
    context.beginPath();
    values.forEach((v, i) => v !== null && context.lineTo(x(from + i), y(v)));
    context.stroke();
    context.globalAlpha = 1;
  }
  values.forEach((v, i) => {
    if (v === null) return;
    context.beginPath();
    context.arc(x(from + i), y(v), 3.6, 0, 2 * Math.PI);
    if (filled) context.fill();
    else context.stroke();
  });
}

function key(context, entries) {
  let left = LEFT + 4;
  context.textAlign = "left";
  for (const [sign, text, colour] of entries) {
    context.fillStyle = colour;
    const words = `${sign} ${t(text)}`;
    context.fillText(words, left, 14);
    left += context.measureText(words).width + 16;
  }
}

function clickable(canvas, at, open) {
  canvas.onclick = (event) => { const frame = at(event.offsetX); if (frame !== null) open(frame); };
}

const centred = (values) => {
  const good = values.filter((v) => v !== null), mean = good.reduce((a, b) => a + b, 0) / (good.length || 1);
  return values.map((v) => (v === null ? null : v - mean));
};

export function drawFig7(canvas, r, open) {
  const groups = Object.entries(r.locations).map(([name, l]) => ({
    name, role: l.role, frames: l.distances.frame, design: centred(l.distances.design_mm), solved: centred(l.distances.solved_mm),
  })).filter((g) => g.frames.length);
  const { context, width, height } = fitCanvas(canvas), { x, at } = layout(groups, width);
  context.clearRect(0, 0, width, height);
  if (!groups.length) { context.fillText(t("No location has a distance of its own to show."), LEFT, height / 2); return; }
  const top = 1.12 * Math.max(0.05, ...groups.flatMap((g) => [...g.design, ...g.solved]).filter((v) => v !== null).map(Math.abs));
  const y = (d) => 22 + (height - 48) * (top - d) / (2 * top);
  axis(context, y, -top, top, width);
  let k = 0;
  for (const g of groups) {
    dots(context, g.design, x, y, k, style("--changed"), false);
    dots(context, g.solved, x, y, k, style("--accent"), true);
    k += g.frames.length + 1;
  }
  places(context, groups, x, height);
  key(context, [["○", "by design", style("--changed")], ["●", "solved", style("--accent")]]);
  clickable(canvas, at, open);
}

const rms = (values) => (values.length ? Math.sqrt(values.reduce((n, v) => n + v * v, 0) / values.length) : null);

export function frameRms(f) {
  return f.rms_mm !== undefined ? f.rms_mm : rms((f.points ?? []).map((p) => p.residual_mm).filter((v) => v !== null));
}

export function drawResiduals(canvas, r, open) {
  const names = [...new Set(r.frames.map((f) => f.location))];
  const groups = names.map((name) => {
    const own = r.frames.filter((f) => f.location === name);
    return { name, role: own[0].role, frames: own.map((f) => f.frame), own };
  });
  const { context, width, height } = fitCanvas(canvas), { x, at } = layout(groups, width);
  context.clearRect(0, 0, width, height);
  const all = r.frames.flatMap((f) => [frameRms(f), ...(f.points ?? []).map((p) => p.residual_mm)]).filter((v) => v !== null && v !== undefined);
  const top = 1.1 * Math.max(0.01, ...all), y = (d) => 22 + (height - 48) * (top - d) / top;
  axis(context, y, 0, top, width);
  let k = 0;
  for (const g of groups) {
    g.own.forEach((f, i) => {
      context.fillStyle = style("--quiet");
      context.globalAlpha = 0.55;
      for (const p of f.points ?? []) {
        if (p.residual_mm === null) continue;
        context.fillRect(x(k + i) - 1.5, y(p.residual_mm) - 1.5, 3, 3);
      }
      context.globalAlpha = 1;
      if (!f.used) { context.fillStyle = style("--bad"); context.textAlign = "center"; context.fillText("×", x(k + i), y(0) - 2); }
    });
    dots(context, g.own.map((f) => (f.used ? frameRms(f) : null)), x, y, k, style("--accent"), true, false);
    k += g.frames.length + 1;
  }
  places(context, groups, x, height);
  key(context, [["●", "rms of the frame", style("--accent")], ["▪", "each point", style("--quiet")], ["×", "not used", style("--bad")]]);
  clickable(canvas, at, open);
}
