// The page: lists, the selected run (#run=ID) or diagnosis (#diagnosis=ID), the state of the server.

import { askForKey, isRefused, setUpAccess } from "./access.js";
import { get } from "./api.js";
import { diagnose, selectDiagnosis, setUpDiagnosis } from "./diagnosis.js";
import { $, plural, toast } from "./format.js";
import { drawDatasets, drawDiagnoses, drawRuns } from "./lists.js";
import { redraw, selectRun, setUpRun } from "./run.js";
import { openSubmit, remove, setUpSubmit } from "./submit.js";

const POLL_MS = 2500;
const SHOWN = 50;

let runs = [];
let diagnoses = [];
let datasets = [];
let polling = null;

const current = (kind) => new URLSearchParams(location.hash.slice(1)).get(kind);
const currentId = () => current("run");
const currentDiagnosis = () => current("diagnosis");

function drawLists() {
  drawRuns(runs, currentId());
  drawDiagnoses(diagnoses, currentDiagnosis());
  drawDatasets(datasets, {
    onRun: (dataset) => openSubmit(datasets, dataset.id),
    onDiagnose: (dataset) => startDiagnosis({ dataset_id: dataset.id }),
    onDelete: async (dataset) => (await remove("datasets", dataset.id, dataset.name)) && poll(),
  });
}

function setAway(away) {
  $("away").hidden = !away;
  $("away").textContent = away ? "The server is away. What you see may be old; the page goes on by itself when it is back." : "";
}

function showHealth(health) {
  const state = { starting: "evaluator starting", degraded: `degraded: ${health.detail ?? "evaluator not available"}` }[health.status];
  const count = health.runs_active + health.diagnoses_active;
  const active = count ? `${plural(count, "job")} active` : "idle";
  $("health").textContent = [state ?? active, health.workers ? plural(health.workers, "worker") : null, `version ${health.version}`]
    .filter(Boolean).join(" · ");
}

async function poll() {
  clearTimeout(polling);
  try {
    const [health, ...pages] = await Promise.all(
      [get("health"), ...["runs", "diagnoses", "datasets"].map((kind) => get(`${kind}?limit=${SHOWN}`))]);
    [runs, diagnoses, datasets] = pages.map((page) => page.items);
    setAway(false);
    showHealth(health);
    drawLists();
  } catch (error) {
    if (isRefused(error)) askForKey();
    else if (error.away) setAway(true);
    else toast(error.message);
  }
  clearTimeout(polling);
  if (!document.hidden) polling = setTimeout(poll, POLL_MS);
}

async function route() {
  drawLists();
  if (!currentId() && !currentDiagnosis()) document.title = "wingfit";
  await Promise.all([selectRun(currentId()), selectDiagnosis(currentDiagnosis())]);
}

function go(id, kind = "run") {
  location.hash = id ? `${kind}=${encodeURIComponent(id)}` : "";
}

async function startDiagnosis(body) {
  const diagnosis = await diagnose(body);
  if (!diagnosis) return;
  go(diagnosis.id, "diagnosis");
  poll();
}

function onDeleted() {
  go(null);
  poll();
}

setUpRun({
  currentId,
  onAway: setAway,
  onChange(run) {
    runs = runs.map((other) => (other.id === run.id ? run : other));
    drawLists();
  },
  onDiagnose: (run) => startDiagnosis({ run_id: run.id }),
  onDeleted,
});
setUpDiagnosis({
  currentId: currentDiagnosis,
  onAway: setAway,
  onChange(diagnosis) {
    diagnoses = diagnoses.map((other) => (other.id === diagnosis.id ? diagnosis : other));
    drawLists();
  },
  onDeleted,
});
setUpSubmit({
  onSubmitted(run) {
    go(run.id);
    poll();
  },
  onUploaded(dataset) {
    poll().then(() => openSubmit(datasets, dataset.id));
  },
});
$("new-run").addEventListener("click", () => openSubmit(datasets));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
if (await setUpAccess()) {
  window.addEventListener("hashchange", route);
  document.addEventListener("visibilitychange", () => document.hidden || poll());
  poll();
  route();
}
