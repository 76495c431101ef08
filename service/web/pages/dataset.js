// The selected dataset: what was recorded, what the checks say, conditions, and its runs and diagnoses.

import { fill, get, isFinal, part, postJson } from "../base/api.js";
import { $, el, plural, size, toast, when } from "../base/format.js";
import { isSeries, misfit } from "../base/labels.js";
import { showChecks, showMarkerNoise } from "../dataset/checks.js";
import { hideForces, redrawForces, setUpForces, showForces } from "../dataset/forces.js";
import { drawConditions, listRecordings } from "../dataset/recordings.js";
import { hideTracks, redrawTracks, setUpTracks, showTracks } from "../dataset/tracks.js";
import { showNotes } from "../lists/edit.js";
import { showDrawing } from "../parts/drawing.js";
import { setUpSimulation, showSimulation } from "../parts/driving.js";
import { hideSeries, redrawSeries, setUpSeries, showSeries } from "../parts/series.js";
import { badge, replaced, runName } from "../parts/sidebar.js";
import { forgetPlan, hidePlan, redrawPlan, revealPlan, showPlan } from "../planning/section.js";
import { randomKey, remove } from "./submit.js";

const LISTED = 10;

let ready = null;
let dataset = null;
let hooks = {};
let worked = null; // ids and states of the unfinished jobs that are listed
let simulating = null; // id of the dataset whose ways to simulate are to be shown

export function setUpDataset(given) {
  hooks = given;
}

async function build() {
  await fill($("dataset"), "dataset/page.html");
  setUpSeries();
  setUpForces();
  setUpTracks({ onNoise: showMarkerNoise });
  setUpSimulation(async (kind, rig) => {
    const body = { dataset_id: dataset.id, rig };
    hooks.onStarted(kind, await postJson(kind, body, { "Idempotency-Key": randomKey() }));
  });
  $("dataset-run").addEventListener("click", () => hooks.onRun(dataset));
  $("dataset-diagnose").addEventListener("click", () => hooks.onDiagnose(dataset));
  $("dataset-plan").addEventListener("click", revealPlan);
  $("dataset-delete").addEventListener("click", async () => {
    const { id, name } = dataset;
    if (!await remove("datasets", id, name)) return;
    forgetPlan(id);
    hooks.onDeleted();
  });
}

export async function selectDataset(id) {
  dataset = null;
  $("dataset").hidden = true;
  if (simulating !== id) simulating = null;
  if (!id && !ready) return;
  ready ??= build();
  try {
    await ready;
    for (const hide of [hideSeries, hideForces, hideTracks, hidePlan]) hide();
    if (!id || hooks.currentId() !== id) return;
    const found = await get(`datasets/${part(id)}`);
    if (hooks.currentId() !== id) return;
    dataset = found;
  } catch (error) {
    if (!$("dataset").firstChild) ready = null;
    if (hooks.currentId() === id) hooks.onMissing(error, () => !dataset && selectDataset(id));
    return;
  }
  $("dataset").hidden = false;
  drawHead();
  listRecordings(dataset);
  const series = isSeries(dataset);
  const parts = { "tracks-view": "tracks", "samples-part": "tracks", "distances-part": "tracks", "forces-view": "forces", "force-axes-part": "forces", "series-part": "series", "values-part": "series" };
  for (const [name, kind] of Object.entries(parts)) $(name).hidden = kind !== dataset.kind;
  $("drawing-part").hidden = series;
  const shown = dataset;
  const charts = { tracks: () => [showTracks(shown), showDrawing(shown)], forces: () => [showForces(shown), showDrawing(shown)], series: () => [showRig()] }[dataset.kind]();
  await Promise.all([...charts, showChecks(shown, () => dataset === shown), drawConditions(shown), showPlan(shown), listWork(id)]);
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

export function redrawDataset() {
  if (!dataset) return;
  ({ tracks: redrawTracks, forces: redrawForces, series: redrawSeries })[dataset.kind]();
  drawConditions(dataset);
  redrawPlan();
}

// Take over name and notes of ``now``, the dataset as it is on the server, and the jobs that began or ended.
export async function refreshDataset(now, active) {
  if (dataset?.id !== now.id) return;
  if (dataset.name !== now.name || dataset.notes !== now.notes) {
    dataset = { ...dataset, name: now.name, notes: now.notes };
    drawHead();
  }
  const working = [...active.runs, ...active.diagnoses].filter((job) => job.dataset_id === now.id).map((job) => `${job.id} ${job.state}`).sort().join();
  if (working !== worked) await listWork(now.id);
}

async function listWork(id) {
  const unfinished = [];
  const show = async (kind, page, text) => {
    const list = $(`dataset-${kind}`);
    const found = await get(`${kind}?dataset_id=${part(id)}&limit=${LISTED}`);
    if (hooks.currentId() !== id) return;
    unfinished.push(...found.items.filter((job) => !isFinal(job)).map((job) => `${job.id} ${job.state}`));
    const items = found.items.map((job) => el("li", {}, el("a", { href: `#${page}=${part(job.id)}` }, ...text(job))));
    if (found.next_cursor) items.push(el("li", {}, el("a", { href: `#${kind}&dataset_id=${part(id)}` }, "Show all")));
    replaced(list, items.length ? items : [el("li", { className: "quiet" }, "None yet.")]);
  };
  await Promise.all([
    show("runs", "run", (run) => [runName(run), " ", badge(run), ` ${misfit(run).value} ${misfit(run).unit}`]),
    show("diagnoses", "diagnosis", (one) => [one.name, " ", badge(one), ` ${one.verdict ?? ""}`]),
  ]).then(() => { worked = unfinished.sort().join(); }, (error) => toast(error.message));
}
