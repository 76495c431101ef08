// The selected dataset: recordings, conditions or values over time, and its runs and diagnoses.

import { get, part, postJson } from "../base/api.js";
import { $, el, plain, plural, significant, size, toast, when } from "../base/format.js";
import { showNotes } from "../lists/edit.js";
import { showDrawing } from "../parts/drawing.js";
import { setUpSimulation, showSimulation } from "../parts/driving.js";
import { hideSeries, redrawSeries, seriesRecordings, setUpSeries, showSeries } from "../parts/series.js";
import { badge, runName } from "../parts/sidebar.js";
import { showWarnings } from "../parts/warnings.js";
import { axis, draw } from "../base/plots.js";
import { randomKey, remove } from "./submit.js";
import { isForces, isSeries, misfit } from "../base/labels.js";

const LISTED = 10;
const WAYS = [
  ["phase_lag_deg", "phase lag, deg"], ["pressure_mbar", "pressure, mbar"], ["airspeed_m_s", "airspeed, m/s"],
  ["angle_of_attack_deg", "angle of attack, deg"],
];

let dataset = null;
let hooks = {};
let simulating = null; // id of the dataset whose ways to simulate are to be shown

export function setUpDataset(given) {
  hooks = given;
  setUpSeries();
  setUpSimulation(async (kind, rig) => {
    const body = { dataset_id: dataset.id, rig };
    hooks.onStarted(kind, await postJson(kind, body, { "Idempotency-Key": randomKey() }));
  });
  $("dataset-run").addEventListener("click", () => hooks.onRun(dataset));
  $("dataset-diagnose").addEventListener("click", () => hooks.onDiagnose(dataset));
  $("dataset-delete").addEventListener("click", async () => {
    if (await remove("datasets", dataset.id, dataset.name)) hooks.onDeleted();
  });
}

export async function selectDataset(id) {
  dataset = null;
  $("dataset").hidden = true;
  hideSeries();
  if (simulating !== id) simulating = null;
  if (!id) return;
  try {
    const found = await get(`datasets/${part(id)}`);
    if (hooks.currentId() !== id) return;
    dataset = found;
  } catch (error) {
    if (hooks.currentId() === id) hooks.onMissing(error, () => !dataset && selectDataset(id));
    return;
  }
  $("dataset").hidden = false;
  drawHead();
  showWarnings(dataset);
  drawRecordings();
  const series = isSeries(dataset);
  $("series-part").hidden = !series;
  $("conditions-part").hidden = series;
  $("drawing-part").hidden = series;
  await Promise.all([...(series ? [showRig()] : [drawConditions(), showDrawing(dataset)]), listWork(id)]);
}

async function showRig() {
  const { id } = dataset;
  await Promise.all([showSimulation(dataset), showSeries(dataset)]);
  if (simulating === id && dataset?.id === id) reveal(); // after the charts, which move what is below them
}

// Show how a dataset of series is simulated and diagnosed, on its page.
export function simulate(id) {
  simulating = id;
  if (dataset?.id === id) reveal();
  else location.hash = `dataset=${part(id)}`;
}

function reveal() {
  simulating = null;
  $("simulate-title").scrollIntoView({ block: "start" });
  $("simulate-title").focus({ preventScroll: true });
}

function drawHead() {
  document.title = `${dataset.name} · wingfit`;
  $("dataset-name").textContent = dataset.name;
  const held = { tracks: () => [plural(dataset.markers, "tracked marker")], forces: () => ["forces"],
    series: () => [`series of rig ${dataset.rig.name}`, plural(dataset.rig.channels.length, "channel")] }[dataset.kind]();
  showNotes($("dataset-name"), "datasets", dataset, (changed) => {
    dataset = changed;
    drawHead();
  });
  $("dataset-about").textContent = [...held,
    plural(dataset.recordings.length, "recording"), size(dataset.size_bytes), when(dataset.created_at)].join(" · ");
  $("dataset-description").textContent = dataset.description;
  $("dataset-sha").textContent = `SHA-256 of the archive: ${dataset.sha256}`;
  $("dataset-archive").href = `v1/datasets/${part(dataset.id)}/archive`;
}

function drawRecordings() {
  if (isSeries(dataset)) {
    const { head, rows } = seriesRecordings(dataset);
    $("recordings").tHead.replaceChildren(head);
    $("recordings").tBodies[0].replaceChildren(...rows);
    return;
  }
  const forces = isForces(dataset);
  const heads = ["Recording", "Use", forces ? "Samples" : "Frames", forces ? "Channels" : "Markers", "Missing, %", "Flap, Hz", "Lag, °", "Pressure, mbar",
    "Temperature, °C", "Airspeed, m/s", "Angle of attack, °"];
  const text = new Set(["Recording", "Use", "Channels"]);
  $("recordings").tHead.replaceChildren(el("tr", {}, ...heads.map((head) => el("th", { scope: "col", className: text.has(head) ? "" : "n" }, head))));
  const number = (value) => el("td", { className: "n" }, significant(value));
  const count = (value) => el("td", { className: "n" }, value.toLocaleString("en"));
  $("recordings").tBodies[0].replaceChildren(...dataset.recordings.map((one) => el("tr", {},
    el("td", {}, one.name), el("td", {}, el("span", { className: one.held_out ? "badge held" : "badge" }, one.held_out ? "held out" : "to fit")),
    count(one.frames), forces ? el("td", {}, one.channels.map((name) => name.replace("force_", "")).join(", ")) : count(one.markers),
    number(one.missing_percent), number(one.flap_frequency_hz), number(one.phase_lag_deg), number(one.pressure_mbar),
    number(one.temperature_c), number(one.airspeed_m_s), number(one.angle_of_attack_deg))));
}

export function redrawDataset() {
  if (!dataset) return;
  if (isSeries(dataset)) redrawSeries();
  else drawConditions();
}

// Chart of the conditions: flap frequency against the other quantity with the most values.
async function drawConditions() {
  const shown = dataset;
  const varied = WAYS.map(([name, title]) => ({ name, title, count: new Set(shown.recordings.map((one) => one[name])).size }));
  const { name, title } = varied.reduce((most, one) => (one.count > most.count ? one : most));
  const dots = (look, held, label, symbol) => {
    const those = shown.recordings.filter((one) => one.held_out === held);
    return {
      type: "scatter", mode: "markers", name: label, x: those.map((one) => one.flap_frequency_hz), y: those.map((one) => one[name]),
      text: those.map((one) => plain(one.name)), marker: { size: 11, symbol, color: held ? look.series[1] : look.accent, line: { width: 2 } },
      hovertemplate: `%{text}<br>%{x:.4g} Hz, ${title} %{y:.4g}<extra>${label}</extra>`,
    };
  };
  await draw($("conditions"), (look) => ({
    traces: [dots(look, false, "to fit", "circle"), dots(look, true, "held out", "circle-open")],
    showlegend: true, xaxis: axis(look, "flap frequency, Hz"), yaxis: axis(look, title),
  })).catch((error) => toast(error.message));
}

async function listWork(id) {
  const show = async (kind, page, text) => {
    const list = $(`dataset-${kind}`);
    list.replaceChildren();
    const found = await get(`${kind}?dataset_id=${part(id)}&limit=${LISTED}`);
    if (hooks.currentId() !== id) return;
    const items = found.items.map((job) => el("li", {}, el("a", { href: `#${page}=${part(job.id)}` }, ...text(job))));
    if (found.next_cursor) items.push(el("li", {}, el("a", { href: `#${kind}&dataset_id=${part(id)}` }, "Show all")));
    list.replaceChildren(...(items.length ? items : [el("li", { className: "quiet" }, "None yet.")]));
  };
  await Promise.all([
    show("runs", "run", (run) => [runName(run), " ", badge(run), ` ${misfit(run).value} ${misfit(run).unit}`]),
    show("diagnoses", "diagnosis", (one) => [one.name, " ", badge(one), ` ${one.verdict ?? ""}`]),
  ]).catch((error) => toast(error.message));
}
