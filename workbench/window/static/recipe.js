// The recipe of tools in working order: each with its basic parameters, its values ± σ, their tolerances and a lamp.

import { $, clear, el } from "./dom.js";
import { drawHistogram } from "./histogram.js";
import { numberField, putNumber, rowsOf, startPanel } from "./params.js";
import { buildRegion } from "./region.js";
import { searchButton } from "./search.js";
import { change, listen, read, state } from "./state.js";
import { number, plain, t, word } from "./words.js";

const lamps = new Map(); // tool → its lamp and values
let answered = null;

const TOOLS = [
  { id: "exposure", title: "Exposure", tables: [], head: histogram, when: () => state.session.has_images },
  { id: "region", title: "Region", tables: [], head: buildRegion, when: () => state.session.has_images && !state.session.board },
  { id: "strings", title: "Strings", tables: ["detect", "localise", "noise"], head: searchButton, when: () => state.session.has_images && !state.session.board && state.session.plane, shown: () => state.parameters.what === "strings" },
  { id: "board", title: "Board", tables: [], when: () => state.session.board },
  { id: "stripe", title: "Stripe", tables: ["stripe"], when: () => true, shown: () => state.parameters.what === "stripe", head: counts },
  { id: "feature", title: "Features", tables: ["feature"], head: feature, when: () => state.session.plane && !state.session.board, shown: () => state.parameters.what === "stripe" },
  { id: "gapflush", title: "Gap and flush", tables: ["gapflush"], head: gapflush, when: () => state.session.plane && !state.session.board, shown: () => state.parameters.what === "stripe" },
  { id: "calibrate", title: "Calibrate", tables: [], head: calibrate, when: () => state.session.can_calibrate },
];

export function buildRecipe() {
  what();
  clear($("panel"), TOOLS.filter((tool) => tool.when()).map(build));
  startPanel();
  arrange();
  listen((event) => { if (event === "parameters") { arrange(); if (answered) showValues(answered); } });
}

// Strings or the stripe: a switch where both make sense.
function what() {
  const { session } = state;
  $("what").hidden = session.board || !session.has_images || !session.plane;
  const choice = (id, title) => el("button", { data: { what: id }, onclick: () => change("what", id, true) }, t(title));
  clear($("what"), choice("strings", "Strings"), choice("stripe", "Stripe"));
}

function build(tool) {
  const lamp = el("span", { class: "lamp", role: "img" }), brief = el("span", { class: "brief" });
  const values = el("div", { class: "values" });
  const head = tool.head ? tool.head(tool) : null;
  lamps.set(tool.id, { lamp, brief, values, tool });
  return el("details", { class: "tool", open: tool.id !== "region", data: { tool: tool.id } },
    el("summary", {}, lamp, el("b", {}, t(tool.title)), el("small", { class: "count" }), brief),
    head, values, rowsOf(...(tool.id === "stripe" && !state.session.has_images ? [] : tool.tables))); // a profile has no stripe to look for
}

function arrange() {
  for (const button of $("what").children) button.setAttribute("aria-pressed", button.dataset.what === state.parameters.what);
  for (const { tool } of lamps.values()) {
    $("panel").querySelector(`[data-tool="${tool.id}"]`).hidden = tool.shown ? !tool.shown() : false;
  }
  $("panel").dataset.what = state.parameters.what;
  for (const put of puts) put();
  const { feature: looked, gap_and_flush: panels } = state.parameters.measure;
  for (const [id, on] of [["feature", looked !== "none"], ["gapflush", panels]]) $("panel").querySelector(`[data-tool="${id}"]`)?.classList.toggle("off", !on);
}

const puts = []; // of the tools' own controls

// The newest answer: every tool's values, their lamps, and the worst of them as the tool's.
export function showValues(answer, raw = answered?.rawOf) {
  answered = answer;
  answered.rawOf = raw;
  drawHistogram(raw);
  for (const { lamp, brief, values, tool } of lamps.values()) {
    const own = (answer.values ?? []).filter((v) => v.tool === tool.id);
    const worst = own.some((v) => v.lamp === "bad") ? "bad" : own.some((v) => v.lamp === "good") ? "good" : "";
    setLamp(lamp, worst);
    brief.textContent = own.length && own[0].value !== null ? shown(own[0]) : "";
    const there = [...values.children].map((node) => node.dataset.value).join();
    if (own.map((v) => v.key).join() !== there) clear(values, own.map(valueRow));
    else own.forEach((v, i) => fill(values.children[i], v)); // an open tolerance stays open
  }
  clipped(answer);
  told(answer);
}

export function setLamp(lamp, state_) {
  lamp.className = `lamp ${state_}`;
  lamp.setAttribute("aria-label", { good: t("within its tolerance"), bad: t("out of its tolerance") }[state_] ?? t("no tolerance"));
}

// Two digits of σ, and as many of the value: more would say what nobody knows.
const digitsOf = (sigma, most) => (sigma > 0 ? Math.min(most, Math.max(0, 1 - Math.floor(Math.log10(sigma)))) : most);

export const shown = (v) => {
  if (v.value === null) return "–";
  const known = v.sigma !== null && v.sigma !== undefined, digits = known ? digitsOf(v.sigma, v.digits) : v.digits;
  const sigma = known ? ` ± ${number(v.sigma, digits)}` : "";
  return `${number(v.value, digits)}${sigma}${v.unit ? (v.unit === "°" ? "°" : ` ${v.unit}`) : ""}`;
};

const TITLES = {
  clipped_px: "clipped", strings: "strings named", spots: "spots", sigma_mm: "median σ", sigma_px: "median σ", points: "points", flagged: "in doubt",
  centre_y_mm: "centre y", centre_z_mm: "centre z", radius_mm: "radius", scatter_mm: "scatter", angle_deg: "angle", corner_y_mm: "corner y",
  corner_z_mm: "corner z", gap_mm: "gap", flush_mm: "flush", radius_left_mm: "radius left", radius_right_mm: "radius right",
  corners: "corners", corner_sigma_px: "σ of a corner", blur_px: "blur", contrast_dn: "contrast", left_out_rms_mm: "left out, rms",
};
export const titleOf = (key, tool) => t(tool === "strings" && key === "sigma_mm" ? "largest σ" : TITLES[key] ?? key);

export function valueRow(v) {
  const node = el("div", { class: "measured", data: { value: v.key } },
    el("span", { class: "lamp", role: "img" }), el("span", { class: "word" }, titleOf(v.key, v.tool)), el("output", {}), tolerance(v));
  fill(node, v);
  return node;
}

function fill(node, v) {
  setLamp(node.querySelector(".lamp"), v.lamp);
  node.querySelector("output").textContent = shown(v);
  const button = node.querySelector(".tolerance"), now = read(`tolerances.${v.key}`);
  if (!button) return;
  button.textContent = now ? rangeOf(now) : t("tolerance…");
  const fields = node.querySelectorAll(".limits input");
  putNumber(fields[0], now?.min ?? null);
  putNumber(fields[1], now?.max ?? null);
}

// The tolerance of a value: a button that tells it and opens two fields.
function tolerance(v) {
  const key = `tolerances.${v.key}`;
  if (!(v.key in (state.parameters.tolerances ?? {}))) return el("span");
  const now = read(key);
  const button = el("button", { class: "tolerance", title: t("Tolerance"), "aria-expanded": "false", onclick: () => {
    fields.hidden = !fields.hidden;
    button.setAttribute("aria-expanded", String(!fields.hidden));
    if (!fields.hidden) fields.querySelector("input").focus();
  } }, now ? rangeOf(now) : t("tolerance…"));
  button.setAttribute("aria-label", t`Tolerance of ${titleOf(v.key, v.tool)}`);
  const take = (end, x) => {
    const next = { min: null, max: null, ...(read(key) ?? {}), [end]: x };
    const empty = next.min === null && next.max === null;
    if (!empty && next.min !== null && next.max !== null && next.min > next.max) return;
    change(key, empty ? null : next, true);
    button.textContent = empty ? t("tolerance…") : rangeOf(next);
  };
  const field = (end, title) => {
    const box = numberField({ value: plain(now?.[end] ?? null), "aria-label": `${titleOf(v.key, v.tool)} ${t(title)}`, placeholder: t(title) }, () => {}, (x) => take(end, x));
    return box;
  };
  const fields = el("span", { class: "limits", hidden: true }, field("min", "least"), "…", field("max", "most"));
  return [button, fields];
}

const rangeOf = ({ min, max }) => (min === null ? `≤ ${plain(max)}` : max === null ? `≥ ${plain(min)}` : `${plain(min)} … ${plain(max)}`);

// The tools' own heads.
function histogram() {
  return [el("canvas", { id: "histogram", role: "img", "aria-label": t("Histogram of the grey levels") }), el("p", { id: "clipped", class: "advice", hidden: true })];
}

function clipped(answer) {
  const node = $("clipped"), n = answer.values?.find((v) => v.key === "clipped_px")?.value;
  if (!node) return;
  node.hidden = !n;
  node.textContent = n ? t`${n} px clipped: what is brighter than the camera can tell is measured worse. Halve the exposure.` : "";
}

function counts() {
  return el("dl", { class: "facts", id: "stripe-counts" });
}

// How many points are doubted why, and how many ridges were refused why.
function told(answer) {
  const node = $("stripe-counts");
  if (!node) return;
  const s = answer.stripe, fact = (name, n, kind) => el("div", { class: kind }, el("dt", {}, name), el("dd", {}, String(n)));
  clear(node, s ? [
    ...Object.entries(s.flags).map(([k, n]) => fact(`${word(k)}`, n, "doubt")),
    ...Object.entries(s.refused).map(([k, n]) => fact(t`refused: ${word(k.replaceAll("_", " "))}`, n, "refusal")),
  ] : []);
}

const FEATURES = ["none", "sphere", "plane", "edge", "wedge"];

function feature() {
  const list = el("select", { id: "feature-kind", onchange: () => change("measure.feature", FEATURES[list.selectedIndex], true) },
    FEATURES.map((f) => el("option", {}, word(f))));
  const size = numberField({ id: "feature-diameter", placeholder: t("estimated") }, () => {}, (x) => change("measure.diameter_mm", x !== null && x > 0 ? x : null, true));
  const sizeRow = el("div", { class: "line own" }, el("label", { htmlFor: "feature-diameter" }, t("Diameter")), el("span", {}, size, " mm"));
  puts.push(() => {
    list.selectedIndex = FEATURES.indexOf(state.parameters.measure.feature);
    putNumber(size, state.parameters.measure.diameter_mm);
    sizeRow.hidden = state.parameters.measure.feature !== "sphere";
  });
  return [el("div", { class: "line own" }, el("label", { htmlFor: "feature-kind" }, t("Look for")), list), sizeRow];
}

function gapflush() {
  const box = el("input", { id: "gap-on", type: "checkbox", onchange: () => change("measure.gap_and_flush", box.checked, true) });
  puts.push(() => { box.checked = state.parameters.measure.gap_and_flush; });
  return el("div", { class: "line own" }, el("label", { class: "check", htmlFor: "gap-on" }, box, t("Measure two panels")));
}

const MODELS = ["auto", "scp", "scp+offsets", "full", "auto+sensor", "scp+offsets+sensor", "full+sensor"];

function calibrate() {
  const list = el("select", { id: "model", onchange: () => change("calib.model", MODELS[list.selectedIndex], true) }, MODELS.map((m) => el("option", {}, m)));
  const method = el("select", { id: "method", onchange: () => change("calib.method", ["bundle", "paper"][method.selectedIndex], true) }, ["bundle", "paper"].map((m) => el("option", {}, word(m))));
  puts.push(() => {
    list.selectedIndex = MODELS.indexOf(state.parameters.calib.model);
    method.selectedIndex = ["bundle", "paper"].indexOf(state.parameters.calib.method);
    list.disabled = state.parameters.calib.method === "paper";
  });
  const run = el("button", { class: "strong", onclick: () => $("calibrate").click() }, t("Calibrate"));
  return [
    el("div", { class: "line own" }, el("label", { htmlFor: "method" }, t("Method")), method),
    el("div", { class: "line own" }, el("label", { htmlFor: "model" }, t("Model")), list),
    el("div", { class: "line own" }, run, el("span", { id: "tool-verdict", class: "quiet" })),
  ];
}

// The values of a calibration, which belong to no image.
export function showCalibrated(values, verdict, kind) {
  const found = lamps.get("calibrate");
  if (!found) return;
  clear(found.values, values.map(valueRow));
  setLamp(found.lamp, kind);
  found.brief.textContent = verdict;
  $("tool-verdict").textContent = verdict;
}
