// Formatting of numbers, and creation of elements.

export const DASH = "–";

// ``value`` with decimals; never -0.
export const fixed = (value, decimals) => {
  if (value === null || value === undefined) return DASH;
  const text = value.toFixed(decimals);
  return Number(text) === 0 ? text.replace("-", "") : text;
};

// Significant digits with trailing zeros: 0.0500, 12.0, 385. The command line rounds equally (cli/base/rounding.py).
export function rounded(value, digits = 3) {
  if (value === null || value === undefined) return DASH;
  if (value === 0) return "0";
  const power = Number(value.toExponential(digits - 1).split("e")[1]);
  return power < -4 || power > 5 ? significant(value, digits) : value.toFixed(Math.max(digits - 1 - power, 0));
}

// Four decimals; only an exact 1 is shown as 1.
export const correlation = (value) => (value !== null && value >= 0.99995 && value < 1 - 1e-9 ? ">0.9999" : fixed(value, 4));

const UNITS = [["N", 1, 10], ["mN", 1e3, 1e-3], ["µN", 1e6, 0]];

// A unit that suits the largest of the forces (N) of a table, and a function that shows forces in it.
export function forceUnit(newtons) {
  const sizes = newtons.filter(Boolean).map(Math.abs);
  const largest = sizes.length ? Math.max(...sizes) : 1;
  const [unit, factor] = UNITS.find(([, , least]) => largest >= least) ?? UNITS[1];
  return { unit, show: (value, digits = 3) => rounded(value === null || value === undefined ? null : factor * value, digits) };
}

export const withForceUnit = (newtons) => {
  const { unit, show } = forceUnit([newtons]);
  return `${show(newtons)} ${unit}`;
};

export const mm = (value) => (value === null || value === undefined ? DASH : value.toFixed(value < 10 ? 2 : 1));

export function significant(value, digits = 4) {
  if (value === null || value === undefined) return DASH;
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) {
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    return `${Number(mantissa)}·10${superscript(Number(power))}`;
  }
  return String(Number(value.toPrecision(digits)));
}

const superscript = (n) => [...String(n)].map((c) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[c] ?? "⁻").join("");

export function duration(seconds) {
  if (seconds === null || seconds === undefined) return null;
  const s = Math.max(0, Math.round(seconds));
  if (s < 90) return `${s} s`;
  if (s < 5400) return `${Math.round(s / 60)} min`;
  return `${Math.floor(s / 3600)} h ${Math.round((s % 3600) / 60)} min`;
}

export const when = (text) =>
  new Date(text).toLocaleString(undefined, { month: "short", day: "numeric", hour: "2-digit", minute: "2-digit" });

export const size = (bytes) => (bytes >= 1e6 ? `${(bytes / 1e6).toFixed(1)} MB` : bytes >= 1e3 ? `${(bytes / 1e3).toFixed(0)} kB` : `${bytes} bytes`);

// Escaped text for charts: Plotly interprets markup.
export const plain = (text) => String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");

// ``text`` that, if written from right to left, leaves what stands beside it in place.
export const isolated = (text) => (/[\u0590-\u08ff\ufb1d-\ufefc]/.test(text) ? `\u2068${text}\u2069` : text);

export const plural = (n, word) => `${n} ${word}${n === 1 ? "" : "s"}`;

// A new element with properties and children; text children are text, never markup.
export function el(tag, properties = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in node) node[name] = value;
    else node.setAttribute(name, value);
  }
  node.append(...children.filter((child) => child !== null && child !== undefined));
  return node;
}

// A key number with its label and unit, for a list of class "numbers"; a ``main`` one is emphasised.
export const keyNumber = (label, value, unit = "", main = false) =>
  el("div", { className: main ? "main" : "" }, el("dt", {}, label), el("dd", {}, value, unit && value !== DASH ? el("small", {}, ` ${unit}`) : ""));

export const $ = (id) => document.getElementById(id);

const TOAST_MS = 4000;
const LETTER_MS = 60; // that reading takes

let toastTimer = null;
export function toast(text) {
  const node = $("toast");
  node.textContent = text;
  node.hidden = false;
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => { node.hidden = true; }, Math.max(TOAST_MS, LETTER_MS * text.length));
}
