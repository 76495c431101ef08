// The page that imports files of tracking systems (#import): file, options, what was understood, and a dataset of them.

import { ApiError, call, fill } from "../base/api.js";
import { save } from "../base/download.js";
import { $, el, size, toast } from "../base/format.js";
import { setUpDataset } from "./dataset.js";
import { answers, inWords, restart, setUpForm, showQuestions } from "./form.js";
import { setUpStart, showStart } from "./start.js";
import { setUpPreview, showPreview, stopPreview } from "./preview.js";
import { chosenMarkers, setUpUnderstood, showKnown, showTracks } from "./understood.js";

const LARGEST = 64 * 2 ** 20;

let ready = null;
let file = null;
let tracks = null;
let request = 0;
let hooks = {};
let given = null; // a file of another page, which is read when this one is shown

export function setUpImport(theirs) {
  hooks = theirs;
}

// Open this page with ``chosen``, a file that another page has.
export function importFile(chosen) {
  given = chosen;
  location.hash = "import";
}

export async function showImport(shown) {
  $("import-page").hidden = !shown;
  stopPreview();
  if (!shown) return;
  document.title = "Import tracks · wingfit";
  ready ??= build();
  try {
    await ready;
  } catch (error) {
    ready = null;
    toast(error.message);
    return;
  }
  if (given) choose([given]);
  given = null;
}

async function build() {
  await fill($("import-page"), "importing/page.html");
  setUpForm(read);
  setUpUnderstood(downloadTable);
  setUpPreview();
  setUpDataset({ ...hooks, currentTracks: () => tracks, table });
  setUpStart({ ...hooks, body, table });
  setUpFile();
}

function setUpFile() {
  const drop = $("import-drop");
  const input = $("import-file");
  $("import-pick").addEventListener("click", () => input.click());
  input.addEventListener("change", () => {
    choose(input.files);
    input.value = ""; // so that the same file, changed, can be chosen again
  });
  const over = (on) => (event) => {
    event.preventDefault();
    drop.classList.toggle("over", on);
  };
  drop.addEventListener("dragenter", over(true));
  drop.addEventListener("dragover", over(true));
  drop.addEventListener("dragleave", over(false));
  drop.addEventListener("drop", (event) => {
    over(false)(event);
    choose(event.dataTransfer.files);
  });
}

function choose(files) {
  if (!files.length) return;
  if (files.length > 1) toast(`One file at a time: ${files[0].name} is read`);
  [file] = files;
  $("import-file-name").textContent = `${file.name}, ${size(file.size)}`;
  restart();
  tracks = null;
  read();
}

// Send the file with the answers given so far, and show what the server understood.
async function read() {
  if (!file) return;
  const mine = ++request;
  showProblem(null);
  if (file.size > LARGEST) return showProblem(new ApiError(`${file.name} has ${size(file.size)}; at most 64 MiB are read here: cut the recording in parts, or use the command wingfit import.`));
  $("import-state").textContent = `Reading ${file.name}…`;
  try {
    const found = await call("POST", "imports", { body: body() });
    if (mine !== request) return;
    show(found);
  } catch (error) {
    if (mine !== request) return;
    tracks = null;
    $("import-result").hidden = true;
    showKnown(null);
    showQuestions(error.questions ?? [], error.errors ?? []);
    showProblem(error);
  } finally {
    if (mine === request) $("import-state").textContent = "";
  }
}

function body() {
  const form = new FormData();
  form.append("file", file);
  for (const [name, value] of Object.entries(answers())) form.append(name, value);
  return form;
}

function show(found) {
  tracks = found.tracks;
  showKnown(found);
  showQuestions(found.questions);
  $("import-result").hidden = !tracks;
  showStart(tracks);
  if (!tracks) return stopPreview();
  showTracks(found);
  showPreview(tracks);
  const stem = file.name.replace(/\.[^.]*$/, "").replace(/[^A-Za-z0-9._-]+/g, "_").replace(/^[._-]+|[._-]+$/g, "");
  $("import-recording").elements.namedItem("name").value ||= rowsName() || stem;
  $("import-recording-note").textContent = tracks.frame === "wing" ? "As they were set for this recording. Fields with “else” may stay empty."
    : "A dataset of a wing has the axes x aft, y out, z up: state above how the axes of the file lie (aft, fore, out, in, up, down).";
}

// The values of the rows that were chosen name the recording: a table of several has one name for all of them.
const rowsName = () => (answers().rows ?? "").split(",").map((part) => part.split("=")[1]?.trim()).filter(Boolean).join("_").replace(/[^A-Za-z0-9._-]+/g, "_");

function showProblem(error) {
  const box = $("import-errors");
  box.hidden = !error;
  $("import-options").hidden = !file;
  if (!error) return box.replaceChildren();
  const items = (error.errors ?? []).map((item) => el("li", {}, inWords(`${item.where}: ${item.message}`)));
  box.replaceChildren(el("p", {}, error.message), ...(items.length ? [el("ul", {}, ...items)] : []));
}

// The table of the chosen markers as text; ApiError says why there is none.
async function table() {
  const text = await call("POST", "imports/table", { body: body(), as: "text" });
  return chosenMarkers(text, tracks);
}

async function downloadTable() {
  try {
    save(new Blob([await table()], { type: "text/csv" }), file.name.replace(/\.[^.]*$/, "") + ".csv");
  } catch (error) {
    showProblem(error);
    $("import-errors").scrollIntoView({ block: "nearest" });
  }
}
