// The parameters' rows, built from the groups that the server made from the recipe's model.

import { $, clear, el } from "./dom.js";
import { canRedo, canUndo, change, listen, read, redo, replace, settle, state, undo } from "./state.js";
import { decimal, plain, t, typed, word } from "./words.js";

const SLIDER = 1000;
const rows = new Map();

// The rows of tables of the recipe, in the model's order.
export const rowsOf = (...tables) =>
  state.session.panel.filter((g) => tables.includes(g.table)).flatMap((g) => g.parameters.map((p) => row(p)));

export function startPanel() {
  $("filter").addEventListener("input", show);
  $("expert").addEventListener("change", show);
  $("reset-all").addEventListener("click", () => replace({ ...structuredClone(state.session.defaults), what: state.parameters.what }));
  $("undo").addEventListener("click", undo);
  $("redo").addEventListener("click", redo);
  listen((what) => what === "parameters" && update());
  update();
  show();
  explain(null);
}

function row(p) {
  const id = "p-" + p.key;
  const control = controls(p, id);
  const problem = el("div", { class: "problem", hidden: true });
  const reset = el("button", {
    class: "reset", title: t("Back to the default"), "aria-label": t`Reset ${word(p.title)}`,
    onclick: () => change(p.key, structuredClone(p.default), true),
  }, "↺");
  const unit = el("span", { class: "unit" }, p.unit);
  const node = el("div", { class: "parameter", title: word(p.help), data: { key: p.key } },
    el("div", { class: "line" },
      el("label", { class: "word", htmlFor: id }, word(p.title)),
      el("span", { class: "value" }, reset, control.value, unit)),
    control.slider, problem);
  for (const event of ["focusin", "pointerenter"]) node.addEventListener(event, () => explain(p));
  rows.set(p.key, { p, node, problem, ...control });
  return node;
}

function controls(p, id) {
  if (p.kind === "boolean") {
    const box = el("input", { id, type: "checkbox", onchange: () => change(p.key, box.checked, true) });
    return { value: box, slider: null, put: (v) => { box.checked = v; } };
  }
  if (p.kind === "choice") {
    const list = el("select", { id, onchange: () => change(p.key, p.choices[list.selectedIndex], true) },
      p.choices.map((c) => el("option", {}, word(String(c)))));
    return { value: list, slider: null, put: (v) => { list.selectedIndex = p.choices.indexOf(v); } };
  }
  if (p.kind !== "number" && p.kind !== "integer") return textual(p, id);
  return p.nullable ? optional(p, id) : numeric(p, id);
}

function textual(p, id) {
  const box = el("input", { id, type: "text", spellcheck: false, onchange: () => {
    let value = box.value;
    if (p.kind === "array" || (p.nullable && value === "")) {
      try { value = value === "" ? null : JSON.parse(value); } catch { /* the server says what is wrong */ }
    }
    change(p.key, value, true);
  } });
  return { value: box, slider: null, put: (v) => { box.value = typeof v === "string" ? v : v === null ? "" : JSON.stringify(v); } };
}

let numberRefused = () => {};
export const onNumberRefused = (f) => { numberRefused = f; };

// A field for numbers with the language's decimal sign; taken as it is typed where it is one.
export function numberField(properties, take, done) {
  const box = el("input", { type: "text", class: "number", inputMode: "decimal", spellcheck: false, autocomplete: "off", ...properties });
  let before = null, typing = false; // what it was when the typing began: half of what is no number is none either
  box.addEventListener("beforeinput", () => { if (!typing) { before = typed(box.value); typing = true; } });
  box.addEventListener("input", () => { const x = typed(box.value); if (x !== null) take(x); });
  box.addEventListener("change", () => {
    const x = typed(box.value), wrong = box.value.trim() !== "" && x === null ? box.value.trim() : "";
    if (wrong && before !== null) take(before);
    done(wrong ? before : x);
    if (wrong) box.value = plain(before);
    if (wrong) numberRefused(t`“${wrong.length > 20 ? `${wrong.slice(0, 20)}…` : wrong}” is no number here: type it as 1234${decimal()}5`);
    else numberRefused("");
    typing = false;
  });
  return box;
}

export const putNumber = (box, value) => {
  if (document.activeElement !== box || typed(box.value) !== value) box.value = plain(value);
};

function numeric(p, id) {
  const toSlider = (v) => p.log
    ? SLIDER * Math.log(Math.max(v, p.min) / p.min) / Math.log(p.max / p.min)
    : SLIDER * (v - p.min) / (p.max - p.min);
  const fromSlider = (s) => {
    const raw = p.log ? p.min * (p.max / p.min) ** (s / SLIDER) : p.min + (p.max - p.min) * s / SLIDER;
    if (p.kind === "integer") return Math.round(raw);
    return p.log ? Number(raw.toPrecision(3)) : Number((Math.round(raw / p.step) * p.step).toPrecision(8));
  };
  const box = numberField({ id, "aria-description": word(p.help) }, (x) => change(p.key, x, false), () => { settle(); update(); });
  box.addEventListener("keydown", (event) => {
    const by = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!by) return;
    event.preventDefault();
    nudged(p, slider, by);
  });
  const slider = el("input", { type: "range", min: 0, max: SLIDER, step: 1, "aria-label": t`${word(p.title)} slider` });
  slider.addEventListener("input", () => change(p.key, fromSlider(Number(slider.value)), false));
  slider.addEventListener("change", settle);
  slider.addEventListener("keydown", (event) => nudge(event, p, slider));
  return { value: box, slider, put: (v) => {
    putNumber(box, v);
    if (v !== null) slider.value = toSlider(v);
  } };
}

// Arrow keys move integers by one and other sliders by a hundredth of their way, Page keys by a tenth.
function nudge(event, p, slider) {
  const arrow = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key], page = { PageUp: 1, PageDown: -1 }[event.key];
  if (!arrow && !page) return;
  event.preventDefault();
  if (arrow) { nudged(p, slider, arrow); return; }
  moved(slider, page * SLIDER / 10);
}

function nudged(p, slider, by) {
  if (p.kind === "integer" && !p.log) change(p.key, Math.min(p.max, Math.max(p.min, read(p.key) + by)), true);
  else moved(slider, by * SLIDER / 100);
}

function moved(slider, by) {
  slider.value = Number(slider.value) + by;
  slider.dispatchEvent(new Event("input"));
  slider.dispatchEvent(new Event("change"));
}

function optional(p, id) {
  const inner = numeric(p, id);
  let kept = p.default ?? (p.log ? Math.sqrt(p.min * p.max) : (p.min + p.max) / 2);
  const auto = el("input", { type: "checkbox", "aria-label": t`${word(p.title)} automatic`, onchange: () => {
    change(p.key, auto.checked ? null : p.kind === "integer" ? Math.round(kept) : kept, true);
  } });
  const value = el("span", { class: "value" }, el("label", { class: "check" }, auto, t("auto")), inner.value);
  return { value, slider: inner.slider, put: (v) => {
    auto.checked = v === null;
    inner.value.disabled = inner.slider.disabled = v === null;
    if (v !== null) kept = v;
    inner.put(v);
  } };
}

const same = (a, b) => JSON.stringify(a) === JSON.stringify(b);

function update() {
  for (const { p, node, put } of rows.values()) {
    const value = read(p.key);
    put(value);
    node.classList.toggle("changed", !same(value, p.default));
  }
  for (const node of document.querySelectorAll(".tool")) {
    const changed = node.querySelectorAll(".parameter.changed").length;
    node.querySelector(".count").textContent = changed ? t`${changed} changed` : "";
  }
  $("undo").disabled = !canUndo();
  $("redo").disabled = !canRedo();
}

export function show() {
  const words = $("filter").value.toLowerCase().trim();
  const expert = $("expert").checked;
  for (const { p, node } of rows.values()) {
    const found = `${p.title} ${word(p.title)} ${p.key} ${p.help}`.toLowerCase().includes(words);
    node.hidden = !(words ? found : expert || p.level === "basic" || node.classList.contains("changed"));
  }
  for (const node of document.querySelectorAll(".tool")) {
    const all = [...node.querySelectorAll(".parameter")];
    node.classList.toggle("unmatched", Boolean(words) && all.every((n) => n.hidden));
    if (words && all.some((n) => !n.hidden)) node.open = true;
    node.classList.toggle("searched", Boolean(words));
  }
}

function explain(p) {
  if (!p) {
    clear($("help"), t("Point at a parameter to read what it does."));
    return;
  }
  const range = "min" in p ? ` · ${t("slider")} ${plain(p.min)} … ${plain(p.max)} ${p.unit}` : "";
  const preset = p.default === null ? t("auto") : typeof p.default === "object" ? JSON.stringify(p.default) : typeof p.default === "number" ? plain(p.default) : word(String(p.default));
  clear($("help"), el("b", {}, word(p.title)), p.help ? word(p.help) + " " : "", el("br"), el("code", {}, p.key), ` · ${t("default")} ${preset}${range}`);
}

export function problems(found) {
  for (const [key, { node, problem }] of rows) {
    node.classList.toggle("wrong", key in found);
    problem.hidden = !(key in found);
    problem.textContent = found[key] ?? "";
    if (key in found) node.hidden = false;
  }
}

export function reveal(key) {
  const found = rows.get(key);
  if (!found) return;
  found.node.hidden = false;
  found.node.closest("details").open = true;
  found.node.scrollIntoView({ block: "center" });
  found.node.classList.add("flash");
  setTimeout(() => found.node.classList.remove("flash"), 1200);
  (found.slider ?? found.node.querySelector("input, select")).focus();
  explain(found.p);
}

export const known = (key) => rows.get(key)?.p;
