// Tables of a run: key numbers, misfit by recording, genes.

import { $, DASH, el, forceUnit, keyNumber, rounded, mm, plural, significant } from "../base/format.js";
import { misfit, newtons, relativeMisfit } from "../base/labels.js";

export function drawNumbers(run, result) {
  const { value, unit } = misfit(run);
  const what = run.kind === "tracks" ? "best so far, mean distance per marker" : "best so far, RMS difference";
  const cells = result ? OUTCOMES[run.kind](result) : [
    keyNumber(what, value, unit, true),
    keyNumber("stage", run.stage ?? "–"),
    keyNumber("generations", String(run.generations)),
    keyNumber("evaluations", run.evaluations.toLocaleString("en")),
  ];
  $("numbers").replaceChildren(...cells);
}

function outcome(result) {
  const cells = [
    keyNumber("before, fitted recordings", mm(result.before_mm), "mm"),
    keyNumber("after, fitted recordings", mm(result.after_mm), "mm", true),
  ];
  if (result.held_out_after_mm !== null) {
    cells.push(keyNumber("before, held out", mm(result.held_out_before_mm), "mm"));
    cells.push(keyNumber("after, held out", mm(result.held_out_after_mm), "mm", true));
  }
  if (result.noise_mm) {
    cells.push(keyNumber("floor: tracking noise alone", mm(result.noise_mm), "mm"));
  }
  return cells;
}

function forceOutcome(result) {
  const [before, after, heldBefore, heldAfter] = ["before_mn", "after_mn", "held_out_before_mn", "held_out_after_mn"]
    .map((key) => newtons(result[key]));
  const { unit, show } = forceUnit([before, after, heldBefore, heldAfter]);
  const cells = [
    keyNumber("before, RMS of the fitted forces", show(before), unit),
    keyNumber("after, RMS of the fitted forces", show(after), unit, true),
  ];
  if (heldAfter !== null) {
    cells.push(keyNumber("before, held out", show(heldBefore), unit));
    cells.push(keyNumber("after, held out, predicted", show(heldAfter), unit, true));
  }
  if (result.noise_mn) cells.push(keyNumber("noise: differs from beat to beat", show(newtons(result.noise_mn)), unit));
  return cells;
}

function seriesOutcome(result) {
  const number = (label, value, main = false) => {
    const shown = relativeMisfit(result, value);
    return keyNumber(label, shown.value, shown.unit, main);
  };
  return [
    number("before, RMS of the fitted recordings", result.before), number("after, RMS of the fitted recordings", result.after, true),
    ...(result.held_out_after === null ? []
      : [number("before, held out", result.held_out_before), number("after, held out, predicted", result.held_out_after, true)]),
  ];
}

const OUTCOMES = { tracks: outcome, forces: forceOutcome, series: seriesOutcome };

// Bars of the values before and after, as fractions of the widest bar; dotted, unless it is null, the floor.
function twin(before, after, floor) {
  const percent = (fraction) => `${100 * (fraction || 0)}%`;
  const bars = el("div", { className: "twin", ariaHidden: "true" }, el("i"), el("i"));
  [before, after].forEach((value, i) => { bars.children[i].style.width = percent(value); });
  if (floor) {
    const line = el("span", { className: "floor" });
    line.style.left = percent(floor);
    bars.append(line);
  }
  return bars;
}

const use = (recording, fitted) => el("span", { className: recording.held_out ? "badge held" : "badge" },
  recording.held_out ? "held out" : fitted ? "fitted" : "not fitted");

export function drawMisfit(result) {
  $("misfit-section").hidden = !result;
  if (!result) return;
  const all = result.recordings.flatMap((r) => [r.before_mm, r.after_mm]).filter((value) => value !== null);
  const largest = Math.max(...all, result.noise_mm ?? 0) || 1;
  const bars = (before, after) => twin(before / largest, after / largest, result.noise_mm / largest);
  const row = (name, badge, before, after, className = "") => el("tr", { className },
    el("td", {}, name), el("td", {}, badge), el("td", { className: "n" }, mm(before)),
    el("td", { className: "n" }, mm(after)), el("td", { className: "wide" }, bars(before, after)));
  const rows = result.recordings.map((r) => row(r.name, use(r, r.stage !== null), r.before_mm, r.after_mm));
  rows.push(row("All fitted", "", result.before_mm, result.after_mm, "total"));
  if (result.held_out_after_mm !== null) {
    rows.push(row("All held out", "", result.held_out_before_mm, result.held_out_after_mm, "total"));
  }
  $("misfit").tBodies[0].replaceChildren(...rows);
  $("misfit-note").textContent = "Grey: nominal genome. Coloured: best genome."
    + (result.noise_mm ? ` Dotted: expected from tracking noise alone, ${mm(result.noise_mm)} mm.` : "")
    + result.remarks.map((remark) => ` Note: ${remark}.`).join("");
}

// A row for each channel of each recording, in the unit of the channel.
export function drawSeriesMisfit(result) {
  $("series-misfit-section").hidden = !result;
  if (!result) return;
  const largest = new Map();
  for (const { name, before, after, noise } of result.recordings.flatMap((one) => one.channels)) {
    largest.set(name, Math.max(largest.get(name) ?? 0, before ?? 0, after ?? 0, noise ?? 0));
  }
  const number = (text) => el("td", { className: "n" }, text);
  $("series-misfit").tBodies[0].replaceChildren(...result.recordings.flatMap((recording) => recording.channels.map((channel, k) => {
    const { name, unit, before, after, noise, samples } = channel;
    const top = largest.get(name) || 1;
    const first = k ? [] : [el("th", { scope: "rowgroup", rowSpan: recording.channels.length }, recording.name),
      el("td", { rowSpan: recording.channels.length }, use(recording, recording.fitted))];
    return el("tr", {}, ...first, el("td", { title: plural(samples, "sample") }, name), number(rounded(before)), number(rounded(after)), number(rounded(noise)),
      el("td", {}, unit === "1" ? DASH : unit), el("td", { className: "wide" }, twin(before / top, after / top, noise / top)));
  })));
  const relative = result.relative_to === "noise" ? "the standard deviation of its noise" : "its range, because the noise of some channel is not known";
  $("series-misfit-note").textContent = "Root mean square of the differences. Grey: nominal genome. Coloured: best genome. Dotted: noise of one sample, from repeats or periods where there are some, else as stated or from the highest frequencies. "
    + `The numbers at the top are relative: each channel is divided by ${relative}.`;
}

// ``means``: for a finished run on forces, whose values are the means of its estimates.
export function drawGenes(genome, means = false) {
  $("genes-section").hidden = !genome;
  if (!genome) return;
  $("genes-title").textContent = means ? "All genes of the model" : "Best genome";
  $("genes-best").textContent = means ? "Mean of the estimates" : "Best";
  $("genes").tBodies[0].replaceChildren(...genome.genes.map(geneRow));
  const searched = genome.genes.filter((gene) => gene.searched);
  const known = searched.filter((gene) => gene.identifiable);
  const note = genome.final
    ? `${known.length} of ${plural(searched.length, "estimated gene")} are identifiable; hollow dots: not identifiable.`
    : "Best so far; identifiability is computed at the end.";
  $("genes-note").textContent = `${note} Bars are 95 % intervals; the grey tick is the nominal value.`;
}

function geneRow(gene) {
  const vague = gene.searched && gene.identifiable === false;
  return el("tr", { className: gene.searched ? (vague ? "vague" : "") : "off" },
    el("td", {}, gene.name), el("td", { className: "n" }, significant(gene.nominal)),
    el("td", { className: "n" }, significant(gene.best)), el("td", {}, gene.unit === "1" ? "" : gene.unit),
    el("td", { className: "wide" }, boundsBar(gene)), el("td", {}, identifiable(gene)),
    el("td", { className: "prose" }, el("small", {}, gene.description)));
}

function boundsBar(gene) {
  const bar = el("div", { className: "span", title: `${significant(gene.lower)} to ${significant(gene.upper)} ${gene.unit}` });
  const place = (tag, value) => {
    const mark = el(tag);
    mark.style.left = `${100 * inBounds(gene, value)}%`;
    bar.append(mark);
  };
  place("i", gene.nominal);
  if (gene.standard_error) {
    const [low, high] = [-1, 1].map((sign) => inBounds(gene, gene.best + sign * INTERVAL_95 * gene.standard_error));
    const whisker = el("u", { title: "95 % interval" });
    whisker.style.left = `${100 * low}%`;
    whisker.style.width = `${100 * (high - low)}%`;
    bar.append(whisker);
  }
  if (gene.searched) place("b", gene.best);
  return bar;
}

// Wide bounds are searched, and drawn, on a logarithmic scale.
function position({ lower, upper }, value) {
  const f = lower > 0 && upper / lower > 4 ? Math.log : (x) => x;
  return (f(value) - f(lower)) / (f(upper) - f(lower));
}

// A value below the bounds can be negative, which has no place on a logarithmic scale.
function inBounds(gene, value) {
  return Math.min(1, Math.max(0, position(gene, Math.max(value, gene.lower))));
}

const INTERVAL_95 = 1.96; // standard errors on either side
const SIGNIFICANT = 2; // standard errors from which a value differs from zero, as on the command line (cli/results.py)

function identifiable(gene) {
  if (!gene.searched) return "not estimated";
  if (gene.identifiable === null) return "computed at the end";
  const absolute = gene.nominal === 0 ? gene.standard_error ?? null : null;
  const percent = gene.standard_error_percent === null ? "" : `, ± ${rounded(gene.standard_error_percent, 2)} %`;
  if (absolute === null) return `${gene.identifiable ? "yes" : "no"}${percent}`;
  const word = Math.abs(gene.best) < SIGNIFICANT * absolute ? "not different from zero" : gene.identifiable ? "yes" : "no";
  return `${word}, ± ${significant(absolute, 2)} ${gene.unit === "1" ? "" : gene.unit}`.trim();
}
