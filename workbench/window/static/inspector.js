// What stands under the pointer: profile, peak, width, score, σ; for a rejected candidate the reason.

import { $, clear, el, fitCanvas, style } from "./dom.js";
import { nameOf } from "./overlay.js";
import { known, reveal } from "./params.js";
import { sample } from "./picture.js";
import { state } from "./state.js";
import { number, t, word, words } from "./words.js";

const REACH = 18, STEP = 0.25;

// Grey levels along two directions through (u, v); angle in radians. With a spot, the curve that was fitted to it.
export function drawProfile(image, u, v, angle, names, saturation, spot = null) {
  const { context, width, height } = fitCanvas($("profile"));
  context.clearRect(0, 0, width, height);
  if (!image || u === null) {
    context.fillStyle = style("--quiet");
    context.font = "12px system-ui, sans-serif";
    context.textAlign = "center";
    const said = state.session.has_images ? t("Point at the picture to see grey levels along and across") : t("Profiles hold no grey levels");
    wrapped(context, said, width - 12).forEach((line, i, all) => context.fillText(line, width / 2, height / 2 + 15 * (i - (all.length - 1) / 2)));
    return;
  }
  const curves = [0, Math.PI / 2].map((turn) => curve(image, u, v, angle + turn));
  const top = Math.max(8, ...curves.flat().map((p) => p[1]));
  const x = (s) => 36 + (width - 46) * (s + REACH) / (2 * REACH), y = (g) => height - 18 - (height - 34) * g / (top * 1.05);
  axes(context, x, y, top, width, height);
  if (top > 0.8 * saturation) mark(context, x, y(saturation), t("saturation"));
  [style("--accent"), style("--changed")].forEach((colour, i) => {
    context.strokeStyle = colour;
    context.lineWidth = 1.6;
    context.beginPath();
    curves[i].forEach(([s, g]) => context.lineTo(x(s), y(g)));
    context.stroke();
    context.fillStyle = colour;
    context.font = "11px system-ui, sans-serif";
    context.textAlign = "right";
    context.fillText(t(names[i]), width - 12, 18 + 14 * i);
  });
  if (spot) curves.forEach((curve_, i) => fitted(context, x, y, curve_, spot.peak, spot.width[i]));
}

// The fitted Gaussian over the level that surrounds it, the median of what lies beyond three of its σ.
function fitted(context, x, y, points, peak, sigma) {
  if (sigma === null || peak === null) return;
  const around = points.filter(([s]) => Math.abs(s) > 3 * sigma).map(([, g]) => g).sort((a, b) => a - b);
  if (!around.length) return;
  const level = around[Math.floor(around.length / 2)];
  context.strokeStyle = style("--text");
  context.setLineDash([3, 3]);
  context.lineWidth = 1.2;
  context.beginPath();
  for (let s = -4 * sigma; s <= 4 * sigma; s += STEP / 2) {
    if (Math.abs(s) <= REACH) context.lineTo(x(s), y(level + peak * Math.exp(-0.5 * (s / sigma) ** 2)));
  }
  context.stroke();
  context.setLineDash([]);
}

function curve(image, u, v, angle) {
  const points = [];
  for (let s = -REACH; s <= REACH; s += STEP) {
    const g = sample(image, u + s * Math.cos(angle), v + s * Math.sin(angle));
    if (g !== null) points.push([s, g]);
  }
  return points;
}

function axes(context, x, y, top, width, height) {
  context.strokeStyle = style("--edge");
  context.fillStyle = style("--quiet");
  context.font = "10.5px system-ui, sans-serif";
  context.lineWidth = 1;
  const step = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000, 20000].find((s) => s * 4 >= top) ?? 20000;
  for (let g = 0; g <= top * 1.05; g += step) {
    context.globalAlpha = 0.5;
    context.beginPath();
    context.moveTo(36, y(g));
    context.lineTo(width - 10, y(g));
    context.stroke();
    context.globalAlpha = 1;
    context.textAlign = "right";
    context.fillText(g, 31, y(g) + 3.5);
  }
  context.textAlign = "center";
  for (const s of [-15, -10, -5, 0, 5, 10, 15]) context.fillText(String(s).replace("-", "−"), x(s), height - 5);
  context.textAlign = "left";
  context.fillText("DN", 4, 12);
  context.textAlign = "right";
  context.fillText("px", width - 4, height - 5);
}

function mark(context, x, y, text) {
  context.strokeStyle = style("--bad");
  context.setLineDash([4, 3]);
  context.beginPath();
  context.moveTo(x(-REACH), y);
  context.lineTo(x(REACH), y);
  context.stroke();
  context.setLineDash([]);
  context.fillStyle = style("--bad");
  context.textAlign = "left";
  context.fillText(text, x(-REACH) + 4, y + 11);
}

// Words in lines that are no wider than there is room.
function wrapped(context, text, width) {
  const lines = [""];
  for (const one of text.split(" ")) {
    const longer = `${lines.at(-1)} ${one}`.trim();
    if (lines.at(-1) && context.measureText(longer).width > width) lines.push(one);
    else lines[lines.length - 1] = longer;
  }
  return lines;
}

const fact = (name, value) => el("div", {}, el("dt", {}, name), el("dd", {}, value));

const fullWidth = (sigma) => (sigma === null ? t("not measured") : `${number(2.355 * sigma, 2)} px`);

export function showSpot(s, truth) {
  const sigma = (k) => number(Math.sqrt(Math.max(s.cov[k], 0)), 4);
  const facts = [
    fact(t("peak"), `${number(s.peak, 1)} DN`), fact(t("score"), number(s.score, 3)),
    fact(t("width"), fullWidth(s.width[1])), fact(t("length"), fullWidth(s.width[0])),
    fact("u", `${number(s.u, 3)} ± ${number(s.su, 3)}`), fact("v", `${number(s.v, 3)} ± ${number(s.sv, 3)}`),
    fact("y", `${number(s.surface[0], 3)} mm`), fact("σ y", `${sigma(0)} mm`),
    fact("z", `${number(s.surface[1], 3)} mm`), fact("σ z", `${sigma(3)} mm`),
  ];
  if (s.axis) facts.push(fact(t("axis y"), `${number(s.axis[0], 3)} mm`), fact(t("axis z"), `${number(s.axis[1], 3)} mm`));
  if (truth?.mm) facts.push(fact(truth.of === "axis" ? t("error y") : t("error y srf."), `${number(truth.mm[0], 3)} mm`), fact(t("error z"), `${number(truth.mm[1], 3)} mm`));
  clear($("inspector"),
    el("h2", {}, s.label ? t`String ${nameOf(s.label)}` : t("Spot without a label")),
    s.flag ? el("p", { class: "why" }, t`Doubtful: ${words(s.flag)}`) : null,
    el("dl", { class: "facts" }, facts));
}

export function showCandidate(c, measures) {
  const p = known(c.parameter);
  const facts = measures.map((name, i) => (c.measured[i] === null ? null : fact(word(name), number(c.measured[i], 2)))).filter((f) => f);
  clear($("inspector"),
    el("h2", {}, c.reason ? t`Rejected: ${words(c.reason)}` : t("Accepted candidate")),
    c.text ? el("p", { class: c.reason ? "why" : "" }, words(c.text)) : null,
    el("dl", { class: "facts" }, facts),
    p ? el("p", {}, el("button", { id: "reveal", onclick: () => reveal(c.parameter) }, t`Go to “${word(p.title)}”`)) : null);
}

// One point of a stripe, in the image or in the laser plane.
export function showPoint(s, i) {
  const facts = [];
  if (s.u) facts.push(
    fact(t("peak"), `${number(s.peak[i], 1)} DN`), fact(t("width"), fullWidth(s.width[i])),
    fact("u", `${number(s.u[i], 3)} px`), fact("v", `${number(s.v[i], 3)} px`), fact("σ", `${number(s.sigma[i], 4)} px`), fact("χ²", number(s.chi2[i], 2)));
  if (s.y) {
    const sigma = (k) => `${number(Math.sqrt(Math.max(s.cov[k][i], 0)), 4)} mm`;
    facts.push(fact("y", `${number(s.y[i], 3)} mm`), fact("σ y", sigma(0)), fact("z", `${number(s.z[i], 3)} mm`), fact("σ z", sigma(2)));
  }
  const flag = s.flag?.[i] ?? 0, names = FLAGS.filter(([bit]) => flag & bit).map(([, name]) => word(name));
  clear($("inspector"), el("h2", {}, t`Point ${i + 1} of ${s.n}`),
    names.length ? el("p", { class: "why" }, t`Doubtful: ${names.join(", ")}`) : null, el("dl", { class: "facts" }, facts));
}

const FLAGS = [[1, "saturated"], [2, "shape"], [4, "edge"], [8, "ambiguous"]];

export function showNothing(answer) {
  if (!answer) { clear($("inspector")); return; }
  if (answer.error) { clear($("inspector"), el("h2", {}, t("This image")), el("p", {}, t("not measured"))); return; }
  const s = answer.stripe, facts = [];
  if (s) {
    if (s.n || !answer.board?.u.length) facts.push(fact(t("points"), s.n)); // a picture of the board alone has no stripe to look for
    facts.push( ...Object.entries(s.flags).map(([k, n]) => fact(word(k), n)), ...Object.entries(s.refused).map(([k, n]) => fact(t`refused: ${word(k.replaceAll("_", " "))}`, n)));
    if (answer.board?.u.length) facts.push(fact(t("corners"), answer.board.u.length));
  } else {
    const rejected = answer.candidates.filter((c) => c.reason);
    const reasons = Object.entries(Object.groupBy(rejected, (c) => c.reason)).map(([r, list]) => fact(words(r), list.length));
    facts.push(fact(t("spots"), answer.spots.length), fact(t("labelled"), answer.labelled), fact(t("rejected"), rejected.length), ...reasons);
  }
  const clipped = answer.values?.find((v) => v.key === "clipped_px")?.value;
  if (clipped !== undefined) facts.unshift(fact(t("clipped"), `${clipped} px`));
  const f = answer.truth?.statistics;
  if (f) facts.push(
    fact(t("visible"), f.visible), fact(t("missed"), f.missed), fact(t("false"), f.false), fact(t("mislabelled"), f.mislabelled),
    fact("rms", `${number(f.rms)} mm`), fact(t("bias y"), number(f.bias[0])), fact(t("bias z"), number(f.bias[1])), fact(t("scatter y"), number(f.scatter[0])), fact(t("scatter z"), number(f.scatter[1])));
  const said = [answer.reason && words(answer.reason), answer.feature?.text, answer.gap?.text, answer.gap?.flag && t`gap and flush doubtful: ${answer.gap.flag.split("+").map((k) => word(k.replaceAll("_", " "))).join(", ")}`].filter((x) => x);
  clear($("inspector"), el("h2", {}, state.session.has_images ? t("This image") : t("This profile")), said.map((x) => el("p", { class: "why" }, x)),
    (answer.remarks ?? []).map((x) => el("p", {}, x)),
    clipped ? el("p", { class: "why" }, t`${clipped} px clipped: what is brighter than the camera can tell is measured worse. Halve the exposure.`) : null, el("dl", { class: "facts" }, facts));
}
