// Prediction of the global model for a given condition.

import { part, postJson } from "../base/api.js";
import { $, forceUnit, keyNumber, significant } from "../base/format.js";
import { lines } from "../base/plots.js";
import { showErrors, showRemarks } from "../base/form_errors.js";
import { NO_NUMBER } from "../pages/submit.js";

let run = null;
let prediction = null;
let request = 0;

export function setUpPrediction() {
  $("prediction-form").addEventListener("submit", (event) => {
    event.preventDefault();
    predict();
  });
}

export function showPrediction(next, result, dataset) {
  clearPrediction();
  run = next;
  $("prediction-section").hidden = false;
  const law = result.global_model;
  $("prediction-form").hidden = !law;
  if (!law) {
    $("prediction-note").textContent = "This run has no global model, so it cannot predict other conditions. "
      + "A global model needs local estimates under at least four conditions with different flap frequency and body pitch.";
    return;
  }
  $("prediction-note").textContent = `Coefficients from the global model, forces of one beat, not low-passed. Fitted between `
    + `${law.frequency_range_hz.map((value) => significant(value)).join(" and ")} Hz, ${law.pitch_range_deg.map((value) => significant(value)).join(" and ")}° of body pitch.`;
  fill(dataset.recordings.filter((recording) => law.recordings.includes(recording.name)));
}

export function clearPrediction() {
  request += 1;
  [run, prediction] = [null, null];
  $("prediction-section").hidden = true;
  $("prediction").hidden = true;
  showErrors($("prediction-form"), $("prediction-errors"), null);
  showRemarks($("prediction-warnings"), []);
}

export function redrawPrediction() {
  if (prediction) draw();
}

// Initial values: the mean of the fitted conditions.
function fill(recordings) {
  const form = $("prediction-form");
  const mean = (key) => recordings.reduce((sum, recording) => sum + recording[key], 0) / recordings.length;
  form.flap_frequency_hz.value = significant(mean("flap_frequency_hz"), 3);
  form.body_pitch_deg.value = significant(mean("angle_of_attack_deg"), 3);
  form.airspeed_m_s.value = significant(mean("airspeed_m_s"), 2);
}

async function predict() {
  const form = $("prediction-form");
  const mine = ++request;
  const body = {};
  for (const input of form.querySelectorAll("input")) {
    if (input.validity.badInput) body[input.name] = NO_NUMBER;
    else if (input.value !== "") body[input.name] = Number(input.value);
  }
  try {
    const answer = await postJson(`runs/${part(run.id)}/predictions`, body);
    if (mine !== request) return;
    prediction = answer;
    showErrors(form, $("prediction-errors"), null);
    showRemarks($("prediction-warnings"), answer.warnings);
    draw();
  } catch (error) {
    if (mine !== request) return;
    prediction = null;
    $("prediction").hidden = true;
    showRemarks($("prediction-warnings"), []);
    showErrors(form, $("prediction-errors"), error);
  }
}

function draw() {
  $("prediction").hidden = false;
  const means = prediction.averages_n;
  const { unit, show } = forceUnit([means.lift, means.drag]);
  $("prediction-numbers").replaceChildren(
    keyNumber("mean lift", show(means.lift), unit), keyNumber("mean drag", show(means.drag), unit),
    ...Object.entries(prediction.coefficients).map(([name, value]) => keyNumber(name, significant(value, 3))));
  const { phase, lift_n: lift, drag_n: drag, x_n: x, z_n: z } = prediction;
  Promise.all([
    lines($("prediction-lift"), phase, [["lift", lift], ["drag", drag]], { unit: "N", x: "t*, beats; 0: wings closest" }),
    lines($("prediction-x"), phase, [["x", x], ["z", z]], { unit: "N", x: "t*, beats; 0: wings closest" }),
  ]).catch((error) => showErrors($("prediction-form"), $("prediction-errors"), error));
}
