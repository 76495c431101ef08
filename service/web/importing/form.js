// The options of an import: a field for each that the file does not state, the axes, and the others on request.

import { $, el } from "../base/format.js";

const UNITS = { m: "metres", cm: "centimetres", mm: "millimetres", um: "micrometres", in: "inches", ft: "feet" };
const TIMES = { s: "seconds", ms: "milliseconds", us: "microseconds" };
const FIELDS = {
  unit: { label: "Unit of positions", choices: UNITS },
  rate_hz: { label: "Frames per second" },
  time_unit: { label: "Unit of times", choices: TIMES },
  format: { label: "Format" },
  decimal: { label: "Decimal separator", choices: { point: "point", comma: "comma" }, none: "point" },
  columns: { label: "Columns", example: "time=t; tip=a,b,c; root=d,e,f" },
  rows: { label: "Rows of one recording", example: "sequence=3,side=left" },
  keep_zeros: { label: "Positions 0, 0, 0 are seen; else they are gaps", tick: true },
  keep_unlabelled: { label: "Import markers that were not identified, too", tick: true },
  incomplete: { label: "Import the frames that are there", tick: true },
  markers: { label: "Only these markers", example: "tip,root; or right_*" },
  repeated: { label: "Rows with the same time", choices: { gaps: "merge them, with gaps where they differ", first: "keep the first" } },
};
const DIRECTIONS = { aft: "aft", fore: "fore", out: "out", in: "in", right: "right", left: "left", up: "up", down: "down" };

let asked = new Map(); // questions about this file so far, by option
let onAnswer = () => {};

export function setUpForm(read) {
  onAnswer = read;
  for (const axis of "xyz") options($(`import-form`).elements.namedItem(`axis-${axis}`), DIRECTIONS, "not stated");
  $("import-form").addEventListener("submit", (event) => event.preventDefault());
  $("import-form").addEventListener("change", () => (axesAreWhole() ? onAnswer() : null));
  restart();
}

// Forget the answers: they belong to another file. The axes stay, because files of one campaign share them.
export function restart() {
  asked = new Map();
  $("import-asked").replaceChildren();
  $("import-others").replaceChildren();
  $("import-more").open = false;
  showQuestions([]);
}

const axes = () => [..."xyz"].map((axis) => $("import-form").elements.namedItem(`axis-${axis}`).value);
const axesAreWhole = () => new Set(axes().map((one) => one === "")).size === 1;

export function answers() {
  const values = {};
  for (const option of Object.keys(FIELDS)) {
    const field = $("import-form").elements.namedItem(option);
    if (field?.type === "checkbox") {
      if (field.checked) values[option] = "true";
    } else if (field?.value.trim()) values[option] = field.value.trim();
  }
  if (!axes().includes("")) values.axes = axes().map((direction, k) => `${"xyz"[k]} ${direction}`).join(", ");
  return values;
}

// Show a field for each of ``questions``; those of before stay, with their answers. ``errors`` mark the fields they name.
export function showQuestions(questions, errors = []) {
  const open = new Set(questions.map((one) => one.option));
  for (const one of questions) {
    const node = asked.get(one.option);
    if (node?.dataset.message === one.message) continue;
    const value = $("import-form").elements.namedItem(one.option)?.value;
    $("import-others").querySelector(`[data-option=${one.option}]`)?.remove();
    const fresh = field(one.option, one);
    if (node) node.replaceWith(fresh);
    else $("import-asked").append(fresh);
    asked.set(one.option, fresh);
    const control = $("import-form").elements.namedItem(one.option);
    if (value && control.type !== "checkbox" && !(control.tagName === "SELECT" && ![...control.options].some((o) => o.value === value))) control.value = value;
  }
  for (const [option, node] of asked) node.classList.toggle("answered", !open.has(option));
  for (const option of Object.keys(FIELDS)) {
    if (!$("import-form").elements.namedItem(option)) $("import-others").append(field(option));
  }
  $("import-asked").hidden = !asked.size;
  mark(errors);
}

function mark(errors) {
  const wrong = new Set(errors.map(({ where }) => where.replace(/^body\.|^--/, "").replaceAll("-", "_")));
  for (const control of $("import-form").elements) {
    if (wrong.has(control.name)) control.setAttribute("aria-invalid", "true");
    else control.removeAttribute?.("aria-invalid");
  }
  for (const axis of "xyz") if (wrong.has("axes")) $("import-form").elements.namedItem(`axis-${axis}`).setAttribute("aria-invalid", "true");
}

function field(option, question = null) {
  const { label, tick } = FIELDS[option] ?? { label: option };
  const control = controlOf(option, question);
  const about = question ? why(question) : null;
  const note = about ? el("small", {}, about) : null;
  const node = el("div", { className: "field" }, tick
    ? el("label", { className: "tick" }, control, el("span", {}, ` ${label}`)) : el("label", {}, label, " ", control), note);
  node.dataset.option = option;
  node.dataset.message = question?.message ?? "";
  return node;
}

// The first part of the message; its remedy is the field itself.
const why = ({ message, hint, choices, option }) => [
  inWords(message.split(/; (?:add|say|choose|merge|export|if this|if they|name them|label them|times must|numbers of frames)/)[0]).replace(/^(?=states|has|fits)/, "The file "),
  hint && !message.includes(hint) ? hint : null, option === "columns" && choices.length ? `columns: ${choices.join(", ")}` : null].filter(Boolean).join("; ");

function controlOf(option, question) {
  const { choices, none, tick, example = "" } = FIELDS[option] ?? {};
  if (tick) return el("input", { type: "checkbox", name: option });
  const given = question?.choices.length && option !== "columns" ? Object.fromEntries(question.choices.map((one) => [one, choices?.[one] ?? one])) : null;
  if (!choices && !given) return el("input", { type: "text", name: option, inputMode: option === "rate_hz" ? "decimal" : "text", placeholder: example, autocomplete: "off" });
  const select = el("select", { name: option });
  options(select, given ?? choices, none && !given ? null : question ? "choose" : "as in the file");
  return select;
}

function options(select, words, empty) {
  const listed = Object.entries(words).map(([value, text]) => new Option(text === value || !UNITS[value] && !TIMES[value] ? text : `${value} (${text})`, value));
  select.replaceChildren(...(empty === null ? [] : [new Option(empty, "")]), ...listed);
}

// A message of the server, with the labels of this form instead of the options of the command line.
export const inWords = (text) => text.replace(/^body\.(\w+)/, (place, name) => FIELDS[name]?.label ?? (name === "axes" ? "Axes" : place)).replace(/--([a-z]+(?:-[a-z]+)*)/g, (option, name) =>
  (name === "axes" ? "“Where each axis points”" : FIELDS[name.replaceAll("-", "_")] ? `“${FIELDS[name.replaceAll("-", "_")].label}”` : option));
