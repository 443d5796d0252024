// Saving, loading, the equivalent command, and the list of keys: one dialog for all.

import { post } from "./api.js";
import { $, el } from "./dom.js";
import { cancel, close, open } from "./dialog.js";
import { download, exportPoints } from "./export.js";
import { dirty, replace, saved, state, text } from "./state.js";
import { savePicture as picture, say } from "./stage.js";
import { t } from "./words.js";

export function askSave() {
  const name = el("input", { type: "text", id: "save-name", value: state.savedName, spellcheck: false, "aria-label": t("File name") });
  const error = el("p", { class: "error", id: "save-error" });
  const go = el("button", { class: "strong", id: "save-go" }, t("Save"));
  let overwrite = false;
  name.addEventListener("input", () => { overwrite = false; go.textContent = t("Save"); error.textContent = ""; });
  const form = el("form", { onsubmit: async (event) => {
    event.preventDefault();
    try {
      const answer = await post("save", { name: name.value, config: text(), overwrite });
      if (answer.conflict) {
        overwrite = true;
        go.textContent = t("Overwrite");
        error.textContent = t`${answer.name} exists already.`;
        return;
      }
      state.session.settings = answer.names;
      saved(answer.name);
      say(t`Saved ${answer.name}`);
      close();
    } catch (problem) { error.textContent = problem.message; }
  } },
  el("h2", {}, t("Save the recipe")), el("p", {}, t`As TOML in ${state.session.settings_folder}; extract, profile, gapflush, validate and calibrate take it with --recipe.`),
  el("div", { class: "row" }, name), error,
  el("div", { class: "buttons" }, el("button", { type: "button", onclick: downloadRecipe }, t("Download instead")), cancel(), go));
  open(form);
  name.focus();
  name.setSelectionRange(0, name.value.length - 5);
}

async function downloadRecipe() {
  try {
    const { toml } = await post("toml", { config: text() });
    download(state.savedName, toml, "application/toml");
    close();
  } catch (problem) { $("save-error").textContent = problem.message; }
}

export function askLoad() {
  const error = el("p", { class: "error" });
  const take = async (action, body, isSaved) => {
    try {
      const answer = await post(action, body);
      replace({ ...answer.parameters, what: answer.parameters.what ?? state.parameters.what });
      if (isSaved) saved(answer.name);
      say(t`Loaded ${answer.name}`);
      close();
    } catch (problem) { error.textContent = problem.message; }
  };
  const disk = el("input", { type: "file", accept: ".toml", onchange: async () => {
    const file = disk.files[0];
    if (file) await take("parse", { toml: (await file.slice(0, 200000).text()) }, false);
  } });
  const list = state.session.settings.map((name) => el("button", { type: "button", data: { name }, onclick: () => take("load", { name }, true) }, name));
  open(el("div", { class: "body" }, el("h2", {}, t("Load a recipe")),
    list.length ? el("div", { class: "list" }, list) : el("p", {}, t("No TOML file in the opened folder.")),
    el("label", { class: "row" }, t("From elsewhere:"), disk), error, el("div", { class: "buttons" }, cancel())));
}

export async function askCommand() {
  const unsaved = dirty();
  try {
    const { command, toml } = await post("toml", { config: text(), name: state.savedName });
    const copied = await copy(command);
    open(el("div", { class: "body" }, el("h2", {}, copied ? t("Command copied") : t("The equivalent command")),
      el("pre", { id: "command-text" }, command),
      unsaved || !state.session.settings.includes(state.savedName) ? el("p", { class: "error" }, t`The parameters as they stand are not saved in ${state.savedName} yet.`) : null,
      el("pre", {}, toml),
      el("div", { class: "buttons" }, unsaved ? el("button", { onclick: askSave }, t("Save…")) : null, el("button", { onclick: close }, t("Close")))));
  } catch (problem) { say(problem.message, true); }
}

async function copy(command) {
  try {
    await navigator.clipboard.writeText(command);
    return true;
  } catch { return false; }
}

const KEYS = [
  ["J / K, Page Down / Up", "next, previous image"], [", .", "previous, next image that failed"], ["N, Shift+N", "next, previous spot, candidate or point in doubt"], ["[ ]", "previous, next page"], ["+ − wheel", "zoom"], ["drag, arrows on the picture", "pan"],
  ["F, 0, double click", "all of both panes"], ["1", "one screen pixel per image pixel"], ["B, Shift+B", "brighter, darker"], ["G M O R A X S L T", "layers: background, mask, clipped, region, accepted, rejected, spots, labels, truth"], ["P V W H Q I", "layers: points, in doubt, width, feature, corners, A/B"], ["Enter, Esc", "close or give up a region"], ["D", "measure a distance"], ["E", "expert parameters"], ["/", "filter parameters"],
  ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"], ["Ctrl+S, Ctrl+O", "save, load"], ["C", "calibrate"],
];

export function showKeys() {
  open(el("div", { class: "body" }, el("h2", {}, t("Keys")), el("div", { class: "keys" }, KEYS.flatMap(([k, words]) => [el("span", {}, el("kbd", {}, k)), el("span", {}, t(words))])),
    el("div", { class: "buttons" }, el("button", { onclick: close, autofocus: true }, t("Close")))));
}

export function askExport() {
  const button = (id, title, act, can = true) => (can ? el("button", { type: "button", id, onclick: async () => {
    try { await act(); close(); } catch (problem) { error.textContent = problem.message; }
  } }, t(title)) : null);
  const error = el("p", { class: "error" }), images = state.session.has_images;
  open(el("div", { class: "body" }, el("h2", {}, t("Export")), el("div", { class: "list" },
    button("export-png", "This image with its layers, PNG", () => picture("png"), images),
    button("export-svg", "This image with its layers, SVG", () => picture("svg"), images),
    button("export-points", "Points of this image, CSV", exportPoints),
    button("export-recipe", "The recipe, TOML", downloadRecipe),
    button("export-command", "The equivalent command", askCommandLater)), error,
  el("div", { class: "buttons" }, cancel())));
}

const askCommandLater = () => { setTimeout(askCommand); };
