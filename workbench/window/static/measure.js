// The distance of two points, taken in either pane: click one, then the other.

import { $ } from "./dom.js";
import { toImage } from "./plane.js";
import { number, t } from "./words.js";

export const measure = { on: false, points: [] }; // [y, z] mm
const listeners = [];
export const onMeasure = (f) => listeners.push(f);

export function buildMeasure() {
  $("measure").onclick = switchMeasure;
  mark();
}

export function switchMeasure() {
  measure.on = !measure.on;
  measure.points = [];
  mark();
  listeners.forEach((f) => f());
}

export function place(yz) {
  if (!yz) return;
  measure.points = measure.points.length === 1 ? [measure.points[0], yz] : [yz];
  listeners.forEach((f) => f());
}

const mark = () => $("measure").setAttribute("aria-pressed", measure.on);

// What is measured, in words; `free` is the point under the pointer while the second one is open.
export function distance(free) {
  const [a, b = free] = measure.points;
  if (!a || !b) return t("click the first point");
  const dy = b[0] - a[0], dz = b[1] - a[1];
  return `${t("distance")} ${number(Math.hypot(dy, dz), 3)} mm   Δy ${number(dy, 3)}   Δz ${number(dz, 3)}`;
}

export function drawMeasure(context, view, inImage, free, colour) {
  if (!measure.on || !measure.points.length) return;
  const shown = (measure.points.length === 1 && free ? [measure.points[0], free] : measure.points)
    .map(([y, z]) => (inImage ? toImage(y, z) : [y, z])).filter((p) => p).map((p) => view.toScreen(...p));
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 1.5;
  context.beginPath();
  shown.forEach((p) => context.lineTo(...p));
  context.stroke();
  for (const [x, y] of shown) {
    context.beginPath();
    context.arc(x, y, 3, 0, 2 * Math.PI);
    context.fill();
  }
}
