// The page's beginning: fetch the session, build the parts, wire the keys.

import { get } from "./api.js";
import { openCalibration, recolour } from "./calibration.js";
import { $ } from "./dom.js";
import { LAYERS, toggle } from "./layers.js";
import { switchMeasure } from "./measure.js";
import { askCommand, askExport, askLoad, askSave, showKeys } from "./files.js";
import { buildFilter } from "./filter.js";
import { startHistory } from "./history.js";
import { nameStrings } from "./overlay.js";
import { askOpen, leaving } from "./opening.js";
import { buildRecipe } from "./recipe.js";
import { close as closeRegion, drawing, giveUp } from "./region.js";
import { startSheet } from "./sheet.js";
import { begin, dirty, redo, replace, state, undo } from "./state.js";
import { buildStrip, go, near, showThumbnails } from "./strip.js";
import { buildStage, show, stage } from "./stage.js";
import { TABS, selectTab } from "./tabs.js";
import { startWatching } from "./watch.js";
import { buildTrend, drawTrend, nextFailed } from "./trend.js";
import { chooseLanguage, language, startLanguage, t, translatePage } from "./words.js";

async function start() {
  startLanguage();
  translatePage();
  theme(localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
  try {
    begin(await get("session"));
    restore();
  } catch (error) {
    $("notice").className = "notice";
    $("notice").textContent = error.message;
    return;
  }
  const { session } = state;
  nameStrings(session.strings);
  $("title").textContent = session.title;
  $("title").title = session.folder;
  document.title = `${session.title} · ${t("Process window")}`;
  $("language").textContent = language.toUpperCase();
  $("language").setAttribute("aria-label", `${language.toUpperCase()}: ${t("English or German")}`);
  $("open").hidden = !session.can_reopen;
  $("calibrate").disabled = !session.can_calibrate;
  $("calibrate").title = session.can_calibrate ? t("Run pose and calibration on what is found (C)") : t(session.no_calibration);
  buildFilter();
  buildStrip();
  buildStage();
  buildRecipe();
  buildTrend();
  startHistory();
  buttons();
  startWatching();
  selectTab("image");
  show().finally(() => { showThumbnails(); startSheet(); });
}

function theme(name) {
  document.documentElement.dataset.theme = name;
  localStorage.setItem("theme", name);
  stage.redraw?.();
  if (state.session) drawTrend();
  recolour();
}

function buttons() {
  $("load").onclick = askLoad;
  $("save").onclick = askSave;
  $("command").onclick = askCommand;
  $("export").onclick = askExport;
  $("open").onclick = askOpen;
  $("keys").onclick = showKeys;
  $("language").onclick = switchLanguage;
  $("theme").onclick = () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  $("calibrate").onclick = openCalibration;
  window.addEventListener("keydown", key);
  window.addEventListener("beforeunload", (event) => { if (dirty() && !leaving.now) event.preventDefault(); });
}

// Keys that move a slider belong to the slider.
const sliding = (event) => event.target.matches("input[type=range]") && /^(Arrow|Page|Home|End)/.test(event.key);
const typing = (node) => node.matches("input:not([type=range]):not([type=checkbox]), select, textarea");

// The page is built anew in the other language; the parameters are kept.
function switchLanguage() {
  localStorage.setItem("language", language === "de" ? "en" : "de");
  sessionStorage.setItem("kept", JSON.stringify({ folder: state.session.folder, parameters: state.parameters }));
  chooseLanguage(localStorage.getItem("language"));
  leaving.now = true;
  location.reload();
}

function restore() {
  const kept = JSON.parse(sessionStorage.getItem("kept") ?? "null");
  sessionStorage.removeItem("kept");
  if (kept?.folder === state.session.folder) replace(kept.parameters);
}

function key(event) {
  if ($("dialog").open) return;
  if (drawing.kind && !typing(event.target) && ["Enter", "Escape"].includes(event.key)) {
    event.preventDefault();
    (event.key === "Enter" ? closeRegion : giveUp)();
    return;
  }
  const control = event.ctrlKey || event.metaKey;
  const name = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const wanted = control ? CONTROL[name] : event.altKey || typing(event.target) || sliding(event) ? null : PLAIN[event.key] ?? PLAIN[name];
  if (!wanted) return;
  event.preventDefault();
  wanted(event);
}

const CONTROL = { z: (e) => (e.shiftKey ? redo() : undo()), y: redo, s: askSave, o: askLoad };
const PLAIN = {
  "j": () => go(near(state.index, 1)), "k": () => go(near(state.index, -1)),
  "PageDown": () => go(near(state.index, 1)), "PageUp": () => go(near(state.index, -1)),
  "f": () => $("fit").click(), "0": () => $("fit").click(), "1": () => stage.one(),
  "+": () => stage.view().zoom(1.25), "=": () => stage.view().zoom(1.25), "-": () => stage.view().zoom(0.8),
  ...Object.fromEntries(LAYERS.map(({ id, key }) => [key, () => toggle(id)])), "d": switchMeasure, "c": () => $("calibrate").click(), "?": showKeys,
  "/": () => $("filter").focus(), "e": () => $("expert").click(), "b": (e) => brightness(e.shiftKey ? -0.1 : 0.1),
  "n": (e) => stage.next(e.shiftKey ? -1 : 1), ".": () => nextFailed(1), ",": () => nextFailed(-1), "[": () => step(-1), "]": () => step(1),
};

function brightness(by) {
  $("bright").value = Number($("bright").value) + by;
  $("bright").dispatchEvent(new Event("input"));
}

function step(by) {
  const shown = TABS.map((t) => t.id);
  selectTab(shown[(shown.indexOf(state.view) + by + shown.length) % shown.length]);
}

start();
