// Two panes, the camera's image and the laser plane: they ask for the answer to the newest parameters, keep the old picture
// until it is there, drop what is stale, and share one cursor.

import { Refused, hashOf, pixels, post } from "./api.js";
import { $, clear, el, fitCanvas, style, words } from "./dom.js";
import { drawProfile, showCandidate, showNothing, showSpot } from "./inspector.js";
import { buildLayers, onLayers } from "./layers.js";
import { buildMeasure, distance, drawMeasure, measure, onMeasure, place } from "./measure.js";
import { drawOverlay, hit, legend } from "./overlay.js";
import { problems } from "./params.js";
import { draw, forget, keep, kept, paint, paintRange } from "./picture.js";
import { loadPlane, toImage, toPlane } from "./plane.js";
import { drawPlot, hitPlot, plotBox, plotLegend } from "./plot.js";
import { listen, state, text } from "./state.js";
import { mark, setBadge } from "./strip.js";
import { onTab } from "./tabs.js";
import { View } from "./view.js";

export const stage = { view: null, answer: null, layers: {} };
const panes = {};
let running = null, again = false, tick = 0, frame = 0, last = "image";
let cursor = null; // { pane, at: [x, y] on its screen, uv: [u, v] | null, yz: [y, z] | null }

export function buildStage() {
  const { session } = state;
  buildLayers();
  buildMeasure();
  panes.image = pane("image", $("canvas"), [-0.5, -0.5, session.sensor.width - 0.5, session.sensor.height - 0.5]);
  panes.plane = pane("plane", $("plane"), plotBox(session, null));
  panes.plane.limits = [0.2, 2e4];
  stage.view = () => panes[last];
  stage.one = oneToOne;
  stage.next = next;
  stage.redraw = redraw;
  controls();
  loadPlane().then(redraw, (error) => say(error.message, true));
  listen((what) => { if (what === "parameters") refresh(); });
  onLayers((id) => { if (stageOf(id)) refresh(); else redraw(); });
  onMeasure(redraw);
  onTab((id) => { if (id === "image") Object.values(panes).forEach((p) => (p.fitted ? p.fit() : redraw())); });
}

function pane(name, canvas, box) {
  const view = new View(canvas, redraw);
  view.box = box;
  view.hover = (at) => hover(name, at);
  view.click = (at) => click(name, at);
  canvas.addEventListener("focus", () => { last = name; });
  canvas.addEventListener("pointerdown", () => { last = name; });
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] }[event.key];
    if (!by) return;
    event.preventDefault();
    view.pan(...by);
  });
  return view;
}

function controls() {
  $("fit").onclick = () => Object.values(panes).forEach((p) => p.fit());
  $("one").onclick = oneToOne;
  $("zoom-in").onclick = () => panes[last].zoom(1.25);
  $("zoom-out").onclick = () => panes[last].zoom(0.8);
  $("bright").oninput = redraw;
}

function oneToOne() {
  const view = panes.image, s = stage.answer?.spots[Number(state.selected?.slice(1))];
  const [u, v] = s ? [s.u, s.v] : view.toContent($("canvas").clientWidth / 2, $("canvas").clientHeight / 2);
  view.centre(u, v, 1 / (window.devicePixelRatio || 1));
}

// Show the current image; the old picture stays until the new one is here.
export function show() {
  mark();
  running?.abort();
  running = null;
  refresh();
}

// Ask anew; the time to the picture counts from here, whoever asked.
export async function refresh() {
  tick = performance.now();
  if (running) { again = true; return; }
  const own = running = new AbortController();
  do {
    again = false;
    await once(own.signal);
  } while (again && running === own);
  if (running === own) running = null;
}

const STAGES = ["background", "mask"]; // layers that are pixels of their own
const stageOf = (id) => STAGES.includes(id) && state.layers[id];
const unlessAborted = (error) => { if (error.name === "AbortError") throw error; return null; };

async function once(signal) {
  const { index } = state, config = text(), asked = tick, wantedStages = STAGES.filter(stageOf);
  try {
    const [answer, raw, ...layers] = await Promise.all([
      post("process", { index, config }, signal),
      kept(index) ?? pixels(`image/${index}`, null, signal).catch(unlessAborted),
      ...wantedStages.map((name) => pixels("stage", { index, config, stage: name }, signal).catch(unlessAborted)),
    ]);
    const wanted = await hashOf(config);
    if (answer.hash !== wanted || index !== state.index || layers.some((l) => l && l.hash !== wanted)) return; // stale: dropped
    const picture = answer.error ? null : await ofSameFile(raw, answer, signal);
    if (answer.error) forget(index);
    else if (picture) keep(index, picture);
    if (picture && picture.stamp !== answer.stamp) { again = true; return; } // overwritten once more
    accept(answer, picture, Object.fromEntries(wantedStages.map((name, i) => [name, layers[i]])), asked);
  } catch (error) {
    if (error.name === "AbortError") return;
    problems(error instanceof Refused ? error.problems ?? {} : {});
    say(error.message, true);
    if (!stage.answer) $("notice").textContent = error.message;
  }
}

// The pixels that the answer was computed on: a file may have been overwritten since they were fetched.
async function ofSameFile(raw, answer, signal) {
  if (!raw || raw.stamp === answer.stamp) return raw;
  return pixels(`image/${answer.index}`, null, signal).catch(unlessAborted);
}

function accept(answer, raw, layers, asked) {
  const first = stage.answer?.index !== answer.index;
  if (first || stage.answer.hash !== answer.hash) state.selected = null;
  Object.assign(stage, { answer, raw, layers });
  if (first) {
    panes.plane.box = plotBox(state.session, answer);
    if (panes.plane.fitted) panes.plane.fit();
  }
  problems({});
  setBadge(answer);
  $("notice").className = "notice";
  $("notice").hidden = !answer.error;
  $("notice").textContent = answer.error;
  say(words(answer.reason));
  paintNow();
  requestAnimationFrame(() => {
    const ms = performance.now() - asked;
    $("timing").textContent = `${ms.toFixed(0)} ms (detection ${answer.ms.toFixed(0)})`;
    $("hash").textContent = answer.hash.slice(0, 8);
    Object.assign(document.documentElement.dataset, { shown: `${answer.index}:${answer.hash}`, ms: ms.toFixed(1) });
  });
}

export function say(message, bad = false) {
  $("message").textContent = message;
  $("message").classList.toggle("bad", bad);
}

const showing = () => ({ ...state.layers, selected: state.selected });

function redraw() {
  if (!frame) frame = requestAnimationFrame(() => { frame = 0; paintNow(); });
}

function paintNow() {
  if ($("stage").hidden) return;
  $("zoom").textContent = `${(panes.image.scale * (window.devicePixelRatio || 1) * 100).toFixed(0)} %`;
  picture();
  plane();
  readings();
}

function picture() {
  const { session } = state, { context, width, height } = fitCanvas($("canvas")), show = showing(), view = panes.image;
  context.clearRect(0, 0, width, height);
  const background = show.background ? stage.layers.background : null, image = background ?? stage.raw;
  if (image) {
    const lit = show.mask ? stage.layers.mask : null;
    const surface = background ? paintRange(background)
      : paint(image, session.sensor.saturation, Number($("bright").value), lit, show.clipped);
    draw(context, view, image, surface, width, height);
  }
  drawOverlay(context, view, stage.answer, show);
  drawMeasure(context, view, true, cursor?.yz, "#ffffff");
  if (cursor?.pane === "plane" && cursor.uv) crosshair(context, view.toScreen(...cursor.uv), width, height, "#ffffff");
  const range = background?.range ? el("em", {}, `background, ${background.range[0]} (black) … ${background.range[1]} DN (white)`) : null;
  clear($("legend"), range, legend(show, session.has_truth).map(([c, t]) => el("span", { class: c }, t)));
}

function plane() {
  const { session } = state, view = panes.plane;
  const { context, width, height } = drawPlot($("plane"), view, session, stage.answer, showing());
  drawMeasure(context, view, false, cursor?.yz, style("--text"));
  if (cursor?.pane === "image" && cursor.yz) crosshair(context, view.toScreen(...cursor.yz), width, height, style("--quiet"));
  plotLegend($("plane-legend"), session.has_truth && state.layers.truth);
}

function crosshair(context, [x, y], width, height, colour) {
  context.strokeStyle = colour;
  context.globalAlpha = 0.6;
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(x, 0);
  context.lineTo(x, height);
  context.moveTo(0, y);
  context.lineTo(width, y);
  context.stroke();
  context.globalAlpha = 1;
}

function under(name, at) {
  if (!at) return null;
  return name === "plane" ? hitPlot(panes.plane, stage.answer, at) : hit(panes.image, stage.answer, showing(), at);
}

function hover(name, at) {
  cursor = null;
  if (at) {
    const [a, b] = panes[name].toContent(...at);
    cursor = name === "plane" ? { pane: name, at, uv: toImage(a, b), yz: [a, b] } : { pane: name, at, uv: [a, b], yz: toPlane(a, b) };
  }
  redraw();
}

function click(name, at) {
  if (measure.on) { hover(name, at); place(cursor.yz); return; }
  const found = under(name, at);
  state.selected = found ? (found.kind === "spot" ? "s" : "c") + found.index : null;
  redraw();
}

// The next spot, or candidate where those are shown: what a click selects, by keyboard.
function next(by) {
  const kind = state.layers.rejected ? "c" : "s", list = kind === "c" ? stage.answer?.candidates : stage.answer?.spots;
  if (!list?.length) return;
  const now = state.selected?.[0] === kind ? Number(state.selected.slice(1)) : by > 0 ? -1 : 0;
  const index = (now + by + list.length) % list.length;
  state.selected = kind + index;
  cursor = null;
  if (!panes.image.fitted) panes.image.centre(list[index].u, list[index].v);
  redraw();
}

function chosen() {
  const over = cursor ? under(cursor.pane, cursor.at) : null;
  if (over?.kind === "spot") return over;
  if (state.selected) return { kind: state.selected[0] === "s" ? "spot" : "candidate", index: Number(state.selected.slice(1)) };
  return over;
}

function readings() {
  const { answer, raw } = stage, found = chosen(), saturation = state.session.sensor.saturation;
  where(raw);
  if (found?.kind === "spot" && answer?.spots[found.index]) {
    const s = answer.spots[found.index];
    showSpot(s, answer.truth?.strings.find((t) => t.spot === found.index));
    drawProfile(raw, s.u, s.v, s.angle, ["along", "across"], saturation, s);
    return;
  }
  if (found?.kind === "candidate" && answer?.candidates[found.index]) {
    const c = answer.candidates[found.index];
    showCandidate(c, answer.measures);
    drawProfile(raw, c.u, c.v, 0, ["along u", "along v"], saturation);
    return;
  }
  showNothing(answer, raw, saturation);
  const [u, v] = cursor?.uv ?? [null, null];
  drawProfile(raw, u === null ? null : Math.round(u), Math.round(v ?? 0), 0, ["along u", "along v"], saturation);
}

function where(raw) {
  const parts = [];
  if (cursor?.uv) {
    const [u, v] = cursor.uv.map(Math.round), inside = raw && u >= 0 && v >= 0 && u < raw.width && v < raw.height;
    if (inside) parts.push(`u ${String(u).padStart(4)}  v ${String(v).padStart(4)}  ${String(raw.values[v * raw.width + u]).padStart(3)} DN`);
  }
  if (cursor?.yz) parts.push(`y ${cursor.yz[0].toFixed(2)}  z ${cursor.yz[1].toFixed(2)} mm`);
  if (measure.on) parts.push(distance(cursor?.yz));
  $("where").textContent = parts.join("   ");
}
