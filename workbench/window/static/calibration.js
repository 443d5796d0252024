// The calibration: model, roles of the locations, the answer with 95 % intervals, residuals, leave-one-out, conventions,
// the cell in three dimensions, comparison with an earlier result, and what may be saved.

import { content, get, hashOf, post } from "./api.js";
import { drawFig7, drawResiduals } from "./charts.js";
import { close, open } from "./dialog.js";
import { $, clear, el, style } from "./dom.js";
import { download } from "./export.js";
import { showCalibrated } from "./recipe.js";
import { say } from "./stage.js";
import { listen, state, text } from "./state.js";
import { go } from "./strip.js";
import { onTab, selectTab } from "./tabs.js";
import { number, t, word, words } from "./words.js";

const GOOD = ["ok"], WARN = ["model_misfit", "priors_contradict", "sensor_suspect", "weak"];
const ROLES = ["calibrate", "verify", "left out"];
let shown = null, timer = 0, roles = {}, view = null, compared = null, verified = null;

const whenShown = () => { if (state.view === "calibration") render(); };
onTab(whenShown);
listen((what) => { if (what === "parameters") whenShown(); });

export async function openCalibration() {
  selectTab("calibration");
  if (!state.session.can_calibrate) return;
  try {
    shown = await post("calibrate", { config: text(), roles });
  } catch (error) {
    shown = { state: "failed", error: error.message };
  }
  compared = verified = null;
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

const told = (chosen) => JSON.stringify(Object.entries(chosen).sort());
const kindOf = (code) => (GOOD.includes(code) ? "good" : WARN.includes(code) ? "warn" : "bad");

async function render() {
  const page = $("calibration"), { session } = state;
  const title = el("h2", {}, t("Calibration"));
  if (!session.can_calibrate) { clear(page, title, el("p", {}, t(session.no_calibration))); return; }
  const run = el("button", { class: "strong", onclick: openCalibration, disabled: shown?.state === "running" }, shown?.result ? t("Calibrate again") : t("Calibrate"));
  if (!shown) { clear(page, title, el("p", {}, t("Extracts every image with the parameters as they stand, finds the target and solves the sensor's pose in the hand.")), choices(), run); return; }
  if (shown.state === "running") { clear(page, title, el("p", {}, t("Measuring and solving…")), el("progress", { "aria-label": t("Calibrating") })); return; }
  if (shown.state === "failed") { clear(page, title, el("div", { class: "verdict bad" }, el("b", {}, t("No answer")), el("p", {}, shown.error)), choices(), run); return; }
  const r = shown.result, stale = shown.hash !== (await hashOf(text())) || told(shown.roles ?? roles) !== told(roles);
  if (r !== shown?.result) return; // another answer came meanwhile
  shown.roles ??= { ...roles };
  document.documentElement.dataset.calibrationStale = stale;
  showCalibrated(r.values, words(r.verdict.code), kindOf(r.verdict.code));
  const section = (name, ...body) => el("section", {}, el("h3", {}, t(name)), body);
  clear(page, title, verdict(r), el("div", { class: "page-head" }, run,
    el("button", { id: "save-result", onclick: () => save("result", "result.json", "application/json") }, t("Save result…")),
    el("button", { id: "save-report", onclick: () => save("report", "calibration.html", "text/html") }, t("Save report…")),
    el("button", { id: "compare", onclick: () => pick(compare) }, t("Compare with a result…")),
    el("button", { id: "verify", onclick: () => pick(verify) }, t("Verify a result…")),
    el("button", { id: "verify-design", onclick: () => verify(null, t("the design")) }, t("Verify the design")),
    stale ? el("span", { class: "worse" }, t("The parameters have changed since: this is the answer for the earlier ones.")) : null),
  compared, verified,
  el("div", { class: "columns" },
    el("section", { class: "cell-view" }, el("h3", {}, t("The cell")), el("canvas", { id: "cell", tabIndex: 0, role: "img", "aria-label": t("Arm, sensor, sheet, targets and points in three dimensions; drag turns, Shift moves, the wheel zooms") }), walk(r)),
    section("Sensor in the hand, T_hand_sensor", table(r), conventions(r)),
    section("Residuals of every frame", el("canvas", { id: "residuals", class: "chart", role: "img", "aria-label": t("Residuals of every frame; a click opens the frame") })),
    section("Distance deviation from the base (Fig. 7)", el("canvas", { id: "fig7", class: "chart", role: "img", "aria-label": t("Distance deviations by frame; a click opens the frame") })),
    section("By location", choices(), locations(r)),
    leftOut(r), section("Frames that were left out", unused(r)), remarks(r)));
  document.documentElement.dataset.calibrated = shown.hash;
  drawFig7($("fig7"), r, openFrame);
  drawResiduals($("residuals"), r, openFrame);
  scene(r);
}

function openFrame(number_) {
  const index = state.session.images.findIndex((image) => image.frame === number_);
  if (index >= 0) { go(index); selectTab("image"); }
}

function verdict(r) {
  return el("div", { class: `verdict ${kindOf(r.verdict.code)}`, id: "verdict" }, el("b", {}, words(r.verdict.code)), el("p", {}, r.verdict.text),
    el("p", {}, t`method ${word(r.method)}, model ${r.model}` + (r.model_asked && r.model_asked !== r.model ? t` (asked: ${r.model_asked})` : "") + (r.chi2_per_dof === null ? "" : t`, χ² per degree of freedom ${number(r.chi2_per_dof, 2)}`)));
}

const cells = (list, tag = "td") => list.map((x) => el(tag, {}, x));
const headed = (names, rows) => el("table", {}, el("thead", {}, el("tr", {}, names.map((n) => el(n ? "th" : "td", {}, t(n))))), el("tbody", {}, rows));

// The roles of the locations, and what stands there.
function choices() {
  const targets = shown?.result?.targets ?? {}, places = [...new Set(state.session.images.map((i) => i.location))].filter((x) => x);
  const own = (p) => state.session.images.find((i) => i.location === p).role, roleOf = (p) => roles[p] ?? own(p);
  const choose = (p, role) => { roles = { ...roles, [p]: role }; if (role === own(p)) delete roles[p]; whenShown(); };
  return el("div", { class: "roles" }, places.map((p) => el("label", {}, el("b", {}, p), targets[p] ? ` ${word(targets[p])}` : "",
    el("select", { data: { role: p }, onchange: (e) => choose(p, ROLES[e.target.selectedIndex]) },
      ROLES.map((role) => el("option", { selected: role === roleOf(p) }, t(role)))))));
}

function table(r) {
  const both = r.table.some((row) => row.nominal !== null); // another pose goes with the robot's nominal table
  const names = ["", "design", "solved", "σ", "95 % interval", "change", ...(both ? ["with the nominal table"] : [])];
  const shown_ = headed(names, r.table.map((row) => {
    const d = row.unit === "°" ? 4 : 3, unit = row.unit === "°" ? "°" : " mm";
    const [what, axis] = row.name.split(" ");
    return el("tr", {}, cells([`${t(what)} ${axis}`, number(row.design, d), row.solved === null ? "–" : number(row.solved, d) + unit, number(row.sigma, d),
      row.low === null ? t("withheld") : `${number(row.low, d)} … ${number(row.high, d)}`, row.solved === null || row.design === null ? "–" : number(row.solved - row.design, d),
      ...(both ? [`${number(row.nominal, d)} ± ${number(row.nominal_sigma, d)}`] : [])]));
  }));
  return [shown_, both ? el("p", { class: "soft", id: "which-table" }, t("Where the controller keeps its nominal table, the last column is the one to enter (T_hand_sensor_nominal); solved goes with the estimated table.")) : null];
}

// Digits to a tenth of a micrometre and a ten-thousandth of a degree: metres, quaternions and radians want more of them.
const finest = (label) => (/ \/ (mm|°|deg)$/.test(label) ? 4 : 7);

function conventions(r) {
  const apart = r.table.some((row) => row.nominal !== null), shown_ = (apart ? r.conventions_nominal : r.conventions) ?? {}, names = Object.keys(shown_);
  if (!names.length) return null;
  return el("details", { class: "conventions" }, el("summary", {}, apart ? t("For a controller with its nominal table, in makers' conventions") : t("In controllers' conventions")),
    headed(["maker", "numbers"], names.map((n) => el("tr", {}, el("td", { title: r.convention_formulas[n] }, n.toUpperCase()),
      el("td", { class: "left numbers" }, Object.entries(shown_[n]).map(([k, v]) => el("span", {}, `${k.split(" / ")[0]} ${number(v, finest(k))}${k.includes(" / ") ? ` ${k.split(" / ")[1]}` : ""}`)))))));
}

function locations(r) {
  const pair = (x, d) => (x && x.solved !== null ? `${number(x.design, d)} → ${number(x.solved, d)}` : "–");
  return el("div", {}, headed(["location", "role", "target", "max deviation", "spread 3-D", "point rms"], Object.entries(r.locations).map(([name, l]) => el("tr", {},
    cells([name, t(l.role), word(r.targets[name] ?? ""), pair(l.max_deviation_mm, 2), pair(l.spread_3d_mm, 2), pair(l.point_rms_mm, 3)])))),
  el("p", { class: "soft" }, t("mm, design → solved")));
}

function leftOut(r) {
  const found = r.left_out;
  if (!found) return null;
  const parts = found.locations ? Object.entries(found.locations) : found.frames.map((f) => [f.frame, f]);
  return el("section", {}, el("h3", {}, found.by === "location" ? t("Each location predicted by the others") : t("Each frame predicted by the others")),
    headed(["left out", "point rms [mm]", "SCP moves by [mm]", "[°]"], [
      ...parts.map(([name, p]) => el("tr", { class: found.by === "frame" ? "go" : "", onclick: () => found.by === "frame" && openFrame(name) }, cells([String(name), number(p.point_rms_mm, 3), number(p.shift_mm, 3), number(p.shift_deg, 4)]))),
      el("tr", { class: "total" }, cells([t("all"), number(found.point_rms_mm, 3), "", ""])),
    ]));
}

function unused(r) {
  const out = r.frames.filter((f) => !f.used);
  if (!out.length) return el("p", {}, t("None: every frame was used."));
  return el("table", {}, el("tbody", {}, out.map((f) => el("tr", { class: "go", tabIndex: 0, onclick: () => openFrame(f.frame), onkeydown: (e) => e.key === "Enter" && openFrame(f.frame) },
    el("td", {}, t`frame ${f.frame}`), el("td", { class: "left" }, f.location), el("td", { class: "left" }, words(f.reason)), el("td", { class: "left" }, f.complaint ?? "")))));
}

function remarks(r) {
  const all = [...(r.remarks ?? []), ...(r.notes ?? [])].filter((x, i, list) => x && list.indexOf(x) === i);
  return all.length ? el("section", { class: "remarks" }, el("h3", {}, t("Remarks")), el("ul", {}, all.map((x) => el("li", {}, x)))) : null;
}

// The three-dimensional view, and the frame that its arm stands in.
function walk(r) {
  if (!r.scene.frames.length) return null;
  return el("div", { class: "page-head walk" }, el("button", { "aria-label": t("Previous frame"), onclick: () => view?.step(-1) }, "‹"), el("output", { id: "cell-frame" }),
    el("button", { "aria-label": t("Next frame"), onclick: () => view?.step(1) }, "›"), el("button", { onclick: () => openFrame(Number($("cell-frame").dataset.frame)) }, t("Open this frame")));
}

const inks = () => Object.fromEntries(["text", "quiet", "accent", "good", "bad", "warn"].map((n) => [n, style(`--${n}`)]).concat([["ground", style("--raised")]]));

function scene(r) {
  const tell = (frame) => {
    const found = r.scene.frames.find((f) => f.frame === frame), node = $("cell-frame");
    if (!found || !node) return;
    node.dataset.frame = frame;
    node.textContent = `${t`frame ${frame}`}, ${found.location}${found.rms === null ? "" : `, rms ${number(found.rms, 3)} mm`}`;
  };
  view = globalThis.startScene($("cell"), r.scene, inks(), tell);
  if (!view) { $("cell").replaceWith(el("p", { class: "soft" }, t("This browser has no WebGL: the cell can not be drawn."))); return; }
  const first = r.scene.frames.find((f) => f.frame === state.session.images[state.index]?.frame) ?? r.scene.frames.find((f) => f.used) ?? r.scene.frames[0];
  if (first) view.show(first.frame);
}

export function recolour() {
  view?.colour(inks());
  if (state.session && state.view === "calibration") render();
}

async function save(what, name, type) {
  try { download(`${state.session.title}_${name}`, await content(what), type); } catch (error) { say(error.message, true); }
}

// An earlier result from the user's own disk: of it only what comparisons need is sent.
function pick(act) {
  const error = el("p", { class: "error" });
  const file = el("input", { type: "file", accept: ".json", "aria-label": t("A result of calibrate --json"), onchange: async () => {
    try {
      const data = JSON.parse(await file.files[0].text());
      const few = ["T_hand_sensor", "covariance", "T_hand_sensor_nominal", "covariance_nominal", "model", "verdict", "inputs"];
      await act(JSON.stringify(Object.fromEntries(few.filter((k) => k in data).map((k) => [k, data[k]]))), file.files[0].name);
      close();
    } catch (problem) { error.textContent = problem.message; }
  } });
  open(el("div", { class: "body" }, el("h2", {}, t("A result of calibrate --json")), file, error, el("div", { class: "buttons" }, el("button", { onclick: close }, t("Close")))));
}

async function compare(result, name) {
  const d = await post("compare", { result, name });
  const row = (what, values, sigmas, digits) => (values ? el("tr", {}, cells([t(what), ...values.map((v, i) => `${number(v, digits)} ± ${number(sigmas?.[i], digits)}`)])) : null);
  compared = el("div", { class: `verdict ${d.verdict?.code === "same" || d.code === "same" ? "good" : "warn"}`, id: "compared" }, el("b", {}, t`Against ${name}`), el("p", {}, d.verdict?.text ?? d.text),
    headed(["", "x", "y", "z"], [row("rotation", d.rotation_deg, d.sigma_rotation_deg, 4), row("translation", d.translation_mm, d.sigma_translation_mm, 3)].filter((x) => x)));
  render();
}

async function verify(result, name) {
  try {
    const v = await post("verify", { config: text(), result, name });
    verified = el("div", { class: "verdict", id: "verified" }, el("b", {}, t`The SCP of ${name}, judged on these frames`),
      el("p", {}, t`largest point rms of a location ${number(v.largest_point_rms_mm, 3)} mm`),
      headed(["location", "max deviation", "spread 3-D", "point rms"], Object.entries(v.locations).map(([n, l]) => el("tr", {}, cells([n, number(l.max_deviation_mm?.solved, 2), number(l.spread_3d_mm?.solved, 2), number(l.point_rms_mm?.solved, 3)])))));
    render();
  } catch (problem) {
    if (result) throw problem;
    say(problem.message, true);
  }
}


