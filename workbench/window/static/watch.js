// A watched folder: what comes is taken in and, while it is followed, shown.

import { post } from "./api.js";
import { $ } from "./dom.js";
import { state } from "./state.js";
import { addToStrip, go } from "./strip.js";
import { surveyNow } from "./sheet.js";

const EVERY_MS = 60;

export function startWatching() {
  $("follow-switch").hidden = !state.session.watched;
  if (state.session.watched) look();
}

async function look() {
  try {
    const { images } = await post("watch", { since: state.session.images.length });
    if (images.length) {
      state.session.images.push(...images);
      addToStrip();
      if ($("follow").checked) go(state.session.images.length - 1); // before the survey: the shown image comes first
      surveyNow();
    }
  } catch { /* a lost server: the picture says so */ }
  setTimeout(look, EVERY_MS);
}
