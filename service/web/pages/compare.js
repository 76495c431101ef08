// Comparison of runs (#compare=ID,ID): settings, convergence, results.

import { get, history, part } from "../base/api.js";
import { $, DASH, duration, el, rounded, plain, significant, toast } from "../base/format.js";
import { badge, runName } from "../parts/sidebar.js";
import { MOST_COMPARED } from "../lists/table.js";
import { axis, draw } from "../base/plots.js";
import { isSeries, OF_RANGE, relativeMisfit, request, spoken } from "../base/labels.js";

let shown = [];
let requested = "";

export function setUpCompare() {
  $("compare-all").addEventListener("change", drawSetup);
}

export async function showComparison(ids, { onMissing }) {
  requested = ids ?? "";
  $("comparison").hidden = true;
  if (!ids) return;
  document.title = "Comparison · wingfit";
  const wanted = [...new Set(ids.split(",").filter(Boolean))].slice(0, MOST_COMPARED);
  try {
    const found = await Promise.all(wanted.map(loaded));
    if (requested !== ids) return;
    shown = found;
  } catch (error) {
    if (requested === ids) onMissing(error, () => requested === ids && showComparison(ids, { onMissing }));
    return;
  }
  $("comparison").hidden = false;
  drawOutcome();
  drawSetup();
  drawRecordings();
  drawGenes();
  await redrawComparison();
}

async function loaded(id) {
  const run = await get(`runs/${part(id)}`);
  const dataset = await get(`datasets/${part(run.dataset_id)}`);
  const past = await history(id);
  const result = run.state === "SUCCEEDED" ? await get(`runs/${part(id)}/result`) : null;
  const genome = result ?? (run.generations ? await get(`runs/${part(id)}/genome`) : { genes: [] });
  return { run, dataset, past, result, genes: genome.genes };
}

const swatch = (k) => {
  const mark = el("i", { className: "swatch", ariaHidden: "true" });
  mark.style.background = `var(--series-${k + 1})`;
  return mark;
};
const heading = ({ run }, k) => el("th", { scope: "col", className: "n" }, swatch(k), runName(run));
const number = (text) => el("td", { className: "n" }, text);
const head = (id, ...cells) => $(id).tHead.replaceChildren(el("tr", {}, ...cells));
const body = (id, rows) => $(id).tBodies[0].replaceChildren(...rows);

// By kind of run: the names of its misfits in results and histories, and how it is drawn. A page may have several kinds.
const KINDS = {
  tracks: { suffix: "_mm", unit: "mm", axis: "mean distance per marker, mm", runs: "runs on tracked markers" },
  forces: { suffix: "_mn", unit: "mN", axis: "RMS difference, mN", runs: "runs on forces" },
  series: { suffix: "_percent", unit: OF_RANGE, axis: `RMS difference, ${OF_RANGE}`, runs: "runs on series" },
};
// The kind of the convergence chart.
const drawn = () => ["forces", "series", "tracks"].find((kind) => shown.some(({ run }) => run.kind === kind));

const withUnit = (value, unit) => (value === null || value === undefined ? DASH : `${rounded(value, 3)} ${unit}`);

// A misfit of a result with its unit; ``key``: before, after, held_out_before, held_out_after, noise.
function outcome(run, result, key) {
  if (!result) return DASH;
  if (!isSeries(run)) return withUnit(result[`${key}${KINDS[run.kind].suffix}`], KINDS[run.kind].unit);
  const { value, unit } = relativeMisfit(result, result[key] ?? null);
  return value === DASH ? DASH : `${value} ${unit}`;
}

function drawOutcome() {
  const floors = shown.some(({ run }) => run.kind === "tracks");
  const heads = ["Run", "Dataset", "State", "Before", "After", "Before, held out", "After, held out", ...(floors ? ["Noise floor"] : []), "Evaluations", "Computing time"];
  head("compare-outcome", ...heads.map((text, i) => el("th", { scope: "col", className: i > 2 ? "n" : "" }, text)));
  body("compare-outcome", shown.map(({ run, dataset, result, past }, k) => {
    const { suffix, unit } = KINDS[run.kind];
    const of = (key) => number(outcome(run, result, key));
    return el("tr", {}, el("td", {}, swatch(k), el("a", { href: `#run=${part(run.id)}` }, runName(run))),
      el("td", {}, el("a", { href: `#dataset=${part(dataset.id)}` }, dataset.name)), el("td", {}, badge(run)),
      of("before"), result ? of("after") : number(withUnit(run[`best${suffix}`], unit)), of("held_out_before"), of("held_out_after"),
      ...(floors ? [of("noise")] : []), number(run.evaluations.toLocaleString("en")), number(duration(past.at(-1)?.elapsed_seconds) ?? DASH));
  }));
  const datasets = new Set(shown.map(({ dataset }) => dataset.id));
  const kinds = new Set(shown.map(({ run }) => run.kind));
  $("compare-note").textContent = [
    datasets.size > 1 ? "These runs are fitted to different datasets: their misfits are not comparable." : null,
    kinds.size > 1 ? `The convergence chart shows only the ${KINDS[drawn()].runs}.` : null,
  ].filter(Boolean).join(" ");
}

function drawSetup() {
  const specs = shown.map(({ run }) => ({ ...request(run) }));
  const names = [...new Set(specs.flatMap(Object.keys))];
  const text = (value, k) => {
    if (value === undefined || value === null) return DASH;
    return Array.isArray(value) ? value.map((one) => (isSeries(shown[k].run) ? one : spoken(String(one)))).join(", ") || "none" : String(value);
  };
  const rows = names.map((name) => ({ name, values: specs.map((spec, k) => text(spec[name], k)) }));
  const visible = rows.filter(({ values }) => $("compare-all").checked || new Set(values).size > 1);
  head("compare-setup", el("th", { scope: "col" }, "Setting"), ...shown.map(heading));
  body("compare-setup", visible.map(({ name, values }) => el("tr", {}, el("th", { scope: "row" }, spoken(name)), ...values.map(number))));
  $("compare-setup").hidden = !visible.length;
  $("compare-same").hidden = visible.length > 0;
}

function drawRecordings() {
  const kinds = new Set(shown.flatMap(({ result }) => result?.kind ?? []).filter((kind) => kind !== "forces"));
  $("compare-recordings-part").hidden = !kinds.size;
  $("compare-recordings-title").textContent = `${kinds.has("series") ? "Misfit" : "Distance per marker"} by recording, after`;
  const all = shown.map(({ run, result }) => new Map((kinds.has(result?.kind) ? result.recordings : []).map((one) => [one.name, {
    value: isSeries(run) ? one.after : one.after_mm, text: outcome(run, { ...result, ...one }, "after"), heldOut: one.held_out,
  }])));
  const names = [...new Set(all.flatMap((those) => [...those.keys()]))];
  head("compare-recordings", el("th", { scope: "col" }, "Recording"), ...shown.map(heading));
  body("compare-recordings", names.map((name) => {
    const values = all.map((those) => those.get(name));
    const best = kinds.size > 1 ? null : Math.min(...values.map((one) => one?.value ?? Infinity));
    return el("tr", {}, el("th", { scope: "row" }, name), ...values.map((one) => el("td", { className: one && one.value === best ? "n least" : "n" },
      one?.text ?? DASH, one?.heldOut ? el("small", {}, " held out") : null)));
  }));
}

function drawGenes() {
  const genes = new Map(shown.flatMap((one) => one.genes.map((gene) => [gene.name, gene])));
  $("compare-genes-part").hidden = !genes.size;
  head("compare-genes", el("th", { scope: "col" }, "Gene"), el("th", { scope: "col" }, "Unit"), el("th", { scope: "col", className: "n" }, "Nominal"), ...shown.map(heading));
  body("compare-genes", [...genes.values()].map((gene) => el("tr", {}, el("th", { scope: "row" }, el("abbr", { title: gene.description }, gene.name)),
    el("td", {}, gene.unit === "1" ? "" : gene.unit), number(significant(gene.nominal)), ...shown.map((one) => geneCell(one.genes.find((own) => own.name === gene.name))))));
}

function geneCell(gene) {
  if (!gene) return number(DASH);
  const { standard_error_percent: percent, standard_error: absolute } = gene;
  const error = percent === null ? "" : gene.nominal === 0 && absolute ? ` ± ${significant(absolute, 2)}` : ` ± ${significant(percent, 2)} %`;
  const about = !gene.searched ? " fixed" : gene.identifiable === false ? " not identifiable" : error;
  return el("td", { className: "n" }, significant(gene.best), el("small", {}, about));
}

// Best misfit so far against the number of simulated individuals.
export async function redrawComparison() {
  if ($("comparison").hidden) return;
  const kind = drawn();
  const { suffix, unit, axis: title } = KINDS[kind];
  const curves = shown.map((one, k) => ({ ...one, k })).filter(({ run }) => run.kind === kind);
  await draw($("compare-plot"), (look) => ({
    traces: curves.map(({ run, past, k }) => ({
      type: "scatter", mode: past.length < 3 ? "lines+markers" : "lines", name: plain(runName(run)), x: past.map((item) => item.evaluations),
      y: past.map((item) => item[`best${suffix}`]), text: past.map((item) => plain(item.stage)), line: { color: look.series[k], width: 2 },
      hovertemplate: `%{y:.4g} ${unit}, %{text}<extra>%{fullData.name}</extra>`,
    })),
    showlegend: true, xaxis: axis(look, "simulated individuals", { showgrid: false }),
    yaxis: axis(look, title, { type: "log", nticks: 6 }),
  })).catch((error) => toast(error.message));
}
