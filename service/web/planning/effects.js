// Which effects will be seen and distinguished, and from what size: a sortable table with marks on an axis of sizes.

import { $, correlation, DASH, el, plural, rounded, significant } from "../base/format.js";
import { spoken } from "../base/labels.js";
import { counted } from "./head.js";

const [SMALLEST, LARGEST] = [0.01, 10]; // times the typical size: ends of the axis
const UNITS = { m: ["mm", 1e3], rad: ["°", 180 / Math.PI], s: ["ms", 1e3], N: ["mN", 1e3] };

const last = (value) => value ?? Infinity; // of a size: none is enough
const isChoice = (one) => one.smallest_part === null && one.detection_probability >= plan.power; // it has no size
const COLUMNS = [
  { head: "Effect", key: "title", of: (one) => one.title.toLowerCase() },
  { head: "Sizes, relative to the typical one", axis: true },
  { head: "Seen from", key: "seen", number: true, of: (one) => last(one.smallest_part), title: "smallest size that is detected with the stated probability" },
  { head: "× typical", key: "part", number: true, of: (one) => last(one.smallest_part) },
  { head: "Distinguished from", key: "apart", number: true, of: (one, alike) => (isChoice(one) && !alike.has(one.name) ? 0 : last(one.separable_part)), title: "smallest size, times the typical one, at which the effect is distinguished from the one that it is most like" },
  { head: "Diagnosed from", key: "diagnosed", number: true, of: (one) => last(one.diagnosed_part), title: "size, times the typical one, from which a diagnosis counts it as evidence" },
  { head: "In the genes", key: "explained", number: true, of: (one) => one.explained_percent, title: "part of its change that the genes imitate" },
  { head: "Most like", key: "like", of: (one) => -one.cosine, title: "sorted by likeness; 1 means no difference" },
];

let plan = null;
let sort = "apart";
let ascending = false;

export function drawEffects(next) {
  plan = next;
  const { effects, confused, power, false_alarm: alarm, odds } = next;
  $("plan-effects-part").hidden = !effects.length;
  if (!effects.length) return;
  $("plan-effects-note").textContent = `Seen: detected with a probability of ${significant(100 * power)} %, false alarms of all effects together ${significant(100 * alarm)} %. `
    + `Distinguished: its likelihood is ${significant(odds)} times that of the effect that it is most like. Left of the line at 1, an effect of typical size is enough.`;
  drawHead();
  drawRows();
  $("plan-confused-part").hidden = !confused.length;
  $("plan-confused-title").textContent = `${plural(confused.length, "pair")} of effects that typical sizes do not distinguish`;
  const titles = new Map(effects.map((one) => [one.name, one.title]));
  const link = (name) => el("a", { href: `#effects=${encodeURIComponent(name)}` }, titles.get(name) ?? spoken(name));
  $("plan-confused").tBodies[0].replaceChildren(...confused.map((pair) => el("tr", {}, el("td", {}, link(pair.one)), el("td", {}, link(pair.other)),
    el("td", { className: "n" }, correlation(pair.cosine)), el("td", { className: "n" }, `${Math.round(100 * pair.probability)} %`))));
}

function drawHead() {
  const focused = document.activeElement?.dataset?.key;
  $("plan-effects").tHead.replaceChildren(el("tr", {}, ...COLUMNS.map(({ head, key, number, axis, title = "" }) => {
    if (axis) return el("th", { scope: "col", className: "wide" }, el("span", { className: "hidden" }, head), ruler());
    const button = el("button", { type: "button", title, onclick: () => resort(key) }, head);
    button.dataset.key = `plan-${key}`;
    const cell = el("th", { scope: "col", className: number ? "n" : "" }, button);
    if (sort === key) cell.ariaSort = ascending ? "ascending" : "descending";
    return cell;
  })));
  if (focused?.startsWith("plan-")) $("plan-effects").querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}

function resort(key) {
  ascending = sort === key ? !ascending : key === "title";
  sort = key;
  drawHead();
  drawRows();
}

function drawRows() {
  const { of } = COLUMNS.find((column) => column.key === sort);
  const order = (a, b) => (a < b ? -1 : a > b ? 1 : 0);
  const { alike } = counted(plan);
  const rows = plan.effects.toSorted((a, b) => (ascending ? 1 : -1) * order(of(a, alike), of(b, alike)) || order(a.title, b.title));
  $("plan-effects").tBodies[0].replaceChildren(...rows.map((one) => row(one, alike)));
}

const times = (part) => (part === null ? DASH : rounded(part, 2));

function row(one, alike) {
  const missed = one.detection_probability < plan.power;
  const like = one.rival === null ? DASH : [el("a", { href: `#effects=${encodeURIComponent(one.rival)}` }, plan.effects.find(({ name }) => name === one.rival)?.title ?? spoken(one.rival)),
    el("small", {}, ` (${rounded(one.cosine, one.cosine > 0.99 ? 4 : 2)})`)];
  const state = missed ? el("span", { className: "badge bad" }, "missed") : alike.has(one.name) ? el("span", { className: "badge fit-doubtful" }, "confused") : null;
  return el("tr", { className: missed ? "missed" : alike.has(one.name) ? "alike" : "" },
    el("th", { scope: "row" }, el("a", { href: `#effects=${encodeURIComponent(one.name)}` }, one.title), " ", state),
    el("td", { className: "wide" }, marks(one)), el("td", { className: "n" }, ...smallest(one)), el("td", { className: "n" }, times(one.smallest_part)),
    el("td", { className: "n" }, isChoice(one) && !alike.has(one.name) ? el("small", {}, "yes") : times(one.separable_part)), el("td", { className: "n" }, times(one.diagnosed_part)),
    el("td", { className: "n" }, `${Math.round(one.explained_percent)} %`), el("td", {}, ...[like].flat()));
}

// The smallest size that is seen, in its unit; of several sizes the first.
function smallest(one) {
  const { sizes: [size], smallest_part: part } = one;
  if (part === null) return [el("small", {}, isChoice(one) ? "has no size: seen" : "not seen")];
  if (!size || size.smallest === null) return [DASH];
  const [unit, factor] = UNITS[size.unit] ?? [size.unit === "1" ? "" : size.unit, 1];
  return [`${significant(factor * size.smallest, 2)}${unit === "°" ? "°" : unit && ` ${unit}`}`, el("small", {}, ` ${spoken(size.name.split(".").at(-1))}`)];
}

// Place of a size on the axis, per cent.
const place = (part) => (100 * Math.log(Math.min(LARGEST, Math.max(SMALLEST, part)) / SMALLEST)) / Math.log(LARGEST / SMALLEST);

function ruler() {
  const node = el("div", { className: "plan-ruler" });
  for (const value of [0.01, 0.1, 1, 10]) {
    const mark = el("span", {}, String(value));
    mark.style.left = `${place(value)}%`;
    node.append(mark);
  }
  return node;
}

function marks(one) {
  const { smallest_part: seen, separable_part: apart, diagnosed_part: diagnosed } = one;
  const words = [seen === null ? "" : `seen from ${times(seen)}`, apart === null ? "not distinguished by its size" : `distinguished from ${times(apart)}`, diagnosed === null ? "" : `diagnosed from ${times(diagnosed)}`];
  const text = `${words.filter(Boolean).join(", ")} times the typical size`;
  const node = el("div", { className: "plan-sizes", role: "img", ariaLabel: text, title: text });
  const put = (className, value, until = null) => {
    const mark = el("i", { className });
    mark.style.left = `${place(value)}%`;
    if (until !== null) mark.style.width = `${place(until) - place(value)}%`;
    node.append(mark);
  };
  put("typical", 1);
  const known = [seen, apart, diagnosed].filter((value) => value !== null);
  if (known.length > 1) put("line", Math.min(...known), Math.max(...known));
  if (diagnosed !== null) put(diagnosed > LARGEST ? "diagnosed beyond" : "diagnosed", diagnosed);
  if (apart !== null) put(apart > LARGEST ? "apart beyond" : "apart", apart);
  if (seen !== null) put(seen > LARGEST ? "seen beyond" : "seen", seen);
  return node;
}
