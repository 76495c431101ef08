// Predicted standard errors of the genes, as intervals about the value: what is uncertain is wide, and hollow.

import { $, DASH, el, rounded, significant } from "../base/format.js";

const INTERVAL_95 = 1.96; // standard errors on either side
const WIDEST = 100; // percent on either side that are drawn
const LEAST_OF_TARGET = 2; // times the target: it is always seen

const percent = (value) => `${rounded(value, 2)} %`;

export function drawGenes(plan) {
  const { genes, target_percent: target, beats, kind } = plan;
  const most = Math.max(...genes.map((gene) => INTERVAL_95 * gene.relative_percent));
  const half = Math.min(WIDEST, round(Math.max(LEAST_OF_TARGET * target, 1.1 * most)));
  const of = kind === "series" ? "repeats" : "beats";
  const heads = [["Gene"], ["", "wide"], ["Standard error", "n"], ["Value", "n"], [`For ${significant(target)} %, ${of}`, "n", `${of} of every recording from which the standard error is at most ${significant(target)} %; planned: ${significant(beats, 3)}`],
    ["Best recording alone", "n"], ["Most correlated with"]];
  const scale = el("div", { className: "plan-scale" }, el("span", {}, `−${half} %`), el("span", {}, "value"), el("span", {}, `+${half} %`));
  $("plan-genes").tHead.replaceChildren(el("tr", {}, ...heads.map(([text, className = "", title = ""], k) =>
    (k === 1 ? el("th", { scope: "col", className }, el("span", { className: "hidden" }, "Interval"), scale)
      : el("th", { scope: "col", className }, title ? el("abbr", { title }, text) : text)))));
  $("plan-genes").tBodies[0].replaceChildren(...genes.map((gene) => row(gene, half, target)));
  $("plan-genes-note").textContent = `Thick: one standard error on either side; thin: 95 %. A gene is identified where the thick bar lies within the band of ±${significant(target)} %; else it is hollow.`
    + (most > half ? ` An arrow: wider than ±${half} %.` : "") + (genes.some((gene) => !gene.beats_for_target) ? " A dash: no number of beats is enough, record something else." : "")
    + (genes.some(otherwise) ? " Per cent of a weight refer to its share of the sum of its group, those of a gene near zero to a part of its range." : "");
}

// Whether the relative error is not simply the standard error over the value.
const otherwise = ({ value, standard_error: error, relative_percent: relative }) => Math.abs(100 * error - relative * Math.abs(value)) > 0.05 * relative * Math.abs(value);

// The next of 1, 2, 5 times a power of ten.
function round(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((digit) => digit * power).find((value) => value >= least * (1 - 1e-9));
}

function row(gene, half, target) {
  const needed = gene.beats_for_target;
  return el("tr", { className: gene.identified ? "" : "vague" },
    el("th", { scope: "row" }, gene.name), el("td", { className: "wide" }, bar(gene, half, target)),
    el("td", { className: "n" }, el("strong", {}, `± ${percent(gene.relative_percent)}`)),
    el("td", { className: "n" }, inUnit(gene)),
    el("td", { className: "n" }, needed === null ? el("span", { title: "no number of beats is enough: record something else" }, DASH) : needed.toLocaleString("en")),
    el("td", { className: "n" }, `± ${percent(gene.alone_percent)}`),
    el("td", {}, gene.correlated_with === null ? DASH : `${gene.correlated_with} `, gene.correlated_with === null ? null : el("small", {}, `(${gene.correlation < 0 ? "−" : "+"}${Math.abs(gene.correlation).toFixed(2)})`)));
}

// Value and standard error with the same decimals and power of ten, in the unit of the gene: (6.000 ± 0.051)·10⁶ Pa.
function inUnit({ value, standard_error: error, unit }) {
  const larger = Math.max(Math.abs(value), error) || 1;
  const power = larger >= 1e5 || larger < 1e-2 ? Math.floor(Math.log10(larger)) : 0;
  const decimals = Math.min(8, Math.max(0, 1 - Math.floor(Math.log10(error / 10 ** power || 1))));
  const [shown, spread] = [value, error].map((one) => (one / 10 ** power).toFixed(decimals));
  const both = power ? `(${shown} ± ${spread})·${significant(10 ** power).replace(/^1·/, "")}` : `${shown} ± ${spread}`;
  return unit === "1" ? both : `${both} ${unit}`;
}

function bar(gene, half, target) {
  const error = gene.relative_percent;
  const words = `${gene.name}: standard error ${percent(error)}, ${gene.identified ? "identified" : "not identified"}`;
  const node = el("div", { className: "plan-span", role: "img", ariaLabel: words, title: words });
  const spread = (tag, size) => {
    const part = Math.min(1, size / half);
    const mark = el(tag, { className: size > half ? "beyond" : "" });
    mark.style.width = `${100 * part}%`;
    node.append(mark);
  };
  spread("s", target);
  spread("u", INTERVAL_95 * error);
  spread("b", error);
  return node;
}

