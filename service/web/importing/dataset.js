// Recordings that were imported, the description of their wing, and the dataset that is made of both.

import { ApiError } from "../base/api.js";
import { save } from "../base/download.js";
import { $, el, toast } from "../base/format.js";
import { send } from "../pages/submit.js";
import { describe } from "./description.js";
import { chosenNames } from "./understood.js";
import { zip } from "./zip.js";

const NEEDED = ["name", "rig", "flap_frequency_hz", "phase_lag_deg", "pressure_mbar", "temperature_c"];
const NUMBERS = ["flap_frequency_hz", "phase_lag_deg", "pressure_mbar", "temperature_c", "airspeed_m_s", "angle_of_attack_deg", "gravity_m_s2",
  "window_from", "window_to", "standard_deviation_mm"];
const NUMBER = /^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$/; // as dataset.yaml has them

let recordings = [];
let hooks = {};

export function setUpDataset(given) {
  hooks = given;
  $("import-recording").addEventListener("submit", add);
  $("import-dataset").addEventListener("submit", store);
  $("import-archive").addEventListener("click", download);
  $("import-description-pick").addEventListener("click", () => $("import-description-file").click());
  $("import-description-file").addEventListener("change", async () => {
    const [file] = $("import-description-file").files;
    if (file) $("import-dataset").description.value = await file.text();
    $("import-description-file").value = "";
  });
}

const label = (form, name) => form.elements.namedItem(name).closest("label").firstChild.textContent.trim();

function values(form) {
  const named = Object.fromEntries([...NEEDED, ...NUMBERS].map((name) => [name, form.elements.namedItem(name).value.trim()]));
  return { ...named, held_out: form.held_out.checked };
}

// What is wrong with the conditions, by field.
function faults(form, given) {
  const found = NEEDED.filter((name) => !given[name]).map((name) => [name, `${label(form, name)}: is empty; state it`]);
  for (const name of NUMBERS) {
    if (given[name] && !NUMBER.test(given[name])) found.push([name, `${label(form, name)}: “${given[name]}” is no number; write it like 0.03`]);
  }
  if (!given.window_from !== !given.window_to) found.push(["window_to", "Give both ends of the part that is used, or none"]);
  if (given.name && !/^[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9_-])?$/.test(given.name)) {
    found.push(["name", `“${given.name}” is no name of a recording; use letters, digits, ., _ and -, the first a letter or digit`]);
  }
  if (recordings.some((one) => one.name === given.name)) found.push(["name", `the dataset has a recording ${given.name}; give another name, or remove that one`]);
  return found;
}

function showFaults(form, box, found) {
  const wrong = new Set(found.map(([name]) => name));
  for (const field of form.elements) {
    if (wrong.has(field.name)) field.setAttribute("aria-invalid", "true");
    else field.removeAttribute?.("aria-invalid");
  }
  box.hidden = !found.length;
  box.replaceChildren(el("ul", {}, ...found.map(([, text]) => el("li", {}, text))));
}

async function add(event) {
  event.preventDefault();
  const form = $("import-recording");
  const given = values(form);
  const tracks = hooks.currentTracks();
  const found = faults(form, given);
  if (tracks.frame !== "wing") found.push(["", "Axes: a dataset of a wing has x aft, y out, z up; state above how the axes of the file lie (aft or fore, out or in, up or down)"]);
  showFaults(form, $("import-recording-errors"), found);
  if (found.length) return;
  try {
    const csv = await hooks.table();
    recordings.push({ ...given, csv, frames: tracks.frames, markers: chosenNames() });
  } catch (error) {
    showFaults(form, $("import-recording-errors"), [["", error.text ?? error.message]]);
    return;
  }
  form.elements.namedItem("name").value = "";
  draw();
  toast(`Added ${given.name}`);
  $("import-dataset-title").focus();
  $("import-dataset-title").scrollIntoView({ block: "start" });
}

function draw() {
  $("import-dataset-part").hidden = !recordings.length;
  $("import-names").textContent = `The wing must list these markers: ${[...new Set(recordings.flatMap((one) => one.markers))].join(", ")}.`;
  $("import-recordings").tBodies[0].replaceChildren(...recordings.map((one) => el("tr", {},
    el("td", {}, one.name), el("td", {}, el("span", { className: one.held_out ? "badge held" : "badge" }, one.held_out ? "held out" : "to fit")),
    el("td", { className: "n" }, one.frames.toLocaleString("en")), el("td", { className: "n" }, String(one.markers.length)),
    el("td", { className: "prose" }, conditions(one)),
    el("td", {}, el("button", { type: "button", ariaLabel: `Remove ${one.name}`, onclick: () => remove(one) }, "Remove")))));
}

const conditions = (one) => [one.rig.replace("_", " "), `${one.flap_frequency_hz} Hz`, `lag ${one.phase_lag_deg}°`, `${one.pressure_mbar} mbar`,
  `${one.temperature_c} °C`, one.airspeed_m_s && `${one.airspeed_m_s} m/s`, one.angle_of_attack_deg && `${one.angle_of_attack_deg}°`].filter(Boolean).join(", ");

function remove(recording) {
  recordings = recordings.filter((one) => one !== recording);
  draw();
}

function archive() {
  const form = $("import-dataset");
  const name = form.elements.namedItem("name").value.trim();
  if (!name) throw new ApiError("The dataset has no name; give it one.");
  const files = { "dataset.yaml": describe(form.description.value, name, recordings) };
  for (const one of recordings) files[`recordings/${one.name}.csv`] = one.csv;
  return zip(files);
}

async function download() {
  showError(null);
  try {
    save(await archive(), `${$("import-dataset").elements.namedItem("name").value.trim()}.zip`);
  } catch (error) {
    showError(error);
  }
}

async function store(event) {
  event.preventDefault();
  const button = $("import-dataset").querySelector("[type=submit]");
  if (button.disabled) return;
  showError(null);
  button.disabled = true;
  try {
    const blob = await archive();
    const dataset = await send(new File([blob], "import.zip"), (fraction) => {
      $("import-dataset-state").textContent = fraction < 1 ? `Uploading, ${Math.round(100 * fraction)} %` : "Checking";
    });
    recordings = [];
    draw();
    hooks.onStored(dataset);
  } catch (error) {
    showError(error);
  } finally {
    $("import-dataset-state").textContent = "";
    button.disabled = false;
  }
}

// Every error of the upload, with its place; lines of dataset.yaml are those of the description.
function showError(error) {
  const box = $("import-dataset-errors");
  box.hidden = !error;
  if (!error) return box.replaceChildren();
  const items = (error.errors ?? []).map((item) => el("li", {}, `${item.where}: ${item.message}`));
  box.replaceChildren(el("p", {}, error.message), ...(items.length ? [el("ul", {}, ...items)] : []));
}
