// The picture: asks for the answer to the newest parameters, keeps the old picture until it is there, drops stale ones.

import { Refused, hashOf, pixels, post } from "./api.js";
import { $, clear, el, fitCanvas, words } from "./dom.js";
import { drawProfile, showCandidate, showNothing, showSpot } from "./inspector.js";
import { drawOverlay, hit, legend } from "./overlay.js";
import { problems } from "./params.js";
import { draw, forget, keep, kept, paint, paintRange } from "./picture.js";
import { drawPlot, hitPlot, plotBox, plotLegend } from "./plot.js";
import { listen, state, text } from "./state.js";
import { mark, setBadge } from "./strip.js";
import { onTab } from "./tabs.js";
import { View } from "./view.js";

export const stage = { view: null, answer: null, layer: null };
const views = {};
let running = null, again = false, tick = 0, cursor = null, frame = 0;

export function buildStage() {
  const canvas = $("canvas"), { session } = state;
  views.image = new View(canvas, redraw);
  views.image.box = [-0.5, -0.5, session.sensor.width - 0.5, session.sensor.height - 0.5];
  views.plot = new View(el("canvas"), () => {});
  const shared = Object.assign(views.plot, { canvas, changed: redraw, box: plotBox(session, null), limits: [0.2, 2e4] });
  const image = views.image;
  for (const name of ["wheel", "down", "move", "up", "fit"]) { // one canvas, two views: the shown one gets the events
    const own = image[name].bind(image);
    image[name] = (...a) => (state.view === "plot" ? shared[name](...a) : own(...a));
  }
  image.hover = shared.hover = hover;
  image.click = shared.click = click;
  stage.view = current;
  stage.one = () => oneToOne();
  stage.next = next;
  stage.redraw = redraw;
  controls();
  listen((what) => { if (what === "parameters") refresh(); });
  onTab(tabChanged);
}

function controls() {
  $("fit").onclick = () => current().fit();
  $("one").onclick = oneToOne;
  $("zoom-in").onclick = () => current().zoom(1.25);
  $("zoom-out").onclick = () => current().zoom(0.8);
  $("bright").oninput = $("truth").onchange = redraw;
  $("canvas").addEventListener("keydown", (event) => {
    const by = { ArrowLeft: [60, 0], ArrowRight: [-60, 0], ArrowUp: [0, 60], ArrowDown: [0, -60] }[event.key];
    if (!by) return;
    event.preventDefault();
    current().pan(...by);
  });
}

const current = () => (state.view === "plot" ? views.plot : views.image);

function oneToOne() {
  const view = current(), s = stage.answer?.spots[Number(state.selected?.slice(1))];
  const scale = state.view === "plot" ? 4 : 1 / (window.devicePixelRatio || 1);
  const [u, v] = s && state.view !== "plot" ? [s.u, s.v] : view.toContent($("canvas").clientWidth / 2, $("canvas").clientHeight / 2);
  view.centre(u, v, scale);
}

function tabChanged(id) {
  state.selected = null;
  const needsLayer = id === "background" || id === "mask";
  if (id === "plot") views.plot.box = plotBox(state.session, stage.answer);
  if (current().fitted && !$("stage").hidden) current().fit();
  if (needsLayer) refresh();
  else redraw();
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

async function once(signal) {
  const { index, view } = state, config = text(), asked = tick;
  const stageName = view === "mask" || view === "background" ? view : null;
  try {
    const [answer, raw, layer] = await Promise.all([
      post("process", { index, config }, signal),
      kept(index) ?? pixels(`image/${index}`, null, signal).catch((e) => { if (e.name === "AbortError") throw e; return null; }),
      stageName ? pixels("stage", { index, config, stage: stageName }, signal).catch((e) => { if (e.name === "AbortError") throw e; return null; }) : null,
    ]);
    const wanted = await hashOf(config);
    if (answer.hash !== wanted || index !== state.index || (layer && layer.hash !== wanted)) return; // stale: dropped
    const picture = answer.error ? null : await ofSameFile(raw, answer, signal);
    if (answer.error) forget(index);
    else if (picture) keep(index, picture);
    if (picture && picture.stamp !== answer.stamp) { again = true; return; } // overwritten once more
    accept(answer, picture, layer ? { ...layer, stage: stageName } : null, asked);
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
  return pixels(`image/${answer.index}`, null, signal).catch((e) => { if (e.name === "AbortError") throw e; return null; });
}

function accept(answer, raw, layer, asked) {
  const first = stage.answer?.index !== answer.index;
  if (first || stage.answer.hash !== answer.hash) state.selected = null;
  stage.answer = answer;
  stage.raw = raw;
  if (layer || first) stage.layer = layer;
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

const showing = () => ({
  candidates: state.view === "candidates",
  spots: state.view === "spots",
  labels: state.view === "labels",
  mask: state.view === "mask",
  truth: $("truth").checked && ["candidates", "spots", "labels"].includes(state.view),
  selected: state.selected,
});

function redraw() {
  if (!frame) frame = requestAnimationFrame(() => { frame = 0; paintNow(); });
}

function paintNow() {
  if ($("stage").hidden) return;
  const canvas = $("canvas"), { session } = state;
  $("zoom").textContent = state.view === "plot" ? `${views.plot.scale.toPrecision(2)} px/mm` : `${(views.image.scale * (window.devicePixelRatio || 1) * 100).toFixed(0)} %`;
  if (state.view === "plot") {
    drawPlot(canvas, views.plot, session, stage.answer, $("truth").checked, state.selected);
    plotLegend($("legend"), session.has_truth);
  } else {
    picture(canvas, session);
  }
  readings();
}

function picture(canvas, session) {
  const { context, width, height } = fitCanvas(canvas), show = showing();
  context.clearRect(0, 0, width, height);
  const layer = stage.layer?.stage === state.view ? stage.layer : null;
  const image = state.view === "background" ? layer : stage.raw;
  if (image) {
    const mask = state.view === "mask" ? layer : null;
    const surface = image === layer ? paintRange(layer) : paint(image, session.sensor.saturation, Number($("bright").value), mask);
    draw(context, views.image, image, surface, width, height);
  }
  drawOverlay(context, views.image, stage.answer, show);
  const range = image && image === layer ? el("em", {}, `background, ${layer.range[0]} (black) … ${layer.range[1]} DN (white)`) : null;
  clear($("legend"), range, legend(show, session.has_truth).map(([c, t]) => el("span", { class: c }, t)));
}

function under(at) {
  if (!at) return null;
  return state.view === "plot" ? hitPlot(views.plot, stage.answer, at) : hit(views.image, stage.answer, showing(), at);
}

function hover(at) {
  cursor = at;
  redrawReadings();
}

let readingFrame = 0;
function redrawReadings() {
  if (!readingFrame) readingFrame = requestAnimationFrame(() => { readingFrame = 0; readings(); });
}

function click(at) {
  const found = under(at);
  state.selected = found ? (found.kind === "spot" ? "s" : "c") + found.index : null;
  redraw();
}

// The next spot, or candidate where those are shown: what a click selects, by keyboard.
function next(by) {
  const kind = state.view === "candidates" ? "c" : "s", list = kind === "c" ? stage.answer?.candidates : stage.answer?.spots;
  if (!list?.length) return;
  const now = state.selected?.[0] === kind ? Number(state.selected.slice(1)) : by > 0 ? -1 : 0;
  const index = (now + by + list.length) % list.length;
  state.selected = kind + index;
  cursor = null;
  if (!current().fitted && state.view !== "plot") current().centre(list[index].u, list[index].v);
  redraw();
}

function chosen() {
  const over = under(cursor);
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
    drawProfile(raw, s.u, s.v, s.angle, ["along", "across"], saturation);
    return;
  }
  if (found?.kind === "candidate" && answer?.candidates[found.index]) {
    const c = answer.candidates[found.index];
    showCandidate(c, answer.measures);
    drawProfile(raw, c.u, c.v, 0, ["along u", "along v"], saturation);
    return;
  }
  showNothing(answer);
  const [u, v] = cursor && state.view !== "plot" ? views.image.toContent(...cursor) : [null, null];
  drawProfile(raw, u === null ? null : Math.round(u), Math.round(v ?? 0), 0, ["along u", "along v"], saturation);
}

function where(raw) {
  if (!cursor) { $("where").textContent = ""; return; }
  const [a, b] = current().toContent(...cursor);
  if (state.view === "plot") { $("where").textContent = `y ${a.toFixed(2)}  z ${b.toFixed(2)} mm`; return; }
  const u = Math.round(a), v = Math.round(b);
  const inside = raw && u >= 0 && v >= 0 && u < raw.width && v < raw.height;
  $("where").textContent = inside ? `u ${String(u).padStart(4)}  v ${String(v).padStart(4)}  ${raw.values[v * raw.width + u]} DN` : "";
}
