// All images under the current parameters: contact sheet and table, before and after against the last saved set.

import { hashOf, isLost, post, thumbnailOf } from "./api.js";
import { $, clear, el } from "./dom.js";
import { isFailed, offerFlags, onFilter, passes } from "./filter.js";
import { scored } from "./history.js";
import { colourOf } from "./overlay.js";
import { listen, state, text } from "./state.js";
import { titleOf } from "./recipe.js";
import { colourOfFlag } from "./stripe.js";
import { WORDS, badgeText, entryOf, found, go, setBadge } from "./strip.js";
import { onTab, selectTab } from "./tabs.js";
import { found as foundAgain, lost, refresh } from "./stage.js";
import { download } from "./export.js";
import { feedTrend } from "./trend.js";
import { number, t, words } from "./words.js";

const survey = { text: "", savedText: "", now: [], saved: [], at: 0, savedAt: 0, total: 0, statistics: null, before: null, epoch: 0 };
let form = "sheet", order = { column: "index", down: false }, waiting = 0, busy = false;
const pictures = new Map();

export function startSheet() {
  buildSheet();
  listen(() => poke(0));
  onTab((id) => { if (id === "sheet") render(); });
  onFilter(() => { if (state.view === "sheet") render(); });
  poke(0);
}

export const surveyNow = () => poke(0);

function poke(delay) {
  clearTimeout(waiting);
  waiting = setTimeout(poll, delay);
}

async function poll() {
  if (busy) { poke(60); return; }
  busy = true;
  const config = text(), saved = state.savedText;
  try {
    if (survey.text !== config) {
      Object.assign(survey, { text: config, now: [], at: 0, statistics: null });
      feedTrend(survey.now, survey.saved); // what other parameters gave is not of these
    }
    if (survey.savedText !== saved) Object.assign(survey, { savedText: saved, saved: [], savedAt: 0, before: null });
    const answer = await post("survey", { config, saved, since: survey.at, since_saved: survey.savedAt });
    await take(answer, config, saved);
  } catch (error) { // of wrong parameters the picture says so
    if (isLost(error)) lost(error.message);
    busy = false;
    poke(text() !== config ? 0 : 2000);
    return;
  }
  busy = false;
  const done = survey.now.length >= survey.total && survey.saved.length >= survey.total;
  poke(text() !== config ? 0 : done ? 3000 : 220);
}

async function take({ now, saved, epoch }, config, savedText) {
  foundAgain();
  if (now.hash !== (await hashOf(config)) || saved.hash !== (await hashOf(savedText))) return; // stale: dropped
  if (config !== text()) return;
  if (epoch !== survey.epoch) { // the robot chain was solved meanwhile: everything is labelled anew
    Object.assign(survey, { epoch, now: [], saved: [], at: 0, savedAt: 0 });
    refresh();
    poke(0);
    return;
  }
  survey.total = now.total;
  for (const row of now.rows) {
    if (survey.now[row.index] && survey.now[row.index].stamp !== row.stamp) overwritten(row);
    survey.now[row.index] = row;
  }
  for (const row of saved.rows) survey.saved[row.index] = row;
  Object.assign(survey, { at: now.at, savedAt: saved.at });
  survey.statistics = now.statistics ?? null;
  survey.before = saved.statistics ?? null;
  now.rows.forEach(setBadge);
  Object.assign(document.documentElement.dataset, { surveyed: survey.now.length, surveyHash: now.hash, epoch });
  summary();
  offerFlags(now.rows);
  if (now.done >= now.total) scored(config, score());
  if (now.rows.length || saved.rows.length) feedTrend(survey.now, survey.saved);
  if (state.view === "sheet" && (now.rows.length || saved.rows.length)) render();
}

// The file of an image was written anew: its small pictures and, where it is shown, the large one are of the new one.
function overwritten(row) {
  pictures.delete(row.index);
  entryOf(row.index).querySelector("img").src = thumbnailOf(row.index, row.stamp);
  if (row.index === state.index) refresh();
}

// What a set of parameters reached over all images.
function score() {
  const rows = survey.now.filter((r) => r), sum = (f) => rows.reduce((n, r) => n + f(r), 0);
  return {
    images: rows.length, failed: rows.filter(isFailed).length, found: sum(found), labelled: sum((r) => r.labelled),
    rms: survey.statistics?.rms ?? null, missed: survey.statistics?.missed ?? null, false: survey.statistics?.false ?? null,
    out: rows.reduce((n, r) => n + r.values.filter((v) => v.lamp === "bad").length, 0),
  };
}

export const surveyed = () => survey.now;

const count = (rows, kind) => rows.filter((r) => r.badge === kind).length;

function summary() {
  const { now, total, statistics: s, before } = survey;
  const chips = [];
  const chip = (kind, text) => { const node = el("span", { class: `chip ${kind}` }, text); chips.push(node); return node; };
  const counted = now.filter((r) => r.badge === "count" || (r.stripe && !r.error));
  if (counted.length) {
    const n = counted.reduce((sum, r) => sum + found(r), 0);
    chip("", state.session.board ? t`${n} corners and points in ${counted.length} images` : counted[0].stripe ? state.session.has_images ? t`${n} points in ${counted.length} images` : t`${n} points in ${counted.length} profiles` : t`${n} spots in ${counted.length} images`);
  }
  if (now.length < total) chip("", t`${now.length} of ${total} images`);
  if (count(now, "all")) chip("good", t`${count(now, "all")} all found`);
  if (count(now, "some")) chip("warn", t`${count(now, "some")} some`);
  if (count(now, "none")) chip("bad", t`${count(now, "none")} none`);
  if (count(now, "out")) chip("bad", t`${count(now, "out")} out of tolerance`);
  if (count(now, "error")) chip("bad", t`${count(now, "error")} errors`);
  if (state.session.skipped.length) chip("warn", t`${state.session.skipped.length} left out`).title = state.session.skipped.join("\n");
  if (s && s.rms !== null) {
    const gain = before && before.rms !== null && now.length === total ? s.rms - before.rms : 0;
    const change = Math.abs(gain) >= 0.0005 ? ` (${gain > 0 ? "+" : "−"}${Math.abs(gain).toFixed(3)})` : "";
    chip("", `rms ${number(s.rms)} mm${change.replace(".", number(0.5, 1)[1])}`);
    for (const kind of ["missed", "false"]) {
      const more = before && now.length === total && survey.saved.length === total ? s[kind] - before[kind] : 0;
      chip(more > 0 ? "bad" : more < 0 ? "good" : s[kind] ? "warn" : "", `${s[kind]} ${t(kind)}${more ? ` (${more > 0 ? "+" : "−"}${Math.abs(more)})` : ""}`);
    }
  }
  clear($("summary"), chips);
}

let pressed = false, owed = false; // a click needs the button that it began on: nothing is rebuilt under a pressed pointer

function buildSheet() {
  const choice = (id, title) => el("button", { data: { form: id }, onclick: () => { form = id; render(); } }, t(title));
  parts.info = el("span");
  parts.progress = el("progress", { "aria-label": t("Images done") });
  parts.sort = el("select", { "aria-label": t("Sort by"), onchange: () => { order = { column: parts.sort.value.replace(/^-/, ""), down: parts.sort.value[0] === "-" }; render(); } });
  parts.body = el("div");
  clear($("sheet"), el("div", { class: "page-head" },
    el("span", { class: "choice" }, choice("sheet", "Contact sheet"), choice("table", "Table")), parts.sort, parts.progress, parts.info,
    el("span", { class: "spring" }), el("button", { id: "table-csv", onclick: exportTable }, t("Table as CSV"))), parts.body);
  let scrolled = 0;
  $("sheet").addEventListener("scroll", () => { if (form === "table" && !scrolled) scrolled = requestAnimationFrame(() => { scrolled = 0; parts.rows?.(); }); });
  $("sheet").addEventListener("pointerdown", () => { pressed = true; });
  window.addEventListener("pointerup", () => {
    pressed = false;
    if (owed) setTimeout(render); // after the click
  });
}

const parts = {};

function render() {
  owed = pressed;
  if (pressed) return;
  const { now, total, saved } = survey;
  for (const button of $("sheet").querySelectorAll("[data-form]")) button.setAttribute("aria-pressed", button.dataset.form === form);
  const changes = saved.map((b) => (now[b.index] ? now[b.index].labelled - b.labelled : 0));
  const won = changes.reduce((n, c) => n + Math.max(c, 0), 0), lost = changes.reduce((n, c) => n + Math.max(-c, 0), 0);
  Object.assign(parts.progress, { hidden: now.length >= total, max: total || 1, value: now.length });
  const seen = now.filter((r, i) => r && passes(r, i)).length, counted = t`${now.length} of ${total} images with the parameters as they stand`;
  clear(parts.info, counted, seen < now.length ? `; ${t`${seen} pass the filter`}` : "", won || lost ? [
    `; ${t("change against the last saved set:")} `, el("span", { class: won ? "better" : "" }, t`${won} strings gained`), ", ", el("span", { class: lost ? "worse" : "" }, t`${lost} lost`)] : "");
  sortChoice();
  if (form === "sheet") cards();
  else table();
}

// Ten thousand images stay fluid: cards are made once and drawn when they come into sight, the table holds the rows in sight.
const made = new Map();
const sight = new IntersectionObserver((seen) => seen.forEach(({ target, isIntersecting }) => {
  if (isIntersecting) drawCard(Number(target.dataset.index));
  else target.querySelector("canvas").width = 0; // its memory is given back
}));

function sortChoice() {
  const offered = columns().flatMap((c) => [[c.id, c.title], [`-${c.id}`, `${c.title} ↓`]]), now = (order.down ? "-" : "") + order.column;
  if (parts.sort.options.length !== offered.length) clear(parts.sort, offered.map(([value, title]) => el("option", { value }, title)));
  parts.sort.value = now;
}

// The rows that pass the filter, in the order that is asked for.
function ordered() {
  const all = columns(), by = all.find((c) => c.id === order.column) ?? all[0];
  return survey.now.filter((r, i) => r && passes(r, i)).sort((a, b) => compare(by.of(a), by.of(b)) * (order.down ? -1 : 1) || a.index - b.index);
}

function cards() {
  let grid = parts.body.querySelector(".cards");
  if (!grid) {
    grid = el("div", { class: "cards" });
    made.clear();
    clear(parts.body, grid);
  }
  const rows = ordered(), wanted = new Set(rows.map((r) => r.index));
  for (const [index, one] of made) if (!wanted.has(index)) { sight.unobserve(one.node); one.node.remove(); made.delete(index); }
  rows.forEach((row, place) => {
    const before = survey.saved[row.index], one = made.get(row.index);
    let node = one?.node;
    if (!one || one.row !== row || one.before !== before) {
      node = card(row);
      if (one) { sight.unobserve(one.node); one.node.replaceWith(node); }
      made.set(row.index, { node, row, before });
      sight.observe(node);
    }
    if (grid.children[place] !== node) grid.insertBefore(node, grid.children[place] ?? null);
  });
}

function delta(after, before, digits, lowerIsBetter) {
  if (before === undefined || before === null || after === null || after === undefined) return null;
  const change = after - before;
  if (Math.abs(change) < 0.5 * 10 ** -digits) return null;
  const better = lowerIsBetter ? change < 0 : change > 0;
  return el("span", { class: better ? "better" : "worse" }, ` ${change > 0 ? "+" : "−"}${Math.abs(change).toFixed(digits)}`);
}

const openImage = (index) => { go(index); selectTab("image"); };

function card(row) {
  const image = state.session.images[row.index], before = survey.saved[row.index], f = row.truth?.statistics;
  return el("button", { class: "card", data: { index: row.index }, onclick: () => openImage(row.index) },
    el("canvas", { width: 0, height: CARD_PX[1], data: { card: row.index } }),
    el("span", { class: `badge ${row.badge}` }, badgeText(row)),
    el("div", { class: "name" }, el("b", {}, image.name.split("/").pop()), el("span", {}, image.location)),
    el("div", { class: "note" }, row.error || [
      row.stripe ? cardWords(row) : row.badge === "count" ? t`${row.spots.length} spots` : t`${row.labelled} of ${row.spots.length} spots labelled`, delta(row.labelled, before?.labelled, 0, false),
      f && f.rms !== null ? ` · ${number(f.rms)} mm` : null, f ? delta(f.rms, before?.truth?.statistics.rms, 3, true) : null,
    ].filter((x) => x !== null)));
}

const FIRST = ["gapflush", "feature", "board", "stripe"]; // what a card says, the most special first
const cardWords = (row) => FIRST.flatMap((tool) => row.values.filter((v) => v.tool === tool && v.value !== null)).slice(0, 2).map((v) => `${titleOf(v.key)} ${number(v.value, v.digits)}`).join(" · ");

const CARD_PX = [340, 272];
const PICTURES = 400; // small pictures kept: what was in sight lately

function drawCard(index) {
  const row = survey.now[index], canvas = made.get(index)?.node.querySelector("canvas");
  if (!row || !canvas) return;
  let picture = pictures.get(row.index);
  if (!picture) {
    picture = new Image();
    picture.src = thumbnailOf(row.index, row.stamp);
    pictures.set(row.index, picture);
    if (pictures.size > PICTURES) pictures.delete(pictures.keys().next().value);
  }
  if (!picture.complete) { picture.addEventListener("load", () => drawCard(index), { once: true }); return; }
  if (!picture.naturalWidth) return;
  canvas.width = CARD_PX[0];
  if (!state.session.has_images) { canvas.getContext("2d").drawImage(picture, 0, 0, canvas.width, canvas.height); return; }
  const { sensor } = state.session, context = canvas.getContext("2d");
  const scale = Math.min(canvas.width / sensor.width, canvas.height / sensor.height);
  context.drawImage(picture, 0, 0, sensor.width * scale, sensor.height * scale);
  context.lineWidth = 1.5;
  context.fillStyle = colourOfFlag(0);
  (row.stripe?.u ?? []).forEach((u, i) => context.fillRect((u + 0.5) * scale - 1, (row.stripe.v[i] + 0.5) * scale - 1, 2, 2));
  for (const s of row.spots) {
    context.strokeStyle = s.label ? colourOf(s.label) : "#8b96a1";
    context.beginPath();
    context.arc((s.u + 0.5) * scale, (s.v + 0.5) * scale, s.label ? 6 : 4, 0, 2 * Math.PI);
    context.stroke();
  }
}

// The columns of the kind of rows that there are: strings have theirs, stripes and boards have their values.
function columns() {
  const row = survey.now.find((r) => r && !r.error), values = row?.stripe ? row.values : [];
  const own = values.map((v) => ({
    id: v.key, title: titleOf(v.key) + (v.unit ? ` [${v.unit}]` : ""), digits: v.digits, neutral: true,
    of: (r) => r.values.find((x) => x.key === v.key)?.value ?? null, lamp: (r) => r.values.find((x) => x.key === v.key)?.lamp,
  }));
  const fixed = COLUMNS.filter((c) => (!c.truth || state.session.has_truth) && (!c.spots || !row?.stripe));
  return [...fixed.slice(0, 3), ...own, ...fixed.slice(3)].map((c) => ({ ...c, title: t(c.title) }));
}

const COLUMNS = [
  { id: "index", title: "image", left: true, of: (r) => r.index, cell: (r) => state.session.images[r.index].name.split("/").pop() },
  { id: "location", title: "at", left: true, of: (r) => state.session.images[r.index].location },
  { id: "badge", title: "found", of: (r) => ["error", "out", "none", "some", "all", "count"].indexOf(r.badge), cell: (r) => el("span", { class: `badge ${r.badge}`, title: r.error || t(WORDS[r.badge]) }, badgeText(r)) },
  { id: "labelled", spots: true, title: "labelled", of: (r) => r.labelled, before: (r) => r.labelled, digits: 0 },
  { id: "spots", spots: true, title: "spots", of: (r) => r.spots.length, before: (r) => r.spots.length, digits: 0, neutral: true },
  { id: "rejected", spots: true, title: "rejected", of: (r) => r.candidates, digits: 0, neutral: true },
  { id: "missed", title: "missed", truth: true, of: (r) => r.truth?.statistics.missed, digits: 0, lower: true },
  { id: "false", title: "false", truth: true, of: (r) => r.truth?.statistics.false, digits: 0, lower: true },
  { id: "mislabelled", title: "mislabelled", truth: true, of: (r) => r.truth?.statistics.mislabelled, digits: 0, lower: true },
  { id: "rms", title: "rms [mm]", truth: true, of: (r) => r.truth?.statistics.rms, digits: 4, lower: true },
  { id: "bias_y", title: "bias y", truth: true, of: (r) => r.truth?.statistics.bias[0], digits: 4, neutral: true },
  { id: "bias_z", title: "bias z", truth: true, of: (r) => r.truth?.statistics.bias[1], digits: 4, neutral: true },
  { id: "ms", title: "ms", of: (r) => r.ms, digits: 0, neutral: true },
  { id: "reason", title: "remark", left: true, of: (r) => r.error || [words(r.reason), ...(r.remarks ?? [])].filter((x) => x).join("; ") },
];

const ROW_PX = 27, AROUND = 30; // height of a row, rows made beyond those in sight

function table() {
  const all = columns(), rows = ordered();
  const head = all.map((c) => el("th", { class: c.left ? "left" : "", "aria-sort": order.column === c.id ? (order.down ? "descending" : "ascending") : null },
    el("button", { onclick: () => { order = { column: c.id, down: order.column === c.id && !order.down }; render(); } }, c.title)));
  const body = el("tbody");
  made.clear();
  clear(parts.body, el("table", { class: "wide" }, el("thead", {}, el("tr", {}, head)), body));
  parts.rows = () => fill(body, all, rows);
  parts.rows();
}

function fill(body, columns, rows) {
  const page = $("sheet"), first = Math.max(0, Math.floor(page.scrollTop / ROW_PX) - AROUND);
  const last = Math.min(rows.length, first + Math.ceil(page.clientHeight / ROW_PX) + 2 * AROUND);
  const gap = (count) => el("tr", { class: "gap" }, el("td", { colSpan: columns.length, height: count * ROW_PX }));
  clear(body, total(columns), first ? gap(first) : null, rows.slice(first, last).map((r) => el("tr", { class: "go", tabIndex: 0, data: { index: r.index }, onclick: () => openImage(r.index),
    onkeydown: (e) => e.key === "Enter" && openImage(r.index) },
  columns.map((c) => el("td", { class: c.left ? "left" : "" }, cell(c, r))))), last < rows.length ? gap(rows.length - last) : null);
}

function compare(a, b) {
  return typeof a === "string" ? String(a).localeCompare(b) : (a ?? Infinity) - (b ?? Infinity);
}

function cell(c, r) {
  if (c.cell) return c.cell(r);
  if (c.lamp) return el("span", { class: c.lamp(r) === "bad" ? "worse" : c.lamp(r) === "good" ? "better" : "" }, number(c.of(r), c.digits));
  const value = c.of(r), before = survey.saved[r.index];
  if (c.digits === undefined) return value;
  return [number(value, c.digits), before && !c.neutral ? delta(value, c.of(before), c.digits, c.lower) : null].filter((x) => x !== null);
}

function total(columns) {
  const s = survey.statistics, b = survey.before, sum = (rows, f) => rows.reduce((n, r) => n + f(r), 0);
  const same = survey.saved.length === survey.now.length;
  const values = {
    index: t("total"), labelled: [sum(survey.now, (r) => r.labelled), same ? delta(sum(survey.now, (r) => r.labelled), sum(survey.saved, (r) => r.labelled), 0, false) : null],
    spots: sum(survey.now, (r) => r.spots.length), rejected: sum(survey.now, (r) => r.candidates ?? 0),
    missed: s && [s.missed, same && b ? delta(s.missed, b.missed, 0, true) : null], false: s && [s.false, same && b ? delta(s.false, b.false, 0, true) : null],
    mislabelled: s?.mislabelled, rms: s && [number(s.rms, 4), same && b ? delta(s.rms, b.rms, 4, true) : null],
    bias_y: s && number(s.bias[0], 4), bias_z: s && number(s.bias[1], 4), reason: s && s.scatter[0] !== null ? `${t("scatter")} ${number(s.scatter[0], 4)}, ${number(s.scatter[1], 4)} mm` : "",
  };
  return el("tr", { class: "total" }, columns.map((c) => el("td", { class: c.left ? "left" : "" }, [values[c.id] ?? ""].flat().filter((x) => x !== null))));
}

// The table as it is filtered and sorted, every value of every frame.
function exportTable() {
  const all = columns().filter((c) => c.id !== "badge"), keys = ordered().flatMap((r) => r.values.map((v) => v.key));
  const extra = state.session.has_images && survey.now[0]?.stripe ? [] : [...new Set(keys)].filter((k) => !all.some((c) => c.id === k));
  const quote = (x) => (/[",\n]/.test(String(x)) ? `"${String(x).replaceAll('"', '""')}"` : String(x ?? ""));
  const head = ["image", "location", "found", ...all.slice(2).map((c) => c.id), ...extra, "sigma_of_values"];
  const lines = ordered().map((r) => [
    state.session.images[r.index].name, state.session.images[r.index].location, r.badge, ...all.slice(2).map((c) => c.of(r)),
    ...extra.map((k) => r.values.find((v) => v.key === k)?.value), r.values.filter((v) => v.sigma !== null).map((v) => `${v.key}=${v.sigma}`).join(" "),
  ]);
  download(`${state.session.title}.csv`, [head, ...lines].map((row) => row.map(quote).join(",")).join("\n") + "\n", "text/csv");
}
