// Two panes, the camera's image and the laser plane: they ask for the answer to the newest parameters, keep the old picture
// until it is there, drop what is stale, and share one cursor.

import { Refused, hashOf, isLost, pixels, post } from "./api.js";
import { $, clear, el, fitCanvas, style } from "./dom.js";
import { exportPng, exportSvg } from "./export.js";
import { drawProfile, showCandidate, showNothing, showPoint, showSpot } from "./inspector.js";
import { buildLayers, looksFor, onLayers } from "./layers.js";
import { buildMeasure, distance, drawMeasure, measure, onMeasure, place } from "./measure.js";
import { drawOverlay, hit, legend } from "./overlay.js";
import { onNumberRefused, problems } from "./params.js";
import { draw, forget, keep, kept, paint, paintRange } from "./picture.js";
import { loadPlane, toImage, toPlane } from "./plane.js";
import { showValues } from "./recipe.js";
import { corner, drawRegions, drawing, onRegion } from "./region.js";
import { drawStripe, hitStripe, stripeLegend } from "./stripe.js";
import { drawPlot, hitPlot, plotBox, plotLegend } from "./plot.js";
import { listen, state, text } from "./state.js";
import { mark, setBadge } from "./strip.js";
import { onTab } from "./tabs.js";
import { View } from "./view.js";
import { decimal, t, words } from "./words.js";
import { dragWipe, drawWipe, startWipe } from "./wipe.js";

const PLANE_MARGINS = [30, 26, 26, 34]; // [px] for the names of the axes, their numbers and the legend
const TOLD_MS = 6000; // for which it is told that what was typed is no number
const LATE_MS = 400; // after which a picture that is still the last image's says so
export const stage = { view: null, answer: null, layers: {} };
const panes = {};
let running = null, again = false, tick = 0, frame = 0, last = "image", late = 0, gone = false, told = { message: "", until: 0 };
let cursor = null; // { pane, at: [x, y] on its screen, uv: [u, v] | null, yz: [y, z] | null }

export function buildStage() {
  const { session } = state;
  buildLayers();
  buildMeasure();
  panes.image = pane("image", $("canvas"), [-0.5, -0.5, session.sensor.width - 0.5, session.sensor.height - 0.5]);
  panes.plane = pane("plane", $("plane"), plotBox(session, null));
  panes.plane.limits = [0.2, 2e4];
  panes.plane.margins = PLANE_MARGINS;
  panes.image.grab = (at, moved) => dragWipe(at, moved, $("canvas").clientWidth);
  stage.view = () => panes[last];
  stage.one = oneToOne;
  stage.next = next;
  stage.redraw = redraw;
  controls();
  $("stage").dataset.panes = !session.has_images ? "plane" : session.plane ? "both" : "image";
  if (session.plane && session.has_images) loadPlane().then(redraw, (error) => say(error.message, true));
  if (!session.has_images) last = "plane";
  onRegion(redraw);
  startWipe(redraw);
  onNumberRefused((message) => { told = { message, until: performance.now() + TOLD_MS }; if (message) say(message, true); });
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
  clearTimeout(late);
  late = setTimeout(() => {
    if (running && stage.answer && stage.answer.index !== state.index) notice(t`Working on ${state.session.images[state.index].name}; the picture is still ${state.session.images[stage.answer.index].name}`, true);
  }, LATE_MS);
  return refresh();
}

function notice(message, calm = false) {
  $("notice").className = `notice ${calm ? "calm" : ""}`;
  $("notice").hidden = !message;
  $("notice").textContent = message;
}

// The program does not answer this page any more: what is shown is of before.
export function lost(message) {
  gone = true;
  say(message, true);
  notice(message);
}

// It answers again.
export function found() {
  if (!gone) return;
  gone = false;
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
const stageOf = (id) => STAGES.includes(id) && state.layers[id] && looksFor() === "strings";
const unlessAborted = (error) => { if (error.name === "AbortError") throw error; return null; };

async function once(signal) {
  const { index } = state, config = text(), asked = tick, wantedStages = STAGES.filter(stageOf);
  try {
    const [answer, raw, ...layers] = await Promise.all([
      post("process", { index, config }, signal),
      !state.session.has_images ? null : kept(index) ?? pixels(`image/${index}`, null, signal).then(atOnce).catch(unlessAborted),
      ...wantedStages.map((name) => pixels("stage", { index, config, stage: name }, signal).catch(unlessAborted)),
    ]);
    const wanted = await hashOf(config);
    if (answer.hash !== wanted || index !== state.index || layers.some((l) => l && l.hash !== wanted)) return; // stale: dropped
    const picture = answer.error || !state.session.has_images ? (raw?.odd ? raw : null) : await ofSameFile(raw, answer, signal);
    if (answer.error) forget(index);
    else if (picture) keep(index, picture);
    if (picture && !picture.odd && picture.stamp !== answer.stamp) { again = true; return; } // overwritten once more
    accept(answer, picture, Object.fromEntries(wantedStages.map((name, i) => [name, layers[i]])), asked);
  } catch (error) {
    if (error.name === "AbortError" || (!isLost(error) && config !== text())) return; // of parameters that are gone
    problems(error instanceof Refused ? error.problems ?? {} : {});
    if (isLost(error)) { lost(error.message); return; }
    say(error.message, true);
    notice(stage.answer?.index === index ? "" : error.message); // what is shown is of another image, or nothing is
  }
}

// The very first picture is shown as it is, before anything was found in it.
function atOnce(raw) {
  if (stage.answer || stage.raw) return raw;
  stage.raw = raw;
  fitImage(raw);
  paintNow();
  requestAnimationFrame(() => performance.mark("picture"));
  return raw;
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
  if (first || !panes.plane.seen !== !seenIn(answer)) {
    panes.plane.box = plotBox(state.session, answer);
    panes.plane.seen = seenIn(answer);
    if (panes.plane.fitted) panes.plane.fit();
  }
  if (raw) fitImage(raw);
  showValues(answer, raw?.odd ? null : raw);
  problems({});
  setBadge(answer);
  gone = false;
  notice(answer.error);
  if (told.message && performance.now() < told.until) say(told.message, true);
  else say(words(answer.reason));
  paintNow();
  requestAnimationFrame(() => {
    const ms = performance.now() - asked;
    const own = answer.ms <= ms; // an answer that was kept took its own time earlier
    $("timing").textContent = own ? t`${ms.toFixed(0)} ms (detection ${answer.ms.toFixed(0)})` : t`${ms.toFixed(0)} ms (answer kept from before)`;
    $("hash").textContent = answer.hash.slice(0, 8);
    if (first) performance.mark(`shown ${answer.index}`);
    Object.assign(document.documentElement.dataset, { shown: `${answer.index}:${answer.hash}`, ms: ms.toFixed(1) });
  });
}

// The picture with its layers, of the whole image, to be saved.
export async function savePicture(kind) {
  const { raw } = stage, show = { ...showing(), before: false };
  if (!raw) throw new Refused(t("There is no picture to be saved"));
  const paintAll = (context, view) => {
    if (show.region) drawRegions(context, view, raw.width, raw.height);
    overlays(context, view, stage.answer, show);
  };
  await (kind === "svg" ? exportSvg : exportPng)(raw.surface, raw, paintAll);
}

const seenIn = (answer) => (answer.stripe?.n ?? answer.spots.length) > 1;

// A picture of another size is shown as a whole, too.
function fitImage(raw) {
  const box = [-0.5, -0.5, raw.width - 0.5, raw.height - 0.5], view = panes.image;
  if (view.box[2] === box[2] && view.box[3] === box[3]) return;
  view.box = box;
  if (view.fitted) view.fit();
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
  if (show.region) drawRegions(context, view, width, height);
  overlays(context, view, stage.answer, show);
  drawWipe(context, width, height, (before) => {
    if (image) draw(context, view, image, image.surface, width, height);
    if (show.region) drawRegions(context, view, width, height);
    overlays(context, view, before, show);
  });
  drawMeasure(context, view, true, cursor?.yz, "#ffffff");
  if (cursor?.pane === "plane" && cursor.uv) crosshair(context, view.toScreen(...cursor.uv), width, height, "#ffffff");
  const range = background?.range ? el("em", {}, t`background, ${background.range[0]} (black) … ${background.range[1]} DN (white)`) : null;
  const strings = looksFor() === "strings" ? legend(show, session.has_truth) : show.clipped ? [["l-clip", t("clipped")]] : [];
  clear($("legend"), range, [...strings, ...stripeLegend(show, stage.answer)].map(([c, text_]) => el("span", { class: c }, text_)));
}

function overlays(context, view, answer, show) {
  drawOverlay(context, view, answer, show);
  drawStripe(context, view, answer, show);
}

function plane() {
  const { session } = state, view = panes.plane;
  const { context, width, height } = drawPlot($("plane"), view, session, stage.answer, showing());
  drawMeasure(context, view, false, cursor?.yz, style("--text"));
  if (cursor?.pane === "image" && cursor.yz) crosshair(context, view.toScreen(...cursor.yz), width, height, style("--quiet"));
  plotLegend($("plane-legend"), session.has_truth && state.layers.truth, Boolean(stage.answer?.stripe));
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
  if (stage.answer?.stripe) return hitStripe(panes[name], stage.answer, at, name === "plane");
  return name === "plane" ? hitPlot(panes.plane, stage.answer, at) : hit(panes.image, stage.answer, showing(), at);
}

function hover(name, at) {
  cursor = null;
  if (at) {
    const [a, b] = panes[name].toContent(...at);
    if (drawing.kind && name === "image") drawing.free = [a, b];
    cursor = name === "plane" ? { pane: name, at, uv: toImage(a, b), yz: [a, b] } : { pane: name, at, uv: [a, b], yz: toPlane(a, b) };
  }
  redraw();
}

function click(name, at) {
  if (measure.on) { hover(name, at); place(cursor.yz); return; }
  if (drawing.kind && name === "image") {
    const [u, v] = panes.image.toContent(...at);
    corner(u, v, (p) => { const [x, y] = panes.image.toScreen(...p); return Math.hypot(x - at[0], y - at[1]) < 9; });
    return;
  }
  const found = under(name, at);
  state.selected = found ? found.kind[0] + found.index : null;
  redraw();
}

// The next spot, or candidate where those are shown: what a click selects, by keyboard.
function next(by) {
  if (stage.answer?.stripe) { nextPoint(by); return; }
  const kind = state.layers.rejected ? "c" : "s", list = kind === "c" ? stage.answer?.candidates : stage.answer?.spots;
  if (!list?.length) return;
  const now = state.selected?.[0] === kind ? Number(state.selected.slice(1)) : by > 0 ? -1 : 0;
  const index = (now + by + list.length) % list.length;
  state.selected = kind + index;
  cursor = null;
  if (!panes.image.fitted) panes.image.centre(list[index].u, list[index].v);
  redraw();
}

// The next point of the stripe that is in doubt, or simply the next one where none is.
function nextPoint(by) {
  const { n, flag } = stage.answer.stripe;
  if (!n) return;
  const now = state.selected?.[0] === "p" ? Number(state.selected.slice(1)) : by > 0 ? -1 : 0, doubted = flag?.some((f) => f);
  let index = now;
  do index = (index + by + n) % n; while (doubted && !flag[index] && index !== now);
  state.selected = "p" + index;
  cursor = null;
  if (!panes.image.fitted && stage.answer.stripe.u) panes.image.centre(stage.answer.stripe.u[index], stage.answer.stripe.v[index]);
  redraw();
}

function chosen() {
  const over = cursor ? under(cursor.pane, cursor.at) : null;
  if (over?.kind === "spot" || over?.kind === "point") return over;
  if (state.selected) return { kind: { s: "spot", c: "candidate", p: "point" }[state.selected[0]], index: Number(state.selected.slice(1)) };
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
  if (found?.kind === "point" && answer?.stripe && found.index < answer.stripe.n) {
    const i = found.index, s = answer.stripe;
    showPoint(s, i);
    if (s.u) drawProfile(raw, s.u[i], s.v[i], Math.atan2(s.normal[1][i], s.normal[0][i]), ["across", "along"], saturation, { peak: s.peak[i], width: [s.width[i], null] });
    else drawProfile(null, null);
    return;
  }
  showNothing(answer);
  const [u, v] = cursor?.uv ?? [null, null];
  drawProfile(raw, u === null ? null : Math.round(u), Math.round(v ?? 0), 0, ["along u", "along v"], saturation);
}

function where(raw) {
  const parts = [];
  if (cursor?.uv) {
    const [u, v] = cursor.uv.map(Math.round), inside = raw && u >= 0 && v >= 0 && u < raw.width && v < raw.height;
    if (inside) parts.push(`u ${String(u).padStart(4)}  v ${String(v).padStart(4)}  ${String(raw.values[v * raw.width + u]).padStart(3)} DN`);
  }
  if (cursor?.yz) parts.push(`y ${cursor.yz[0].toFixed(2)}  z ${cursor.yz[1].toFixed(2)} mm`.replaceAll(".", decimal()));
  if (measure.on) parts.push(distance(cursor?.yz));
  $("where").textContent = parts.join("   ");
}
