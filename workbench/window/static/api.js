// Talking to the server. Every answer about parameters carries their hash; the callers drop those that are stale.

import { state } from "./state.js";
import { t } from "./words.js";

export class Refused extends Error {
  constructor(message, problems = {}, status = 0) {
    super(message);
    this.problems = problems;
    this.status = status;
  }
}

async function failure(response) {
  const text = await response.text();
  try {
    const body = JSON.parse(text);
    return new Refused(t(body.error || text), body.problems, response.status);
  } catch {
    return new Refused(text || response.statusText, {}, response.status);
  }
}

// Every question says which opened folder it means: another page may have opened another one meanwhile.
async function fetched(path, options = {}) {
  try {
    return await fetch(path, { ...options, headers: { ...options.headers, ...(state.session ? { "x-opened": state.session.opened } : {}) } });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Refused(t("The program does not answer any more: start it again"));
  }
}

// Whether nothing that is asked will be answered: the program is gone, started anew, or has another folder open.
export const isLost = (error) => error instanceof Refused && [0, 403, 421].includes(error.status);

export const thumbnailOf = (index, stamp = "") => `api/thumbnail/${index}?opened=${state.session.opened}&${stamp}`;

export async function content(path) {
  const response = await fetched("api/" + path);
  if (!response.ok) throw await failure(response);
  return response.text();
}

export async function get(path) {
  const response = await fetched("api/" + path);
  if (!response.ok) throw await failure(response);
  return response.json();
}

const asked = (body, signal) => ({
  method: "POST",
  headers: { "content-type": "application/json" },
  body: JSON.stringify(body),
  signal,
});

export async function post(name, body, signal) {
  const response = await fetched("api/" + name, asked(body, signal));
  if (response.status === 409) return { ...(await response.json()), conflict: true };
  if (!response.ok) throw await failure(response);
  return response.json();
}

export async function pixels(path, body, signal) {
  // Numbers row by row with their size: { width, height, values, hash, stamp, step }.
  const response = await fetched("api/" + path, body ? asked(body, signal) : { signal });
  if (!response.ok) throw await failure(response);
  const head = (name) => Number(response.headers.get(name));
  const buffer = await response.arrayBuffer();
  const values = new ({ 1: Uint8Array, 2: Uint16Array, 4: Float32Array }[head("x-bytes")])(buffer);
  return { width: head("x-width"), height: head("x-height"), step: head("x-step"), values, hash: response.headers.get("x-hash"), stamp: response.headers.get("x-stamp"), odd: response.headers.get("x-odd") === "1" };
}

const hashes = new Map();

export async function hashOf(text) {
  if (!hashes.has(text)) {
    if (hashes.size > 200) hashes.clear();
    const digest = await crypto.subtle.digest("SHA-256", new TextEncoder().encode(text));
    hashes.set(text, [...new Uint8Array(digest)].map((b) => b.toString(16).padStart(2, "0")).join("").slice(0, 16));
  }
  return hashes.get(text);
}
