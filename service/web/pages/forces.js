// The part of the page that shows a run on forces: coefficients, forces over the beat, agreement, prediction.

import { get, part } from "../base/api.js";
import { drawAgreement, fillQuantities } from "../parts/agreement.js";
import { drawBeats } from "../parts/beats.js";
import { drawCorrelation, drawEstimates, fillEstimates } from "../parts/estimates.js";
import { $, el } from "../base/format.js";
import { clearPrediction, redrawPrediction, setUpPrediction, showPrediction } from "../parts/predict.js";
import { showRemarks } from "../base/form_errors.js";
import { recordingOptions, SOURCES } from "../base/labels.js";

let run = null;
let dataset = null;
let result = null;
let forces = null;
let requested = "";
let request = 0;
let preferred = null; // the model chosen by the user, used for other recordings too

const checked = (name) => document.querySelector(`input[name=${name}]:checked`)?.value;
const key = () => [run.id, $("force-recording").value, checked("source")].join("/");

export function setUpForces() {
  $("force-recording").addEventListener("change", () => { fillSources(); load(); });
  $("sources").addEventListener("change", () => { preferred = checked("source"); load(); });
  document.querySelectorAll("input[name=quantities]").forEach((input) => input.addEventListener("change", () => draw()));
  $("estimate").addEventListener("change", () => drawCorrelation(result, $("estimate").value));
  $("agreement-quantity").addEventListener("change", () => drawAgreement(result, dataset, $("agreement-quantity").value));
  setUpPrediction();
}

// Show a run; its result is null until it has succeeded.
export function showForces(next, its, outcome) {
  const changed = run?.id !== next.id;
  const judged = outcome !== result;
  [run, dataset, result] = [next, its, outcome];
  if (changed) {
    forces = null;
    $("beats").hidden = true;
    $("force-recording").replaceChildren(...recordingOptions(dataset));
  }
  if (!changed && !judged) return;
  showResult();
  fillSources();
  if (key() !== requested) load();
}

export function hideForces() {
  request += 1;
  [run, dataset, result, forces, requested] = [null, null, null, null, ""];
}

export function redrawForces() {
  if (!run) return;
  draw();
  if (result) drawEstimates(result, dataset);
  redrawPrediction();
}

function showResult() {
  $("estimates-section").hidden = !result;
  $("agreement-section").hidden = !result;
  showRemarks($("remarks"), result?.remarks ?? []);
  if (!result) {
    clearPrediction();
    return;
  }
  fillEstimates(result);
  drawEstimates(result, dataset);
  drawCorrelation(result, $("estimate").value);
  fillQuantities(result);
  drawAgreement(result, dataset, $("agreement-quantity").value);
  showPrediction(run, result, dataset);
}

// Models available for the chosen recording; until a run has ended only the nominal one.
function fillSources() {
  const recording = $("force-recording").value;
  const known = new Set((result?.agreements ?? []).filter((a) => a.recording === recording).map((a) => a.source)).add("nominal");
  const names = Object.keys(SOURCES).filter((name) => known.has(name));
  const wanted = names.includes(preferred) ? preferred : names[0];
  const legend = $("sources").querySelector("legend");
  $("sources").replaceChildren(legend, ...names.map((name) => el("label", {},
    el("input", { type: "radio", name: "source", value: name, checked: name === wanted }), el("span", {}, SOURCES[name]))));
}

async function load() {
  const mine = ++request;
  requested = key();
  const source = checked("source");
  const query = new URLSearchParams({ recording: $("force-recording").value, source });
  $("beats-note").textContent = "Computing…";
  try {
    const answer = await get(`runs/${part(run.id)}/forces?${query}`);
    if (mine !== request) return;
    forces = answer;
  } catch (error) {
    if (mine !== request) return;
    forces = null;
    $("beats").hidden = true;
    $("beats-note").textContent = error.message;
    return;
  }
  draw();
}

function draw() {
  if (!forces) return;
  $("beats").hidden = false;
  const names = checked("quantities").split(" ").filter((name) => name in forces.recorded_n);
  const about = dataset.recordings.find((recording) => recording.name === forces.recording);
  drawBeats(forces, names, about).then((note) => { $("beats-note").textContent = note; },
    (error) => { $("beats-note").textContent = error.message; });
}
