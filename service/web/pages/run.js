// The selected run: progress, figures, tables, actions.

import { call, follow, get, history, isFinal, part } from "../base/api.js";
import { copy, curl, python } from "../base/copying.js";
import { $, isolated, plural, toast, when } from "../base/format.js";
import { hideForces, redrawForces, setUpForces, showForces } from "./forces.js";
import { showGeneCorrelations } from "../base/correlations.js";
import { redrawCurves, setUpCurves, showCurves } from "../parts/curves.js";
import { showWaiting } from "../parts/driving.js";
import { aboutHistory, drawHistory } from "../parts/history.js";
import { badge, runName, setBar, stateWord, timeLeft } from "../parts/sidebar.js";
import { showNotes } from "../lists/edit.js";
import { redrawLoads } from "../parts/loads.js";
import { cancel, remove } from "./submit.js";
import { drawGenes, drawMisfit, drawNumbers, drawSeriesMisfit } from "../parts/tables.js";
import { hideWing, redrawWing, setUpViewer, showWing } from "../parts/viewer.js";
import { showRemarks } from "../base/form_errors.js";
import { fitBadge, fitSentence, isForces, isSeries, request, setup } from "../base/labels.js";

const ALLOWED = {
  pause: ["QUEUED", "RUNNING"], resume: ["PAUSED"], cancel: ["QUEUED", "RUNNING", "PAUSED"],
  delete: ["SUCCEEDED", "FAILED", "CANCELLED"],
};
const GENES_MS = 3000;

let run = null;
let dataset = null;
let result = null;
let items = new Map();
let stopFollowing = () => {};
let drawing = false;
let genesAt = 0;
let hooks = {};

export function setUpRun(given) {
  hooks = given;
  setUpViewer();
  setUpForces();
  setUpCurves();
  $("actions").addEventListener("click", (event) => {
    const action = event.target.dataset?.action;
    if (action) act(action);
  });
  $("diagnose-run").addEventListener("click", () => hooks.onDiagnose(run, dataset));
  $("copy-curl").addEventListener("click", () => copy(curl("runs", again())));
  $("copy-python").addEventListener("click", () => copy(python(again())));
}

// The request that submits this run again.
const again = () => ({ dataset_id: run.dataset_id, ...request(run), ...(run.name ? { name: run.name } : {}) });

export async function selectRun(id) {
  stopFollowing();
  stopFollowing = () => {};
  [run, dataset, result, items, genesAt] = [null, null, null, new Map(), 0];
  drawGenes(null);
  showGeneCorrelations($("gene-correlations"), null);
  drawMisfit(null);
  drawSeriesMisfit(null);
  showCurves(null);
  $("run").hidden = true;
  if (!id) return;
  try {
    const found = await get(`runs/${part(id)}`);
    const its = await get(`datasets/${part(found.dataset_id)}`);
    const past = isFinal(found) ? await history(id) : [];
    if (hooks.currentId() !== id) return;
    [run, dataset] = [found, its];
    past.forEach((item) => items.set(item.sequence, item));
  } catch (error) {
    if (hooks.currentId() === id) hooks.onMissing(error, () => !run && selectRun(id));
    return;
  }
  $("run").hidden = false;
  showSections();
  update();
  if (!isFinal(run)) listen();
}

// Take over name and notes of ``now``, the run as it is on the server.
export function renameRun(now) {
  if (run?.id !== now.id || (run.name === now.name && run.notes === now.notes)) return;
  run = { ...run, name: now.name, notes: now.notes };
  drawHead();
}

export function redraw() {
  if (!run) return;
  drawFitness();
  if (isForces(run)) redrawForces();
  if (isSeries(run)) redrawCurves();
  if (run.kind !== "tracks") return;
  redrawWing();
  redrawLoads();
}

// Show the sections of the kind of run: on tracked markers, on forces, or on series.
function showSections() {
  const tracks = run.kind === "tracks";
  if (!tracks) hideWing();
  if (!isForces(run)) hideForces();
  $("tracks-part").hidden = !tracks;
  $("loads-section").hidden = !tracks;
  $("forces-part").hidden = !isForces(run);
  showRemarks($("remarks"), []);
  $("history-about").textContent = aboutHistory(run.kind);
}

function showParts() {
  if (isForces(run)) showForces(run, dataset, result);
  else if (!isSeries(run)) showWing(run, dataset);
}

function listen() {
  stopFollowing();
  const id = run.id;
  stopFollowing = follow(`runs/${part(id)}`, "generation", {
    onStep(item) {
      items.set(item.sequence, item);
      if (item.sequence > run.generations) {
        run = {
          ...run, stage: item.stage, generations: item.sequence, evaluations: item.evaluations,
          best_mm: item.best_mm, best_mn: item.best_mn, best_percent: item.best_percent, progress: item.progress, eta_seconds: item.eta_seconds,
        };
      }
      schedule();
    },
    onState(state) {
      run = state;
      hooks.onChange(run);
      schedule();
    },
    onAway: hooks.onAway,
  });
}

// Generations may arrive faster than the charts can be drawn.
function schedule() {
  if (drawing) return;
  drawing = true;
  setTimeout(() => {
    drawing = false;
    if (run) update();
  }, 120);
}

async function update() {
  drawHead();
  drawFitness();
  showParts();
  const id = run.id;
  if (run.state === "SUCCEEDED" && !result) {
    await get(`runs/${part(id)}/result`).then((answer) => {
      if (run?.id !== id) return;
      result = answer;
      drawNumbers(run, result);
      showResult();
      drawGenes({ genes: result.genes, final: true }, isForces(run));
      showGeneCorrelations($("gene-correlations"), result.correlations);
    }, (error) => toast(error.message));
  } else if (!result && run.generations > 0 && (isFinal(run) || Date.now() - genesAt > GENES_MS)) {
    genesAt = Date.now();
    await get(`runs/${part(id)}/genome`).then((answer) => run?.id === id && !result && drawGenes(answer), () => {});
  }
}

function showResult() {
  if (isForces(run)) showForces(run, dataset, result);
  else if (!isSeries(run)) drawMisfit(result);
  else {
    showRemarks($("remarks"), result.remarks, result.genes.map((gene) => gene.name));
    drawSeriesMisfit(result);
    showCurves(result.curves);
  }
}

function drawHead() {
  document.title = `${runName(run)} · wingfit`;
  $("run-name").replaceChildren(runName(run), " ", ...[fitBadge(run) ?? badge(run)]);
  $("run-fit").hidden = run.state !== "SUCCEEDED";
  $("run-fit").textContent = run.state === "SUCCEEDED" ? fitSentence(run) : "";
  placeHistory();
  $("run-about").textContent = [isolated(dataset.name), ...setup(run), when(run.created_at)].join(" · ");
  showNotes($("run-name"), "runs", run, ({ name, notes }) => {
    run = { ...run, name, notes };
    drawHead();
  });
  $("run-error").hidden = !run.error;
  $("run-error").textContent = run.error ?? "";
  showWaiting($("run-waiting"), run);
  setBar($("run-bar"), run);
  $("run-bar").hidden = run.state === "SUCCEEDED";
  const percent = `${Math.round(100 * run.progress)} %`;
  const parts = [run.state === "SUCCEEDED" ? null : percent, timeLeft(run), run.state === "RUNNING" ? run.stage && (run.kind === "tracks" ? `${run.stage} stage` : run.stage) : null,
    plural(run.generations, "generation"), `${run.evaluations.toLocaleString("en")} evaluations`];
  $("run-progress").textContent = parts.filter(Boolean).join(" · ");
  // The request contains the declaration of the rig, which only its user has.
  for (const id of ["copy-curl", "copy-python"]) $(id).hidden = run.driven;
  $("diagnose-run").hidden = run.generations === 0;
  $("run-exports").hidden = run.generations === 0;
  for (const format of ["csv", "netcdf", "json"]) $(`export-${format}`).href = `v1/runs/${part(run.id)}/export?format=${format}`;
  $("run-model").hidden = run.state !== "SUCCEEDED";
  for (const format of ["tables", "fmu"]) $(`model-${format}`).hidden = run.kind === "series";
  for (const format of ["python", "tables", "fmu", "json"]) $(`model-${format}`).href = `v1/runs/${part(run.id)}/model?format=${format}`;
  for (const button of $("actions").querySelectorAll("[data-action]")) {
    button.hidden = !ALLOWED[button.dataset.action].includes(run.state);
    button.disabled = Boolean(run.pending_action);
  }
  drawNumbers(run, result);
}

// Convergence is watched while a run on markers or series goes on; afterwards, and beside forces, the result comes first.
function placeHistory() {
  const [section, anchor] = [$("history-section"), isFinal(run) || isForces(run) ? $("loads-section") : $("remarks")];
  if (anchor.nextElementSibling !== section) anchor.after(section);
}

function drawFitness() {
  const sorted = [...items.values()].sort((a, b) => a.sequence - b.sequence);
  $("history").hidden = !sorted.length;
  $("history-note").hidden = sorted.length > 0;
  $("history-note").textContent = {
    QUEUED: run.driven ? "The run waits for its simulation." : "The run waits for its turn.", RUNNING: "The first generation is being computed.",
  }[run.state] ?? "The run ended before its first generation.";
  if (sorted.length) drawHistory($("history"), sorted, run.kind).catch((error) => toast(error.message));
}

async function act(action) {
  if (action === "delete") {
    if (await remove("runs", run.id, runName(run))) hooks.onDeleted();
    return;
  }
  if (action === "cancel") {
    await cancel("runs", run.id, runName(run));
    return;
  }
  try {
    // The new state arrives as an event; this answer may be older than the last event.
    await call("POST", `runs/${part(run.id)}/${action}`);
  } catch (error) {
    if (error.status === 409) await takeOver(action);
    else toast(error.message);
  }
}

// The state of the run had changed before the action, and the page did not know it.
async function takeOver(action) {
  const { id } = run;
  const now = await get(`runs/${part(id)}`).catch((error) => toast(error.message));
  if (!now || run?.id !== id) return;
  run = now;
  hooks.onChange(run);
  update();
  toast(`Could not ${action}: meanwhile the run is ${stateWord(run.state)}`);
}
