// Coefficients: by condition with their intervals, their correlation, and the global model drawn through them.

import { $, el, fixed, rounded, plain, plural, significant } from "../base/format.js";
import { axis, draw } from "../base/plots.js";
import { fillCorrelations, STRONG, strongPairs } from "../base/correlations.js";

const names = (result) => result.estimates[0].coefficients.map((coefficient) => coefficient.name);

// Estimates with the recording they rest on; null for an estimate on several recordings.
function conditions(result, dataset) {
  const found = new Map(dataset.recordings.map((recording) => [recording.name, recording]));
  return result.estimates.map((estimate) => ({
    estimate, recording: estimate.recordings.length === 1 ? found.get(estimate.recordings[0]) ?? null : null,
  }));
}

export function drawEstimates(result, dataset) {
  const rows = conditions(result, dataset);
  const alone = rows.filter((row) => row.recording);
  drawTable(result, rows);
  drawLaw(result.global_model);
  $("estimates-note").textContent = `Values with their 90 % intervals, from ${plural(result.estimates.length, "maximum-likelihood estimate")}`
    + `; the intervals are Cramér-Rao bounds that account for coloured residuals.`
    + (result.global_model ? " Line in the figures: the global model, the other variable at its mean; crosses: the global model at each condition." : "");
  $("coefficient-plots").hidden = alone.length < 2;
  if (alone.length < 2) return;
  const axes = { "by-frequency": ["flap_frequency_hz", "angle_of_attack_deg", "flap frequency, Hz"],
    "by-pitch": ["angle_of_attack_deg", "flap_frequency_hz", "body pitch, deg"] };
  for (const [id, [over, other, title]] of Object.entries(axes)) {
    draw($(id), (look) => chart(look, result, alone, { over, other, title })).catch((error) => { $("estimates-note").textContent = error.message; });
  }
}

function drawTable(result, rows) {
  const genes = names(result);
  $("estimates").tHead.replaceChildren(el("tr", {}, el("th", {}, "Estimate"), el("th", { className: "n" }, "Flap, Hz"),
    el("th", { className: "n" }, "Pitch, deg"), ...genes.map((gene) => el("th", { className: "n" }, gene)), el("th", {}, "Converged")));
  $("estimates").tBodies[0].replaceChildren(...rows.map(({ estimate, recording }) => el("tr", {},
    el("td", { title: estimate.recordings.join(", ") }, estimate.name),
    el("td", { className: "n" }, significant(recording?.flap_frequency_hz)),
    el("td", { className: "n" }, significant(recording?.angle_of_attack_deg)),
    ...estimate.coefficients.map(valueCell), el("td", {}, estimate.converged ? "yes" : "no"))));
}

function valueCell(coefficient) {
  const low = coefficient.low_90;
  const interval = low === null ? "not identifiable" : `${fixed(low, 3)} to ${fixed(coefficient.high_90, 3)}`;
  return el("td", { className: "n" }, fixed(coefficient.value, 3), el("small", {}, ` ${interval}`));
}

function drawLaw(law) {
  $("law-part").hidden = !law;
  if (!law) return;
  const error = (value) => (value === null ? "–" : `${rounded(value, 2)} %`);
  $("law").tBodies[0].replaceChildren(...law.genes.map((gene) => el("tr", {}, el("td", {}, gene.name),
    ...[gene.constant, gene.per_hz, gene.per_deg].map((value) => el("td", { className: "n" }, value === 0 ? "–" : significant(value, 3))),
    el("td", { className: "n" }, error(gene.largest_error_percent)), el("td", { className: "n" }, error(gene.leave_one_out_error_percent)))));
  const range = ([low, high], unit) => `${significant(low)} to ${significant(high)} ${unit}`;
  $("law-note").textContent = `Fitted to ${plural(law.recordings.length, "recording")}, ${range(law.frequency_range_hz, "Hz")} and `
    + `${range(law.pitch_range_deg, "deg")}. Largest error: largest difference from a local estimate. Error when left out: the same for estimates left out of the fit.`;
}

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

function chart(look, result, rows, { over, other, title }) {
  const genes = names(result);
  const x = rows.map((row) => row.recording[over]);
  const ends = [Math.min(...x), Math.max(...x)];
  const middle = mean(rows.map((row) => row.recording[other]));
  const traces = [];
  const axes = {};
  genes.forEach((gene, k) => {
    const suffix = k ? k + 1 : "";
    const common = { type: "scatter", xaxis: "x", yaxis: `y${suffix}`, showlegend: k === 0 };
    const law = result.global_model?.genes.find((one) => one.name === gene);
    const at = (value, rest) => law.constant + (over === "flap_frequency_hz"
      ? law.per_hz * value + law.per_deg * rest : law.per_hz * rest + law.per_deg * value);
    if (law) {
      traces.push(
        { ...common, x: ends, y: ends.map((value) => at(value, middle)), mode: "lines", name: "global, other variable at its mean",
          line: { color: look.series[1], width: 1.5, dash: "dot" }, hoverinfo: "skip", showlegend: false },
        { ...common, x, y: rows.map((row) => at(row.recording[over], row.recording[other])), mode: "markers", name: "global model",
          marker: { color: look.series[1], symbol: "x-thin", size: 9, line: { color: look.series[1], width: 2 } },
          text: rows.map((row) => plain(row.estimate.name)), hovertemplate: `%{text}: ${gene} %{y:.3f}<extra>global</extra>` },
      );
    }
    const found = rows.map((row) => row.estimate.coefficients[k]);
    traces.push({ ...common, x, y: found.map((one) => one.value), mode: "markers", name: "estimate, 90 % interval",
      marker: { color: look.accent, size: 8 },
      error_y: { type: "data", symmetric: false, color: look.accent, thickness: 1.5, width: 4,
        array: found.map((one) => (one.high_90 === null ? 0 : one.high_90 - one.value)),
        arrayminus: found.map((one) => (one.low_90 === null ? 0 : one.value - one.low_90)) },
      text: rows.map((row) => plain(row.estimate.name)), hovertemplate: `%{text}: ${gene} %{y:.3f}<extra>estimate</extra>` });
    const height = 1 / genes.length;
    axes[`yaxis${suffix}`] = axis(look, gene, { domain: [1 - (k + 1) * height + 0.03, 1 - k * height - 0.02], nticks: 4 });
  });
  const xaxis = axis(look, title, { showgrid: false, anchor: `y${genes.length > 1 ? genes.length : ""}` });
  return { traces, showlegend: true, ...axes, xaxis };
}

export function fillEstimates(result) {
  $("estimate").replaceChildren(...result.estimates.map((estimate) => new Option(estimate.name, estimate.name)));
}

export function drawCorrelation(result, name) {
  const estimate = result.estimates.find((one) => one.name === name);
  const genes = estimate.coefficients.map((coefficient) => coefficient.name);
  fillCorrelations($("correlation"), genes, estimate.correlation);
  const strong = strongPairs(genes, estimate.correlation).map((pair) => `${pair.name} and ${pair.other}`);
  const noise = estimate.noise_mn2.map((matrix) => significant(Math.sqrt(matrix[0][0]), 3));
  const ofEach = noise.length > 1 ? noise.map((value, i) => `${estimate.recordings[i]} ${value}`).join(", ") : noise[0];
  $("correlation-note").textContent = [
    strong.length ? `Strongly correlated: ${strong.join("; ")}.` : `No two coefficients are correlated beyond ${STRONG}.`,
    `Standard deviation of the residuals of the first fitted force: ${ofEach} mN.`,
    ...estimate.remarks.map((remark) => `Note: ${remark}.`),
  ].join(" ");
}
