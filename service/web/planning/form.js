// The form of a plan: what is not stated is as recorded, so that one click is enough.

import { get, part } from "../base/api.js";
import { effectFamilies, tick } from "../base/choices.js";
import { showErrors } from "../base/form_errors.js";
import { $, el, plural, toast } from "../base/format.js";
import { isForces, PRESETS, request, spoken } from "../base/labels.js";
import { runName } from "../parts/sidebar.js";
import { NO_NUMBER } from "../pages/submit.js";

const MOST_RUNS = 20;
const DEFAULTS = { add: "3", power: "0.9", target_percent: "7.5", division: "11", axes: "x" };
const STATED = ["noise_mm", "noise_mn", "scatter_percent", "zero_mn", "correlation", "beats", "frames", "markers", "target_percent", "power", "division", "axes", "preset"];
// Settings of a run that a plan has, too.
const OF_RUN = ["division", "accuracy_mm", "effects", "preset", "without", "low_pass_hz", "peel_width_beats", "axes", "genes"];
const OF_MODEL = ["division", "preset", "axes"];

let dataset = null;
let effects = null;
let presets = null;
let runs = [];

const form = () => $("plan-form");
const field = (name) => form().elements.namedItem(name);
const boxes = (name) => [...form().querySelectorAll(`input[type=checkbox][name=${name}]`)];
const ticked = (name) => boxes(name).filter((box) => box.checked).map((box) => box.value);

export function setUpForm({ onStart }) {
  form().addEventListener("submit", (event) => {
    event.preventDefault();
    onStart();
  });
  form().addEventListener("input", follow);
}

// Show the form for ``next``, with its defaults. The newest run that fits gives the genes.
export async function showForm(next) {
  dataset = next;
  runs = [];
  form().reset();
  showFaults(null);
  const forces = isForces(next);
  for (const node of form().querySelectorAll("[data-of]")) node.hidden = node.dataset.of !== next.kind;
  $("plan-frames").textContent = `${forces ? "Samples" : "Frames"} per beat`;
  $("plan-recordings").replaceChildren(...next.recordings.map(({ name, held_out: held }) => tick(name, held ? `${name} (held out)` : name, !held, "", "recordings")));
  field("at").replaceChildren(new Option("described", ""));
  follow();
  try {
    const [known, models, page] = await Promise.all([
      effects ?? get("effects").then((answer) => answer.effects), forces ? presets ?? get("models").then((answer) => answer.presets) : presets,
      get(`runs?dataset_id=${part(next.id)}&state=SUCCEEDED&limit=${MOST_RUNS}`)]);
    [effects, presets] = [known, models];
    if (dataset !== next) return;
    runs = page.items;
  } catch (error) {
    if (dataset === next) toast(error.message);
    return;
  }
  if (forces) field("preset").replaceChildren(...presets.map(({ name }) => new Option(PRESETS[name] ?? spoken(name), name)));
  $("plan-suspects").replaceChildren(...effectFamilies(fitting(), [], "suspects"));
  field("at").append(...runs.map((run) => new Option(`found by ${runName(run)}`, run.id)));
  field("at").value = runs.find((run) => run.fit_badge !== "wrong")?.id ?? "";
  follow();
}

const fitting = () => (effects ?? []).filter((effect) => effect.applies_to.includes(isForces(dataset) ? "vehicle" : "wing"));
const run = () => runs.find(({ id }) => id === field("at").value) ?? null;

// What depends on other fields, and what the folded settings differ in.
function follow() {
  $("plan-suspects-part").hidden = field("compare").value !== "these";
  for (const label of OF_MODEL.map((name) => field(name).closest("label"))) label.hidden = label.dataset.of !== dataset.kind || Boolean(run()); // the run has its model
  const changed = STATED.filter((name) => shown(name) && field(name).value !== (DEFAULTS[name] ?? (name === "preset" ? field(name).options[0]?.value ?? "" : "")))
    .map((name) => `${caption(name)} ${field(name).value}`);
  const [chosen, fitted] = [ticked("recordings"), dataset.recordings.filter((one) => !one.held_out)];
  const count = chosen.length === fitted.length && fitted.every(({ name }) => chosen.includes(name)) ? null : plural(chosen.length, "recording");
  const words = [run() ? "model of the run" : null, count, ...changed].filter(Boolean);
  $("plan-summary").textContent = words.length ? `Settings: ${words.join("; ")}` : "Settings: noise, beats, frames and recordings as they are";
}

const shown = (name) => !field(name).closest("[data-of]")?.hidden;
const caption = (name) => field(name).closest("label").firstChild.textContent.trim() || $("plan-frames").textContent;

// How many effects are compared, recordings counted, and bodies simulated: what the time depends on.
export function effort() {
  const compared = { all: fitting().length, none: 0, these: ticked("suspects").length || fitting().length }[field("compare").value];
  const division = run()?.spec.division ?? field("division").value;
  return { effects: compared, recordings: ticked("recordings").length || 1, bodies: Number(division) || 11, more: field("add").value !== "0" };
}

// The body of the request; of a run come its model, and the genes that it found.
export async function values() {
  const compare = field("compare").value;
  const body = { suspects: compare === "none" ? null : compare === "these" ? ticked("suspects") : [] };
  const recordings = ticked("recordings");
  const usual = dataset.recordings.filter((one) => !one.held_out).map(({ name }) => name);
  if (recordings.join("\n") !== usual.join("\n")) body.recordings = recordings.length ? recordings : [""];
  for (const name of ["add", ...STATED]) {
    const input = field(name);
    if (!shown(name)) continue;
    if (name === "axes") body.axes = input.value.split(" ");
    else if (input.tagName === "SELECT") body[name] = input.value;
    else if (input.validity.badInput) body[name] = NO_NUMBER;
    else if (input.value !== "") body[name] = Number(input.value);
  }
  const best = run();
  if (!best) return body;
  const { genes } = await get(`runs/${part(best.id)}/genome`);
  const model = Object.fromEntries(Object.entries(request(best)).filter(([name, value]) => OF_RUN.includes(name) && value !== null));
  return { ...body, ...model, genome: Object.fromEntries(genes.map((gene) => [gene.name, gene.best])) };
}

// Show what is wrong at the fields that it names, and the rest in the box below; null: nothing is wrong.
export function showFaults(error, focus = true) {
  for (const node of form().querySelectorAll(".fault")) node.remove();
  for (const control of form().querySelectorAll("[aria-describedby]")) control.removeAttribute("aria-describedby");
  const placed = [];
  const rest = (error?.errors ?? []).filter((item) => !place(item, placed));
  showErrors(form(), $("plan-errors"), error && { message: error.message, errors: rest });
  for (const control of placed) control.setAttribute("aria-invalid", "true");
  const first = [...form().elements].find((control) => placed.includes(control));
  if (focus) first?.focus();
}

// Write ``item`` at its field, which is unfolded; false if it names none that is shown.
function place(item, placed) {
  const name = item.where.split(".").filter((one) => one !== "body" && !/^\d+$/.test(one))[0];
  const node = name ? form().querySelector(`[data-field="${CSS.escape(name)}"]`) : null;
  if (!node || node.closest("[hidden]")) return false;
  const known = node.querySelector(".fault"); // of a list, an entry for each of its items
  if (known) {
    known.append(`; ${item.message}`);
    return true;
  }
  const control = node.querySelector("input, select");
  const note = el("small", { className: "fault", id: `plan-fault-${name}` }, item.message);
  node.append(note);
  node.closest("details")?.setAttribute("open", "");
  control.setAttribute("aria-describedby", note.id);
  placed.push(control);
  return true;
}

