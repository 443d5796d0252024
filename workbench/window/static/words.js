// The page's language: English as written in the modules, German by the table; the decimal sign goes with it.

import { GERMAN, GERMAN_SENTENCES } from "./german.js";

export const LANGUAGES = ["en", "de"];
export let language = "en";

export function chooseLanguage(name) {
  language = LANGUAGES.includes(name) ? name : "en";
  document.documentElement.lang = language;
}

export const startLanguage = () =>
  chooseLanguage(localStorage.getItem("language") ?? (navigator.language.startsWith("de") ? "de" : "en"));

// t("words") or t`${n} of ${m} images`: the table's key has {} for each value.
export function t(text, ...values) {
  const parts = Array.isArray(text) ? text : [text];
  const key = parts.join("{}");
  let said = language === "de" ? GERMAN[key] ?? key : key;
  for (const value of values) said = said.replace("{}", () => value);
  return said;
}

// A word of the data, such as a reason or a parameter's title, where the table has it.
export const word = (text) => (language === "de" ? GERMAN[text] ?? text : text);

const patterns = Object.entries(GERMAN_SENTENCES).map(([english, german]) =>
  [new RegExp(`^${english.replace(/[.*+?^$()|[\]\\]/g, "\\$&").replaceAll("{}", "(.+?)")}$`), german]);
const counted = (list) => list.replace(/(\d)\.(\d)/g, "$1,$2").replace(/[a-z]+(_[a-z]+)*/g, (code) => word(code.replaceAll("_", " ")));

// A sentence that the program made: German where the table has it, else as it is.
export function sentence(text) {
  if (language !== "de") return text.replace(/(\d) ([a-z]+(?:_[a-z]+)+)/g, (_, n, code) => `${n} ${code.replaceAll("_", " ")}`);
  for (const [pattern, german] of patterns) {
    const found = text.match(pattern);
    if (found) return found.slice(1).reduce((said, value) => said.replace("{}", () => counted(value)), german);
  }
  return text;
}

// Codes as words, several joined by +; a sentence, which may name files and strings, as it is or in German.
export const words = (reason) => (/^[a-z]+([_+][a-z]+)*$/.test(reason ?? "") ? reason.split("+").map((code) => word(code.replaceAll("_", " "))).join(", ") : sentence(reason ?? ""));

export const decimal = () => (language === "de" ? "," : ".");

export function number(x, digits = 3) {
  if (x === null || x === undefined || !Number.isFinite(x)) return "–";
  return x.toFixed(digits).replace("-", "−").replace(".", decimal());
}

// A number as somebody types it, with either decimal sign; null where it is none, or where the sign that is not the
// language's stands before three digits: 1,000 may be a thousand or one.
export function typed(text) {
  const said = text.trim().replace("−", "-"), other = decimal() === "," ? "\\." : ",";
  if (!/^[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?$/i.test(said) || new RegExp(`^[+-]?[1-9]\\d{0,2}${other}\\d{3}$`).test(said)) return null;
  const value = Number(said.replace(",", "."));
  return Number.isFinite(value) ? value : null;
}

// A number as a field shows it: every digit that it has.
export const plain = (x) => (x === null || x === undefined ? "" : String(x).replace(".", decimal()));

// The text of the page's own markup.
export function translatePage(root = document.body) {
  for (const node of root.querySelectorAll("[data-t]")) node.textContent = t(node.dataset.t);
  for (const attribute of ["title", "aria-label", "placeholder"]) {
    for (const node of root.querySelectorAll(`[${attribute}]`)) {
      const key = node.dataset[`t${attribute.replace("-", "")}`] ?? node.getAttribute(attribute);
      node.dataset[`t${attribute.replace("-", "")}`] = key;
      node.setAttribute(attribute, t(key));
    }
  }
}
