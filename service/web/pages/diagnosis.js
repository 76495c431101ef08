// The selected diagnosis: its progress, then its report as the server draws it.

import { follow, get, getText, isFinal, part } from "../base/api.js";
import { copy } from "../base/copying.js";
import { $, plural, toast, when } from "../base/format.js";
import { redrawPartial, showPartial } from "../diagnosing/partial.js";
import { showNotes } from "../lists/edit.js";
import { showWaiting } from "../parts/driving.js";
import { badge, setBar, timeLeft } from "../parts/sidebar.js";
import { cancel, remove } from "./submit.js";
import { fitBadge, forceSetup, isForces, modelInWords, withEffects } from "../base/labels.js";

const MOST_IN_NAME = 60; // characters of the name of a file

let diagnosis = null;
let stopFollowing = () => {};
let fetched = false;
let hooks = {};

export function setUpDiagnosis(given) {
  hooks = given;
  $("diagnosis-actions").addEventListener("click", (event) => {
    const action = event.target.dataset?.action;
    if (action) act(action);
  });
  $("finding-print").addEventListener("click", () => window.print());
  $("finding-link").addEventListener("click", () => copy(location.href));
}

// Take over name and notes of ``now``, the diagnosis as it is on the server.
export function renameDiagnosis(now) {
  if (diagnosis?.id !== now.id || (diagnosis.name === now.name && diagnosis.notes === now.notes)) return;
  diagnosis = { ...diagnosis, name: now.name, notes: now.notes };
  update();
}

export const redrawDiagnosis = () => redrawPartial();

export async function selectDiagnosis(id) {
  stopFollowing();
  stopFollowing = () => {};
  [diagnosis, fetched] = [null, false];
  $("diagnosis").hidden = true;
  showReport(null);
  showPartial(null);
  if (!id) return;
  try {
    const found = await get(`diagnoses/${part(id)}`);
    if (hooks.currentId() !== id) return;
    diagnosis = found;
  } catch (error) {
    if (hooks.currentId() === id) hooks.onMissing(error, () => !diagnosis && selectDiagnosis(id));
    return;
  }
  $("diagnosis").hidden = false;
  update();
  if (!isFinal(diagnosis)) listen();
}

function listen() {
  stopFollowing();
  stopFollowing = follow(`diagnoses/${part(diagnosis.id)}`, "step", {
    onStep(step) {
      if (step.sequence <= diagnosis.steps) return;
      const { stage, progress, evaluations, eta_seconds } = step;
      diagnosis = { ...diagnosis, stage, progress, evaluations, eta_seconds, steps: step.sequence };
      update();
    },
    onState(state) {
      diagnosis = state;
      hooks.onChange(diagnosis);
      update();
    },
    onAway: hooks.onAway,
  });
}

function update() {
  const path = `v1/diagnoses/${part(diagnosis.id)}`;
  const done = diagnosis.state === "SUCCEEDED";
  document.title = `${diagnosis.name} · wingfit`;
  $("diagnosis-name").replaceChildren(diagnosis.name, " ", fitBadge(diagnosis) ?? badge(diagnosis));
  showPartial(diagnosis);
  $("diagnosis-about").textContent = [modelInWords(diagnosis), withEffects(diagnosis), ...(isForces(diagnosis) ? forceSetup(diagnosis.spec) : []),
    diagnosis.run_id ? "from the best genome of a run" : null, when(diagnosis.created_at)].filter(Boolean).join(" · ");
  showNotes($("diagnosis-name"), "diagnoses", diagnosis, ({ name, notes }) => {
    diagnosis = { ...diagnosis, name, notes };
    update();
  });
  $("diagnosis-error").hidden = !diagnosis.error;
  $("diagnosis-error").textContent = diagnosis.error ?? "";
  showWaiting($("diagnosis-waiting"), diagnosis);
  setBar($("diagnosis-bar"), diagnosis);
  $("diagnosis-bar").hidden = done;
  $("diagnosis-progress").textContent = [done ? null : `${Math.round(100 * diagnosis.progress)} %`, timeLeft(diagnosis),
    diagnosis.state === "RUNNING" ? diagnosis.stage : null,
    plural(diagnosis.evaluations, "evaluation")].filter(Boolean).join(" · ");
  for (const id of ["report-link", "finding-exports", "finding-model", "finding-print", "finding-link"]) $(id).hidden = !done;
  for (const id of ["report-link", "finding-html"]) $(id).href = `${path}/report`;
  $("finding-html").download = `${diagnosis.name.replace(/[^\p{L}\p{N}_]+/gu, "-").slice(0, MOST_IN_NAME).replace(/^-|-$/g, "") || "finding"}.html`;
  for (const format of ["csv", "netcdf", "json"]) $(`finding-${format}`).href = `${path}/export?format=${format}`;
  offerModel(path);
  if (done && !fetched) fetchReport();
  for (const button of $("diagnosis-actions").querySelectorAll("[data-action]")) {
    button.hidden = isFinal(diagnosis) !== (button.dataset.action === "delete");
    button.disabled = Boolean(diagnosis.pending_action);
  }
}

// A verdict that names no effects for certain has several models; the page offers the one without effects.
function offerModel(path) {
  const open = ["ambiguous", "unnamed"].includes(diagnosis.verdict);
  const title = open ? "The nominal model without effects; wingfit export --hypothesis chooses another" : "The model with the effects that the verdict names";
  for (const format of ["python", "tables", "fmu", "json"]) {
    const link = $(`finding-model-${format}`);
    link.title = title;
    link.href = `${path}/model?format=${format}${open ? "&hypothesis=nominal" : ""}`;
  }
  for (const format of ["tables", "fmu"]) $(`finding-model-${format}`).hidden = diagnosis.kind === "series";
}

async function fetchReport() {
  const { id } = diagnosis;
  fetched = true;
  try {
    const text = await getText(`diagnoses/${part(id)}/report`);
    if (diagnosis?.id === id) showReport(new DOMParser().parseFromString(text, "text/html"));
  } catch (error) {
    if (diagnosis?.id === id) fetched = false;
    toast(error.message);
  }
}

// The report keeps its own style sheet: a shadow tree separates it from the page's. Its headings continue those of the page.
function showReport(report) {
  const root = $("report").shadowRoot ?? $("report").attachShadow({ mode: "open" });
  root.replaceChildren();
  if (!report) return;
  for (const heading of report.querySelectorAll("h1, h2, h3")) heading.ariaLevel = Number(heading.tagName[1]) + 2;
  root.append(...report.querySelectorAll("style, body > svg"), ...report.querySelector("main").childNodes);
}

async function act(action) {
  if (action === "delete") {
    if (await remove("diagnoses", diagnosis.id, diagnosis.name)) hooks.onDeleted();
    return;
  }
  if (action === "cancel") await cancel("diagnoses", diagnosis.id, diagnosis.name);
}
