// Saving, loading, the equivalent command, and the list of keys: one dialog for all.

import { post } from "./api.js";
import { $, clear, el } from "./dom.js";
import { dirty, replace, saved, state, text } from "./state.js";
import { say } from "./stage.js";

function open(...content) {
  clear($("dialog"), content);
  if (!$("dialog").open) $("dialog").showModal();
}

const close = () => $("dialog").close();
const cancel = () => el("button", { type: "button", onclick: close }, "Cancel");

export function askSave() {
  const name = el("input", { type: "text", id: "save-name", value: state.savedName, spellcheck: false, "aria-label": "File name" });
  const error = el("p", { class: "error", id: "save-error" });
  const go = el("button", { class: "strong", id: "save-go" }, "Save");
  let overwrite = false;
  name.addEventListener("input", () => { overwrite = false; go.textContent = "Save"; error.textContent = ""; });
  const form = el("form", { onsubmit: async (event) => {
    event.preventDefault();
    try {
      const answer = await post("save", { name: name.value, config: text(), overwrite });
      if (answer.conflict) {
        overwrite = true;
        go.textContent = "Overwrite";
        error.textContent = `${answer.name} exists already.`;
        return;
      }
      state.session.settings = answer.names;
      saved(answer.name);
      say(`Saved ${answer.name}`);
      close();
    } catch (problem) { error.textContent = problem.message; }
  } },
  el("h2", {}, "Save parameters"), el("p", {}, `As TOML in ${state.session.settings_folder}; extract, validate and calibrate take it with --config.`),
  el("div", { class: "row" }, name), error,
  el("div", { class: "buttons" }, el("button", { type: "button", onclick: download }, "Download instead"), cancel(), go));
  open(form);
  name.focus();
  name.setSelectionRange(0, name.value.length - 5);
}

async function download() {
  try {
    const { toml } = await post("toml", { config: text() });
    const link = el("a", { href: URL.createObjectURL(new Blob([toml], { type: "application/toml" })), download: state.savedName });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    close();
  } catch (problem) { $("save-error").textContent = problem.message; }
}

export function askLoad() {
  const error = el("p", { class: "error" });
  const take = async (action, body, isSaved) => {
    try {
      const answer = await post(action, body);
      replace(answer.parameters);
      if (isSaved) saved(answer.name);
      say(`Loaded ${answer.name}`);
      close();
    } catch (problem) { error.textContent = problem.message; }
  };
  const disk = el("input", { type: "file", accept: ".toml", onchange: async () => {
    const file = disk.files[0];
    if (file) await take("parse", { toml: (await file.slice(0, 200000).text()) }, false);
  } });
  const list = state.session.settings.map((name) => el("button", { type: "button", data: { name }, onclick: () => take("load", { name }, true) }, name));
  open(el("div", { class: "body" }, el("h2", {}, "Load parameters"),
    list.length ? el("div", { class: "list" }, list) : el("p", {}, "No TOML file in the opened folder."),
    el("label", { class: "row" }, "From elsewhere:", disk), error, el("div", { class: "buttons" }, cancel())));
}

export async function askCommand() {
  const unsaved = dirty();
  try {
    const { command, toml } = await post("toml", { config: text(), name: state.savedName });
    const copied = await copy(command);
    open(el("div", { class: "body" }, el("h2", {}, copied ? "Command copied" : "The equivalent command"),
      el("pre", { id: "command-text" }, command),
      unsaved || !state.session.settings.includes(state.savedName) ? el("p", { class: "error" }, `The parameters as they stand are not saved in ${state.savedName} yet.`) : null,
      el("pre", {}, toml),
      el("div", { class: "buttons" }, unsaved ? el("button", { onclick: askSave }, "Save…") : null, el("button", { onclick: close }, "Close"))));
  } catch (problem) { say(problem.message, true); }
}

async function copy(command) {
  try {
    await navigator.clipboard.writeText(command);
    return true;
  } catch { return false; }
}

const KEYS = [
  ["J / K, Page Down / Up", "next, previous image"], [", .", "previous, next image that failed"], ["N, Shift+N", "next, previous spot or candidate"], ["[ ]", "previous, next page"], ["+ − wheel", "zoom"], ["drag, arrows on the picture", "pan"],
  ["F, 0, double click", "all of both panes"], ["1", "one screen pixel per image pixel"], ["B, Shift+B", "brighter, darker"], ["G M O A X S L T", "layers: background, mask, clipped, accepted, rejected, spots, labels, truth"], ["D", "measure a distance"], ["E", "expert parameters"], ["/", "filter parameters"],
  ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"], ["Ctrl+S, Ctrl+O", "save, load"], ["C", "calibrate"],
];

export function showKeys() {
  open(el("div", { class: "body" }, el("h2", {}, "Keys"), el("div", { class: "keys" }, KEYS.flatMap(([k, t]) => [el("span", {}, el("kbd", {}, k)), el("span", {}, t)])),
    el("div", { class: "buttons" }, el("button", { onclick: close, autofocus: true }, "Close"))));
}
