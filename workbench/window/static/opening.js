// Another folder in place of this one.

import { post } from "./api.js";
import { $, el } from "./dom.js";
import { cancel, open } from "./dialog.js";
import { dirty, state } from "./state.js";
import { t } from "./words.js";

const FIELDS = [
  ["folder", "Folder, dataset or file", "/data/cell"], ["sensor", "sensor.toml, or a preset's name", "lmi_gocator_2340"], ["jig", "jig.toml", ""], ["board", "board.toml", ""],
];

export function askOpen() {
  const error = el("p", { class: "error", id: "open-error" });
  const boxes = FIELDS.map(([id, title, hint]) => [id, el("input", { type: "text", id: `open-${id}`, value: id === "folder" ? state.session.folder : "", placeholder: hint, spellcheck: false }), title]);
  const form = el("form", { onsubmit: async (event) => {
    event.preventDefault();
    try {
      await post("open", Object.fromEntries(boxes.map(([id, box]) => [id, box.value])));
      leaving.now = true;
      location.reload();
    } catch (problem) { error.textContent = problem.message; }
  } },
  el("h2", {}, t("Open another folder")),
  dirty() ? el("p", { class: "error" }, t("The recipe as it stands is not saved.")) : null,
  boxes.map(([, box, title]) => el("label", { class: "field" }, t(title), box)), error,
  el("div", { class: "buttons" }, cancel(), el("button", { class: "strong", id: "open-go" }, t("Open"))));
  open(form);
  $("open-folder").select();
}

export const leaving = { now: false };
