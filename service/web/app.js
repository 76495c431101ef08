// The page: lists, the selected run (#run=ID), the state of the server.

import { get } from "./api.js";
import { $, plural, toast } from "./format.js";
import { drawDatasets, drawRuns } from "./lists.js";
import { redraw, selectRun, setUpRun } from "./run.js";
import { openSubmit, remove, setUpSubmit } from "./submit.js";

const POLL_MS = 2500;
const RUNS_SHOWN = 50;

let runs = [];
let datasets = [];
let polling = null;

const currentId = () => new URLSearchParams(location.hash.slice(1)).get("run");

function drawLists() {
  drawRuns(runs, currentId());
  drawDatasets(datasets, {
    onRun: (dataset) => openSubmit(datasets, dataset.id),
    onDelete: async (dataset) => (await remove("datasets", dataset.id, dataset.name)) && poll(),
  });
}

function setAway(away) {
  $("away").hidden = !away;
  $("away").textContent = away ? "The server is away. What you see may be old; the page goes on by itself when it is back." : "";
}

function showHealth(health) {
  const state = { starting: "evaluator starting", degraded: `degraded: ${health.detail ?? "evaluator not available"}` }[health.status];
  const active = health.runs_active ? `${plural(health.runs_active, "run")} active` : "idle";
  $("health").textContent = [state ?? active, health.workers ? plural(health.workers, "worker") : null, `version ${health.version}`]
    .filter(Boolean).join(" · ");
}

async function poll() {
  clearTimeout(polling);
  try {
    const [health, runPage, datasetPage] = await Promise.all(
      [get("health"), get(`runs?limit=${RUNS_SHOWN}`), get(`datasets?limit=${RUNS_SHOWN}`)]);
    [runs, datasets] = [runPage.items, datasetPage.items];
    setAway(false);
    showHealth(health);
    drawLists();
  } catch (error) {
    if (error.away) setAway(true);
    else toast(error.message);
  }
  clearTimeout(polling);
  if (!document.hidden) polling = setTimeout(poll, POLL_MS);
}

async function route() {
  drawLists();
  if (!currentId()) document.title = "wingfit";
  await selectRun(currentId());
}

function go(id) {
  location.hash = id ? `run=${encodeURIComponent(id)}` : "";
}

setUpRun({
  currentId,
  onAway: setAway,
  onChange(run) {
    runs = runs.map((other) => (other.id === run.id ? run : other));
    drawLists();
  },
  onDeleted() {
    go(null);
    poll();
  },
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
window.addEventListener("hashchange", route);
document.addEventListener("visibilitychange", () => document.hidden || poll());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
poll();
route();
