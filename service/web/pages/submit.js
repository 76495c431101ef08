// The form that starts a run, and questions before a job is cancelled or something deleted; the server checks them, and its errors are shown at the fields.

import { ApiError, call, get, part, postJson, refused } from "../base/api.js";
import { confirmed } from "../base/confirm.js";
import { effectFamilies, tick } from "../base/choices.js";
import { copy, curl, python } from "../base/copying.js";
import { $, toast } from "../base/format.js";
import { showErrors } from "../base/form_errors.js";
import { isForces, isSeries, METHODS, MODES, PRESETS, setup, spoken } from "../base/labels.js";

const TYPED_MS = 350;
const CHOICES = { ...METHODS, auto: "auto, recommended" };
// Sent for a field with invalid text, whose value the browser reports as empty: empty would mean the default.
export const NO_NUMBER = "not a number";

let datasets = [];
let models = null;
let effects = null;
let typing = null;
let checked = 0;
let checking = Promise.resolve();

export function setUpSubmit({ onSubmitted }) {
  const form = $("submit-form");
  let sent = null;
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const button = form.querySelector("[type=submit]");
    if (button.disabled) return;
    const body = values(form);
    // The same input sent twice is one run: the key changes only with the input.
    const text = JSON.stringify(body);
    if (sent?.text !== text) sent = { text, key: randomKey() };
    showErrors(form, $("submit-errors"), null);
    clearTimeout(typing);
    checked += 1; // a pending check belongs to earlier input
    button.disabled = true;
    try {
      const run = await postJson("runs", body, { "Idempotency-Key": sent.key });
      sent = null;
      $("submit-dialog").close();
      onSubmitted(run);
    } catch (error) {
      showErrors(form, $("submit-errors"), error);
    } finally {
      button.disabled = false;
    }
  });
  form.dataset_id.addEventListener("change", () => showFieldsFor(form).then(() => check(form)));
  form.method.addEventListener("change", () => showMethodFields(form));
  form.preset.addEventListener("change", () => showPreset(form));
  $("effect-choices").addEventListener("change", summarizeEffects);
  $("submit-close").addEventListener("click", () => $("submit-dialog").close());
  form.addEventListener("input", () => {
    clearTimeout(typing);
    typing = setTimeout(() => check(form), TYPED_MS);
  });
  $("submit-curl").addEventListener("click", () => copy(curl("runs", values(form))));
  $("submit-python").addEventListener("click", () => copy(python(values(form))));
}

// ``dataset`` is preselected; it may be older than ``all``. Runs of series start on the page of their dataset.
export function openSubmit(all, dataset = all.find((one) => !isSeries(one))) {
  const known = all.filter((one) => !isSeries(one));
  datasets = known.some((one) => one.id === dataset?.id) || !dataset ? known : [dataset, ...known];
  if (!datasets.length) {
    toast(all.length ? "Open a dataset of series to start its runs" : "Upload a dataset first");
    return;
  }
  const form = $("submit-form");
  form.dataset_id.replaceChildren(...datasets.map((one) => new Option(one.name, one.id)));
  form.dataset_id.value = dataset.id;
  form.elements.namedItem("name").value = "";
  showErrors(form, $("submit-errors"), null);
  showFieldsFor(form).then(() => check(form));
  $("submit-dialog").showModal();
}

// Let the server check the form without submitting it. One request at a time: the latest input is checked when the
// previous check has been answered.
async function check(form) {
  const mine = ++checked;
  await checking.catch(() => {});
  if (mine !== checked) return;
  try {
    checking = postJson("runs?validate_only=true", values(form));
    const { name, spec } = await checking;
    if (mine !== checked) return;
    showErrors(form, $("submit-errors"), null);
    $("submit-preview").textContent = `Preview: “${name}”: ${setup({ kind: chosenDataset(form).kind, spec }).join(" · ")}`;
  } catch (error) {
    if (mine !== checked) return;
    $("submit-preview").textContent = "";
    showErrors(form, $("submit-errors"), error);
  }
}

// crypto.randomUUID exists only in secure contexts, which a page without TLS on a private network is not.
export const randomKey = () => [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");

function values(form) {
  const body = { dataset_id: form.dataset_id.value, method: form.method.value, mode: form.mode.value || null };
  const forces = isForces(chosenDataset(form));
  if (forces) Object.assign(body, { preset: form.preset.value, without: unticked("terms"), axes: ticked("axes") });
  else body.division = form.division.value;
  if (ticked("effect-choices").length) body.effects = ticked("effect-choices");
  if (finishes(form)) body.finish = form.finish.checked;
  // Invalid numbers are sent as text, so that the server explains the error.
  for (const name of numbers(form, forces)) {
    if (form[name].validity.badInput) body[name] = NO_NUMBER;
    else if (form[name].value !== "") body[name] = Number(form[name].value);
  }
  const name = form.elements.namedItem("name").value.trim();
  return name ? { ...body, name } : body;
}

const numbers = (form, forces) => [
  ...(searches(form) ? ["population", "seed"] : []), ...(forces ? ["low_pass_hz", "peel_width_beats"] : ["accuracy_mm"]),
];

const searches = (form) => form.method.value !== "gauss_newton";
const finishes = (form) => searches(form) && form.method.value !== "auto";
const boxes = (id) => [...$(id).querySelectorAll("input")];
const ticked = (id) => boxes(id).filter((box) => box.checked).map((box) => box.value);
const unticked = (id) => boxes(id).filter((box) => !box.checked).map((box) => box.value);
const chosenDataset = (form) => datasets.find((dataset) => dataset.id === form.dataset_id.value);

// Show the fields that apply to the kind of the chosen dataset.
async function showFieldsFor(form) {
  const dataset = chosenDataset(form);
  const forces = isForces(dataset);
  for (const node of form.querySelectorAll("[data-kind]")) node.hidden = node.dataset.kind !== (forces ? "forces" : "tracks");
  options(form.method, CHOICES, forces ? ["gauss_newton", "auto", "genetic", "cma_es"] : ["genetic", "auto", "cma_es", "gauss_newton"]);
  // Only the server knows the default of a wing: that of a rigid one, which has no stages, is another.
  const byDefault = forces ? "local" : "staged, or joint for a rigid wing";
  options(form.mode, { ...MODES, "": `default: ${byDefault}` }, forces ? ["", "local", "joint"] : ["", "staged", "joint", "local"]);
  showMethodFields(form);
  await showEffectChoices(form, forces ? "vehicle" : "wing");
  if (!forces) return;
  const recorded = new Set(dataset.recordings.flatMap((recording) => recording.channels.map((name) => name.replace("force_", ""))));
  $("axes").replaceChildren(...[...recorded].map((axis) => tick(axis, axis, axis === "x" || recorded.size === 1)));
  try {
    models ??= await get("models");
  } catch (error) {
    showErrors(form, $("submit-errors"), error);
    return;
  }
  options(form.preset, PRESETS, models.presets.map((preset) => preset.name));
  showPreset(form);
}

function showMethodFields(form) {
  for (const node of form.querySelectorAll("[data-search]")) node.hidden = !searches(form);
  for (const node of form.querySelectorAll("[data-finish]")) node.hidden = !finishes(form);
}

// Effects that apply to the rig of the dataset, by family; none is selected.
async function showEffectChoices(form, rig) {
  try {
    effects ??= (await get("effects")).effects;
  } catch (error) {
    showErrors(form, $("submit-errors"), error);
    return;
  }
  const fitting = effects.filter((effect) => effect.applies_to.includes(rig));
  $("effect-choices").replaceChildren(...effectFamilies(fitting));
  $("effects-part").hidden = !fitting.length;
  summarizeEffects();
}

function summarizeEffects() {
  const count = ticked("effect-choices").length;
  $("effects-summary").textContent = count ? `Effects: ${ticked("effect-choices").map(spoken).join(", ")}` : "Effects: none included";
}

function showPreset(form) {
  const preset = models.presets.find((one) => one.name === form.preset.value);
  $("preset-about").textContent = `${preset.description}. ${preset.source}.`;
  const terms = preset.terms.map((name) => models.terms.find((term) => term.name === name));
  $("terms").replaceChildren(...terms.map((term) => tick(term.name, spoken(term.name), true, `${term.description} (${term.equation})`)));
}

function options(select, words, values) {
  select.replaceChildren(...values.map((value) => new Option(words[value] ?? spoken(value), value)));
}

// XMLHttpRequest, because fetch does not report the progress of an upload.
export function send(file, onFraction) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    const form = new FormData();
    form.append("file", file);
    request.open("POST", "v1/datasets");
    request.setRequestHeader("Idempotency-Key", randomKey());
    request.responseType = "json";
    request.upload.onprogress = (event) => event.lengthComputable && onFraction(event.loaded / event.total);
    request.onload = () => {
      const answer = request.response ?? {};
      refused(request.status);
      if (request.status < 300) resolve(answer);
      else reject(new ApiError(answer.detail || `${request.status} ${request.statusText}`, { status: request.status, errors: answer.errors ?? [] }));
    };
    request.onerror = () => reject(new ApiError("The server does not answer, or refused the file because of its size."));
    request.send(form);
  });
}

// Ask whether the job is to be cancelled, and let it be; ``kind``: "runs", "diagnoses", "trackings".
export async function cancel(kind, id, name) {
  const kept = kind === "runs" ? "The generations that it has finished are kept. It cannot be resumed." : "What it has computed so far is lost. It cannot be resumed.";
  if (!(await confirmed(`Cancel ${name}?`, kept, "Cancel it"))) return;
  // The new state arrives as an event; the answer may be older than the last event.
  await call("POST", `${kind}/${part(id)}/cancel`).catch((error) => toast(error.message));
}

export async function remove(kind, id, name) {
  if (!(await confirmed(`Delete ${name}?`, "This cannot be undone.", "Delete"))) return false;
  try {
    await call("DELETE", `${kind}/${part(id)}`);
    return true;
  } catch (error) {
    toast(error.status === 404 ? `${name} was deleted already` : error.message);
    return error.status === 404;
  }
}
