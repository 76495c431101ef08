// Rigs of the user's own: what a job waits for, and the ways to give a dataset of series its simulation.

import { get } from "../base/api.js";
import { command, copyable, pythonWithRig } from "../base/copying.js";
import { showErrors } from "../base/form_errors.js";
import { $, el, toast } from "../base/format.js";

let installed = null;

// Say in ``box`` what a job waits for that its user simulates; hide it for others.
export function showWaiting(box, job) {
  const waits = job.driven && job.state === "QUEUED";
  box.hidden = !waits;
  const text = waits ? command(`wingfit drive ${job.id} my_rig.py`) : "";
  if (box.dataset.shown === text) return;
  box.dataset.shown = text;
  box.replaceChildren(...(waits ? [
    el("p", {}, "Waits for its simulation. Run this where your rig is, with the file that defines it:"),
    copyable(text, "command that simulates the rig for this job"),
  ] : []));
}

// ``submit(kind, rig)`` submits a job, "runs" or "diagnoses", with a rig that is installed on the server.
export function setUpSimulation(submit) {
  const form = $("installed-form");
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const buttons = form.querySelectorAll("button");
    showErrors(form, $("installed-errors"), null);
    for (const button of buttons) button.disabled = true;
    try {
      await submit(event.submitter.value, form.rig.value);
    } catch (error) {
      showErrors(form, $("installed-errors"), error);
    }
    for (const button of buttons) button.disabled = false;
  });
}

// Show how to simulate and diagnose a dataset of series.
export async function showSimulation(dataset) {
  $("own-rig").replaceChildren(
    copyable(command(`wingfit diagnose ${dataset.id} --rig my_rig.py`), "command that diagnoses this dataset"),
    copyable(command(`wingfit runs submit ${dataset.id} --rig my_rig.py`), "command that calibrates a rig to this dataset"),
    copyable(pythonWithRig(dataset.id), "Python program that diagnoses this dataset"));
  const form = $("installed-form");
  $("installed").hidden = true;
  showErrors(form, $("installed-errors"), null);
  try {
    installed ??= (await get("rigs")).rigs;
  } catch (error) {
    toast(error.message);
    return;
  }
  $("installed").hidden = !installed.length;
  $("own-rig-title").textContent = installed.length ? "With a rig of your own" : "With a rig of your own; none is installed on this server";
  form.rig.replaceChildren(...installed.map((name) => new Option(name, name)));
  if (installed.includes(dataset.rig.name)) form.rig.value = dataset.rig.name;
}
