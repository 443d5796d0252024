// One dialog for all that asks or tells something.

import { $, clear, el } from "./dom.js";
import { t } from "./words.js";

export function open(...content) {
  clear($("dialog"), content);
  if (!$("dialog").open) $("dialog").showModal();
}

export const close = () => $("dialog").close();
export const cancel = () => el("button", { type: "button", onclick: close }, t("Cancel"));
