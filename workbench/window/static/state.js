// The parameters: current, saved, and the history for undo and redo. Everything else listens.

export const state = {
  session: null,
  parameters: {},
  savedText: "",
  savedName: "recipe.toml",
  index: 0,
  view: "labels",
  selected: null,
};

const listeners = new Set();
const past = [], future = [];
let settled = "";

export const text = () => JSON.stringify(state.parameters);
export const listen = (f) => listeners.add(f);
const tell = (what) => listeners.forEach((f) => f(what));

export function begin(session) {
  state.session = session;
  state.parameters = structuredClone(session.start);
  settled = state.savedText = text();
}

export function read(key, from = state.parameters) {
  return key.split(".").reduce((at, part) => at?.[part], from);
}

function write(key, value) {
  const parts = key.split(".");
  const last = parts.pop();
  parts.reduce((at, part) => at[part], state.parameters)[last] = value;
}

// One tick of a slider; `done` when the hand leaves it: one undo step for one movement.
export function change(key, value, done) {
  write(key, value);
  if (done) settle();
  tell("parameters");
}

export function settle() {
  const now = text();
  if (now === settled) return;
  past.push(settled);
  if (past.length > 500) past.shift();
  future.length = 0;
  settled = now;
}

export function replace(parameters) {
  state.parameters = structuredClone(parameters);
  settle();
  tell("parameters");
}

export function undo() {
  settle();
  step(past, future);
}

export function redo() {
  settle();
  step(future, past);
}

function step(from, to) {
  if (!from.length) return;
  to.push(settled);
  settled = from.pop();
  state.parameters = JSON.parse(settled);
  tell("parameters");
}

export const canUndo = () => past.length > 0 || text() !== settled;
export const canRedo = () => future.length > 0;

export function saved(name) {
  settle();
  state.savedText = text();
  state.savedName = name;
  tell("saved");
}

export const dirty = () => text() !== state.savedText;
