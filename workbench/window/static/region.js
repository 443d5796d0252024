// Polygons that are looked at, or left out, drawn over the image with the mouse.

import { $, clear, el } from "./dom.js";
import { change, listen, state } from "./state.js";
import { t } from "./words.js";

export const drawing = { kind: null, points: [], free: null }; // "keep" or "leave_out" while one is drawn
const listeners = [];
export const onRegion = (f) => listeners.push(f);
const tell = () => listeners.forEach((f) => f());

export function buildRegion() {
  listen((what) => { if (what === "parameters") mark(); });
  const button = (kind, title) => el("button", { data: { region: kind }, "aria-pressed": "false", onclick: () => start(kind) }, t(title));
  setTimeout(mark);
  return [
    el("div", { class: "line own" }, button("keep", "Look here"), button("leave_out", "Leave out")),
    el("p", { id: "region-hint", class: "advice calm", hidden: true }, t("Click the corners in the image; a click on the first one, or Enter, closes it; Esc gives up.")),
    el("ul", { id: "regions" }),
  ];
}

export function start(kind) {
  Object.assign(drawing, { kind: drawing.kind === kind ? null : kind, points: [], free: null });
  mark();
  tell();
}

function mark() {
  for (const button of document.querySelectorAll("[data-region]")) button.setAttribute("aria-pressed", String(button.dataset.region === drawing.kind));
  if (!$("regions")) return;
  $("region-hint").hidden = drawing.kind === null;
  clear($("regions"), ["keep", "leave_out"].flatMap((kind) => state.parameters.region[kind].map((polygon, i) => el("li", {},
    el("span", { class: kind }, kind === "keep" ? t`looked at, ${polygon.length} corners` : t`left out, ${polygon.length} corners`),
    el("button", { "aria-label": t`Remove region ${i + 1}`, onclick: () => change(`region.${kind}`, state.parameters.region[kind].filter((_, k) => k !== i), true) }, "×")))));
}

// A click in the image while a polygon is drawn: another corner, or the end.
export function corner(u, v, near) {
  const { points } = drawing;
  if (points.length >= 3 && near(points[0])) { close(); return; }
  points.push([Math.round(u * 10) / 10, Math.round(v * 10) / 10]);
  tell();
}

export function close() {
  const { kind, points } = drawing;
  Object.assign(drawing, { kind: null, points: [], free: null });
  if (kind && points.length >= 3) change(`region.${kind}`, [...state.parameters.region[kind], points], true);
  mark();
  tell();
}

export function giveUp() {
  Object.assign(drawing, { kind: null, points: [], free: null });
  mark();
  tell();
}

const KEEP = "#4de08a", OUT = "#ff8a7a";

export function drawRegions(context, view, width, height) {
  const { keep, leave_out } = state.parameters.region ?? { keep: [], leave_out: [] };
  const trace = (polygon) => polygon.forEach((p, i) => { const [x, y] = view.toScreen(...p); if (i) context.lineTo(x, y); else context.moveTo(x, y); });
  if (keep.length) { // what is not looked at is veiled
    context.fillStyle = "rgb(10 12 14 / .55)";
    context.beginPath();
    context.rect(0, 0, width, height);
    keep.forEach((polygon) => { trace(polygon); context.closePath(); });
    context.fill("evenodd");
  }
  for (const [polygons, colour, fill] of [[keep, KEEP, null], [leave_out, OUT, "rgb(255 90 80 / .28)"]]) {
    for (const polygon of polygons) {
      context.beginPath();
      trace(polygon);
      context.closePath();
      if (fill) { context.fillStyle = fill; context.fill(); }
      context.strokeStyle = colour;
      context.lineWidth = 1.5;
      context.stroke();
    }
  }
  if (!drawing.kind || !drawing.points.length) return;
  context.strokeStyle = context.fillStyle = drawing.kind === "keep" ? KEEP : OUT;
  context.lineWidth = 1.5;
  context.beginPath();
  trace(drawing.free ? [...drawing.points, drawing.free] : drawing.points);
  context.stroke();
  for (const p of drawing.points) {
    context.beginPath();
    context.arc(...view.toScreen(...p), 3.5, 0, 2 * Math.PI);
    context.fill();
  }
}
