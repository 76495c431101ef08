// Agreement of each model with each recording: RMS difference, correlation, averages over the beat.

import { $, correlation, el, forceUnit, rounded } from "../base/format.js";
import { QUANTITIES, SOURCES } from "../base/labels.js";

const columns = ({ unit, show }) => [
  [unit, (a) => show(a.rmse_n)], ["%", (a) => rounded(a.rmse_percent)], ["r", (a) => correlation(a.correlation)],
];

const number = (text, first = false) => el("td", { className: first ? "n first" : "n" }, text);

export function fillQuantities(result) {
  const there = new Set(result.agreements.map((agreement) => agreement.quantity));
  $("agreement-quantity").replaceChildren(
    ...Object.keys(QUANTITIES).filter((name) => there.has(name)).map((name) => new Option(QUANTITIES[name], name)));
}

// Agreements of a quantity as recording -> model -> agreement; the global model fitted without the recording is a model too.
function byRecording(result, quantity) {
  const all = [...result.agreements, ...result.leave_one_out.map((agreement) => ({ ...agreement, source: "leave_one_out" }))];
  const found = new Map();
  for (const agreement of all.filter((one) => one.quantity === quantity)) {
    if (!found.has(agreement.recording)) found.set(agreement.recording, {});
    found.get(agreement.recording)[agreement.source] = agreement;
  }
  return found;
}

export function drawAgreement(result, dataset, quantity) {
  const found = byRecording(result, quantity);
  const models = Object.keys(SOURCES).filter((name) => [...found.values()].some((row) => name in row));
  const fitted = new Set(result.estimates.flatMap((estimate) => estimate.recordings));
  const recordings = dataset.recordings.filter((recording) => found.has(recording.name));
  const rows = recordings.map((recording) => ({ name: recording.name, use: use(recording, fitted), by: found.get(recording.name) }));
  drawDifferences(rows, models, rows.filter((row) => fitted.has(row.name)));
  drawAverages(rows, models);
  $("agreement-note").textContent = "RMS difference over all samples of the whole beats, in the unit of force and in per cent of the range of the recorded mean beat; "
    + "r: correlation."
    + (models.includes("leave_one_out") ? " Left out: the global model fitted without the recording." : "");
}

function use(recording, fitted) {
  if (fitted.has(recording.name)) return null;
  return el("span", { className: recording.held_out ? "badge held" : "badge" }, recording.held_out ? "held out" : "not fitted");
}

const nameCell = (row) => el("th", { scope: "row" }, row.name, row.use ? " " : null, row.use?.cloneNode(true));

function drawDifferences(rows, models, fitted) {
  const shown = columns(forceUnit(rows.flatMap((row) => models.map((name) => row.by[name]?.rmse_n))));
  $("agreement").tHead.replaceChildren(
    el("tr", { className: "groups" }, el("td"), ...models.map((name) => el("th", { colSpan: shown.length, scope: "colgroup", className: "n first" }, SOURCES[name]))),
    el("tr", {}, el("th", {}, "Recording"), ...models.flatMap(() => shown.map(([title], k) => el("th", { className: k ? "n" : "n first" }, title)))));
  const cells = (by) => models.flatMap((name) => shown.map(([, show], k) => number(by[name] ? show(by[name]) : "–", k === 0)));
  const body = rows.map((row) => el("tr", {}, nameCell(row), ...cells(row.by)));
  if (fitted.length > 1) {
    const means = Object.fromEntries(models.map((name) => [name, meanOf(fitted.map((row) => row.by[name]))]));
    body.push(el("tr", { className: "total" }, el("th", { scope: "row" }, "Mean, fitted"), ...cells(means)));
  }
  $("agreement").tBodies[0].replaceChildren(...body);
}

function meanOf(agreements) {
  const mean = (key) => {
    const known = agreements.map((one) => one?.[key]).filter((value) => value !== null && value !== undefined);
    return known.length ? known.reduce((sum, value) => sum + value, 0) / known.length : null;
  };
  return { rmse_n: mean("rmse_n"), rmse_percent: mean("rmse_percent"), correlation: mean("correlation") };
}

function drawAverages(rows, models) {
  const means = (row) => [Object.values(row.by)[0].mean_recorded_n, ...models.map((name) => row.by[name]?.mean_modelled_n)];
  const { unit, show } = forceUnit(rows.flatMap(means));
  $("averages-title").textContent = `Average over the beat, ${unit}`;
  $("averages").tHead.replaceChildren(el("tr", {}, el("th", {}, "Recording"), el("th", { className: "n" }, "Recorded"),
    ...models.map((name) => el("th", { className: "n" }, SOURCES[name]))));
  $("averages").tBodies[0].replaceChildren(...rows.map((row) => el("tr", {}, nameCell(row),
    ...means(row).map((value) => number(show(value))))));
}
