// The form that starts a diagnosis of a dataset, or of the best genome of a run.

import { fill, get, postJson } from "../base/api.js";
import { effectFamilies, tick } from "../base/choices.js";
import { copy, curl } from "../base/copying.js";
import { showErrors } from "../base/form_errors.js";
import { $, plural, toast } from "../base/format.js";
import { isForces, PRESETS, spoken } from "../base/labels.js";
import { NO_NUMBER, randomKey } from "../pages/submit.js";

const form = () => $("diagnose-form");

let subject = null; // { dataset, run }: run is null for a diagnosis of a dataset
let effects = null;
let models = null;
let sent = null;
let ready = null;
let onSubmitted = () => {};

export function setUpDiagnoseForm(hooks) {
  onSubmitted = hooks.onSubmitted;
}

async function build() {
  await fill($("diagnose-dialog"), "diagnosing/form.html");
  form().addEventListener("submit", submit);
  form().preset.addEventListener("change", showTerms);
  form().addEventListener("change", summarize);
  $("diagnose-close").addEventListener("click", () => $("diagnose-dialog").close());
  $("diagnose-curl").addEventListener("click", () => copy(curl("diagnoses", values())));
}

async function submit(event) {
  event.preventDefault();
  const button = form().querySelector("[type=submit]");
  if (button.disabled) return;
  const body = values();
  // The same input sent twice is one diagnosis: the key changes only with the input.
  const text = JSON.stringify(body);
  if (sent?.text !== text) sent = { text, key: randomKey() };
  showErrors(form(), $("diagnose-errors"), null);
  button.disabled = true;
  try {
    const diagnosis = await postJson("diagnoses", body, { "Idempotency-Key": sent.key });
    sent = null;
    $("diagnose-dialog").close();
    onSubmitted(diagnosis);
  } catch (error) {
    showErrors(form(), $("diagnose-errors"), error);
  } finally {
    button.disabled = false;
  }
}

export async function openDiagnoseForm(dataset, run = null) {
  subject = { dataset, run };
  ready ??= build();
  try {
    await ready;
  } catch (error) {
    ready = null;
    toast(error.message);
    return;
  }
  form().reset();
  showErrors(form(), $("diagnose-errors"), null);
  $("diagnose-title").textContent = run ? "Diagnose this run" : `Diagnose ${dataset.name}`;
  $("diagnose-about").textContent = run
    ? "Starts from the best genome of the run, with its settings." : "Fits the nominal model, and searches for the physics that it misses.";
  const forces = isForces(dataset);
  for (const node of form().querySelectorAll("[data-of]")) node.hidden = node.dataset.of !== (forces ? "forces" : "tracks");
  showRecordings();
  $("diagnose-dialog").showModal();
  try {
    [effects, models] = [effects ?? (await get("effects")).effects, models ?? (forces ? await get("models") : null)];
  } catch (error) {
    showErrors(form(), $("diagnose-errors"), error);
    return;
  }
  const spec = run?.spec;
  if (forces) {
    form().preset.replaceChildren(...models.presets.map(({ name }) => new Option(PRESETS[name] ?? spoken(name), name)));
    if (spec) form().preset.value = spec.preset;
    const recorded = new Set(dataset.recordings.flatMap(({ channels }) => channels.map((name) => name.replace("force_", ""))));
    $("diagnose-axes").replaceChildren(...[...recorded].map((axis) => tick(axis, axis, spec ? spec.axes.includes(axis) : true, "", "axes")));
    showTerms();
  } else if (spec) {
    if (![...form().division.options].some(({ value }) => value === spec.division)) form().division.add(new Option(spec.division, spec.division));
    form().division.value = spec.division;
    form().accuracy_mm.value = spec.accuracy_mm;
  }
  $("diagnose-effects").replaceChildren(...effectFamilies(fitting(), spec?.effects, "effects"));
  $("diagnose-suspects").replaceChildren(...effectFamilies(fitting(), [], "suspects"));
  summarize();
}

function showRecordings() {
  const { dataset, run } = subject;
  const fitted = dataset.recordings.filter((one) => !one.held_out);
  const held = dataset.recordings.filter((one) => one.held_out);
  const chosen = new Set(run?.spec.recordings?.length ? run.spec.recordings : fitted.map(({ name }) => name));
  $("diagnose-recordings").replaceChildren(...fitted.map(({ name }) => tick(name, name, chosen.has(name), "", "recordings")));
  $("diagnose-held").textContent = held.length
    ? `Held out, to test the result: ${held.map(({ name }) => name).join(", ")}.` : "No recording is held out: the result cannot be tested on data that it has not seen.";
}

// The terms of the chosen model; those cleared are left out of it, and suspected.
function showTerms() {
  if (!models) return;
  const preset = models.presets.find(({ name }) => name === form().preset.value);
  const without = subject.run?.spec.preset === preset.name ? subject.run.spec.without : [];
  $("diagnose-terms").replaceChildren(...preset.terms.map((name) => models.terms.find((term) => term.name === name))
    .map((term) => tick(term.name, spoken(term.name), !without.includes(term.name), `${term.description} (${term.equation})`, "terms")));
}

const fitting = () => effects.filter((effect) => effect.applies_to.includes(isForces(subject.dataset) ? "vehicle" : "wing"));

function summarize() {
  if (!effects) return;
  const [included, suspected] = [ticked("effects"), ticked("suspects")];
  $("diagnose-effects-summary").textContent = included.length ? `Effects already in the model: ${included.map(spoken).join(", ")}` : "Effects already in the model: none";
  $("diagnose-suspects-summary").textContent = suspected.length
    ? `Suspects: ${suspected.map(spoken).join(", ")}` : `Suspects: all ${plural(fitting().length, "effect")} that apply, and the terms left out`;
}

const boxes = (name) => [...form().querySelectorAll(`input[type=checkbox][name=${name}]`)];
const ticked = (name) => boxes(name).filter((box) => box.checked).map((box) => box.value);

function values() {
  const { dataset, run } = subject;
  const fields = form();
  const body = run ? { run_id: run.id } : { dataset_id: dataset.id };
  const recordings = ticked("recordings");
  if (recordings.length < boxes("recordings").length || run?.spec.recordings?.length) body.recordings = recordings.length ? recordings : [""];
  if (isForces(dataset)) {
    Object.assign(body, { preset: fields.preset.value, without: boxes("terms").filter((box) => !box.checked).map((box) => box.value), axes: ticked("axes") });
  } else {
    Object.assign(body, { division: fields.division.value, refine: fields.refine.checked });
  }
  const numbers = isForces(dataset) ? ["refits"] : ["refits", "accuracy_mm"];
  for (const name of numbers) {
    if (fields[name].validity.badInput) body[name] = NO_NUMBER;
    else if (fields[name].value !== "") body[name] = Number(fields[name].value);
  }
  if (ticked("effects").length || run?.spec.effects?.length) body.effects = ticked("effects");
  if (ticked("suspects").length) body.suspects = ticked("suspects");
  if (fields.exhaustive.checked) body.exhaustive = true;
  const name = fields.elements.namedItem("name").value.trim();
  return name ? { ...body, name } : body;
}
