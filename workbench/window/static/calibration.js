// One click: pose and calibration on what is found with the parameters as they stand; Fig. 7 and the verdict.

import { get, hashOf, post } from "./api.js";
import { $, clear, el, fitCanvas, number, style, words } from "./dom.js";
import { listen, state, text } from "./state.js";
import { go } from "./strip.js";
import { onTab, selectTab } from "./tabs.js";

const GOOD = ["ok"], WARN = ["model_misfit", "priors_contradict", "sensor_suspect", "weak"];
let shown = null, timer = 0;

const whenShown = () => { if (state.view === "calibration") render(); };
onTab(whenShown);
listen((what) => { if (what === "parameters") whenShown(); });

export async function openCalibration() {
  selectTab("calibration");
  if (!state.session.can_calibrate) return;
  try {
    shown = await post("calibrate", { config: text() });
  } catch (error) {
    shown = { state: "failed", error: error.message };
  }
  render();
  if (shown.state === "running") wait();
}

function wait() {
  clearTimeout(timer);
  timer = setTimeout(async () => {
    try { shown = await get("calibration"); } catch (error) { shown = { state: "failed", error: error.message }; }
    if (shown.state === "running") wait();
    else render();
  }, 250);
}

async function render() {
  const page = $("calibration");
  const run = el("button", { class: "strong", onclick: openCalibration, disabled: !state.session.can_calibrate || shown?.state === "running" },
    shown?.result ? "Calibrate again" : "Calibrate");
  if (!state.session.can_calibrate) { clear(page, el("h2", {}, "Calibration"), el("p", {}, state.session.no_calibration)); return; }
  if (!shown) { clear(page, el("h2", {}, "Calibration"), el("p", {}, "Extracts every image with the parameters as they stand, finds the jig's poses and solves the sensor's pose in the hand."), run); return; }
  if (shown.state === "running") { clear(page, el("h2", {}, "Calibration"), el("p", {}, "Extracting, labelling and solving…"), el("progress")); return; }
  if (shown.state === "failed") { clear(page, el("div", { class: "verdict bad" }, el("b", {}, "No answer"), el("p", {}, shown.error)), run); return; }
  const r = shown.result, stale = shown.hash !== (await hashOf(text()));
  if (r !== shown?.result) return; // another answer came meanwhile
  document.documentElement.dataset.calibrationStale = stale;
  clear(page, verdict(r), el("div", { class: "page-head" }, run, stale ? el("span", { class: "worse" }, "The parameters have changed since: this is the answer for the earlier ones.") : null),
    el("div", { class: "columns" },
      el("section", {}, el("h3", {}, "Distance deviation of the jig from the base (Fig. 7)"), el("canvas", { id: "fig7" })),
      el("section", {}, el("h3", {}, "Sensor in the hand, T_hand_sensor"), scp(r)),
      el("section", {}, el("h3", {}, "By location"), locations(r)),
      el("section", {}, el("h3", {}, "Frames that were left out"), leftOut(r))));
  document.documentElement.dataset.calibrated = shown.hash;
  figure($("fig7"), r);
  $("fig7").onclick = (event) => openFrame(event, r);
}

// A click on a dot of Fig. 7 opens its frame.
function openFrame(event, r) {
  const k = Math.round((event.offsetX - 46) / (event.currentTarget.clientWidth - 58) * places(r) - 0.5);
  let from = 0;
  for (const l of Object.values(r.locations)) {
    const dot = k - from;
    if (dot >= 0 && dot < l.distances.frame.length) {
      const index = state.session.images.findIndex((image) => image.frame === l.distances.frame[dot]);
      if (index >= 0) { go(index); selectTab("image"); }
      return;
    }
    from += l.distances.frame.length + 1;
  }
}

const places = (r) => Object.values(r.locations).reduce((n, l) => n + l.distances.frame.length + 1, 0);

function verdict(r) {
  const kind = GOOD.includes(r.verdict.code) ? "good" : WARN.includes(r.verdict.code) ? "warn" : "bad";
  return el("div", { class: `verdict ${kind}`, id: "verdict" }, el("b", {}, words(r.verdict.code)), el("p", {}, r.verdict.text),
    el("p", {}, `method ${r.method}, model ${r.model}` + (r.chi2_per_dof === null ? "" : `, χ² per degree of freedom ${number(r.chi2_per_dof, 2)}`)));
}

function scp(r) {
  const names = ["rotation x", "rotation y", "rotation z", "x", "y", "z"];
  const solved = r.rotation_deg ? [...r.rotation_deg, ...r.translation_mm] : Array(6).fill(null);
  const sigma = r.sigma_rotation_deg ? [...r.sigma_rotation_deg, ...r.sigma_translation_mm] : Array(6).fill(null);
  const design = [...r.design.rotation_deg, ...r.design.translation_mm];
  return el("table", {}, el("thead", {}, el("tr", {}, ["", "design", "solved", "σ", "change"].map((t) => el("th", {}, t)))),
    el("tbody", {}, names.map((name, i) => {
      const unit = i < 3 ? "°" : " mm", d = i < 3 ? 4 : 3;
      return el("tr", {}, [name, number(design[i], d), number(solved[i], d) + unit, number(sigma[i], d), solved[i] === null ? "–" : number(solved[i] - design[i], d)].map((t) => el("td", {}, t)));
    })));
}

function locations(r) {
  const pair = (x, d) => (x ? `${number(x.design, d)} → ${number(x.solved, d)}` : "–");
  return el("table", {}, el("thead", {}, el("tr", {}, ["location", "role", "max deviation", "spread 3-D", "point rms"].map((t) => el("th", {}, t)))),
    el("tbody", {}, Object.entries(r.locations).map(([name, l]) => el("tr", {},
      [name, l.role, pair(l.max_deviation_mm, 2), pair(l.spread_3d_mm, 2), pair(l.point_rms_mm, 3)].map((t) => el("td", {}, t))))),
    el("tfoot", {}, el("tr", {}, el("td", { colSpan: 5, class: "left" }, "mm, design → solved"))));
}

function leftOut(r) {
  const out = r.frames.filter((f) => !f.used);
  if (!out.length) return el("p", {}, "None: every frame was used.");
  return el("table", {}, el("tbody", {}, out.map((f) => el("tr", {}, el("td", {}, `frame ${f.frame}`), el("td", { class: "left" }, f.location), el("td", { class: "left" }, words(f.reason))))));
}

function figure(canvas, r) {
  const { context, width, height } = fitCanvas(canvas);
  const series = Object.entries(r.locations).map(([name, l]) => ({ name, role: l.role, design: centred(l.distances.design_mm), solved: centred(l.distances.solved_mm) }));
  const all = series.flatMap((s) => [...s.design, ...s.solved]).filter((x) => x !== null);
  const top = Math.max(0.5, ...all.map(Math.abs)) * 1.12;
  const count = places(r);
  const x = (k) => 46 + (width - 58) * (k + 0.5) / count, y = (d) => height / 2 - 6 - d / top * (height / 2 - 30);
  axis(context, y, top, width);
  let k = 0;
  for (const s of series) {
    const from = k;
    dots(context, s.design, x, y, k, style("--changed"), false);
    dots(context, s.solved, x, y, k, style("--accent"), true);
    k += s.design.length;
    context.fillStyle = style("--quiet");
    context.textAlign = "center";
    context.fillText(`${s.name}${s.role === "verify" ? " (verify)" : ""}`, (x(from) + x(k - 1)) / 2, height - 8);
    k += 1;
  }
  context.textAlign = "left";
  context.fillStyle = style("--changed");
  context.fillText("○ by design", 50, 14);
  context.fillStyle = style("--accent");
  context.fillText("● solved", 128, 14);
}

function centred(values) {
  const good = values.filter((v) => v !== null), mean = good.reduce((a, b) => a + b, 0) / (good.length || 1);
  return values.map((v) => (v === null ? null : v - mean));
}

function axis(context, y, top, width) {
  context.font = "11.5px system-ui, sans-serif";
  const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50].find((s) => top / s <= 5) ?? 100;
  for (let d = -Math.floor(top / step) * step; d <= top; d += step) {
    context.strokeStyle = Math.abs(d) < 1e-9 ? style("--quiet") : style("--edge-soft");
    context.beginPath();
    context.moveTo(46, y(d));
    context.lineTo(width - 8, y(d));
    context.stroke();
    context.fillStyle = style("--quiet");
    context.textAlign = "right";
    context.fillText(number(d + 0, step < 1 ? 1 : 0), 40, y(d) + 4);
  }
  context.textAlign = "left";
  context.fillText("mm", 8, 14);
}

function dots(context, values, x, y, from, colour, filled) {
  context.strokeStyle = context.fillStyle = colour;
  context.lineWidth = 1.5;
  context.globalAlpha = 0.55;
  context.beginPath();
  values.forEach((v, i) => v !== null && context.lineTo(x(from + i), y(v)));
  context.stroke();
  context.globalAlpha = 1;
  values.forEach((v, i) => {
    if (v === null) return;
    context.beginPath();
    context.arc(x(from + i), y(v), 3.6, 0, 2 * Math.PI);
    if (filled) context.fill();
    else context.stroke();
  });
}
