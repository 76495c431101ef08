// The files of a film: cameras.yaml and a video for each camera, sent one after the other, with progress and rate.

import { ApiError, part } from "../base/api.js";
import { $, duration, el, plural, size, toast } from "../base/format.js";

const CALIBRATION = "cameras";
const RATE_S = 3; // time over which the rate is measured

let film = null;
let queue = []; // {film, slot, file}
let sending = null; // {film, slot, file, request, loaded, samples}
let errors = new Map(); // by film and slot
let onStored = () => {};

export function setUpUpload(given) {
  onStored = given;
  const drop = $("film-drop");
  const input = $("film-picked");
  $("film-pick").addEventListener("click", () => input.click());
  input.addEventListener("change", () => {
    sort([...input.files]);
    input.value = ""; // so that the same file, changed, can be chosen again
  });
  const over = (on) => (event) => {
    event.preventDefault();
    drop.classList.toggle("over", on);
  };
  for (const [name, on] of [["dragenter", true], ["dragover", true], ["dragleave", false]]) drop.addEventListener(name, over(on));
  drop.addEventListener("drop", (event) => {
    over(false)(event);
    sort([...event.dataTransfer.files]);
  });
  window.addEventListener("beforeunload", (event) => { if (sending) event.preventDefault(); });
}

const key = (id, slot) => `${id} ${slot}`;

// Show the files of ``next``.
export function showFiles(next) {
  if (film?.id !== next.id) $("film-unmatched").hidden = true;
  film = next;
  draw();
}

const slots = () => [
  { slot: CALIBRATION, title: "cameras.yaml", what: "calibration of the cameras", there: film.calibration && !film.missing.includes(CALIBRATION), accept: ".yaml,.yml" },
  ...film.cameras.map((camera) => ({ slot: camera.name, title: camera.name, what: "video", there: camera.bytes !== null && !film.missing.includes(camera.name), camera, accept: "video/*,.avi,.mkv,.mov,.mp4" })),
];

// Give each file to the camera whose name it contains; the longest name counts.
function sort(files) {
  const unmatched = [];
  for (const file of files) {
    const stem = file.name.toLowerCase();
    const fitting = film.cameras.map((one) => one.name).filter((name) => stem.includes(name.toLowerCase()));
    if (/\.ya?ml$/.test(stem)) add(CALIBRATION, file);
    else if (fitting.length) add(fitting.reduce((best, name) => (name.length > best.length ? name : best)), file);
    else unmatched.push(file.name);
  }
  $("film-unmatched").hidden = !unmatched.length;
  $("film-unmatched").textContent = `${unmatched.join(", ")}: the name contains none of the cameras' (${film.cameras.map((one) => one.name).join(", ")}); choose the file at its camera below.`;
}

// Send ``file`` to the place ``slot`` of the film that is shown, after those before it; cameras.yaml goes first.
export function add(slot, file, of = film) {
  queue = queue.filter((one) => one.film.id !== of.id || one.slot !== slot);
  if (slot === CALIBRATION) queue.unshift({ film: of, slot, file });
  else queue.push({ film: of, slot, file });
  errors.delete(key(of.id, slot));
  draw();
  if (!sending) next();
}

async function next() {
  const one = queue.shift();
  if (!one) return;
  sending = { ...one, loaded: 0, samples: [] };
  draw();
  try {
    onStored(await send(sending));
  } catch (error) {
    if (error.message) errors.set(key(one.film.id, one.slot), error);
    if (error.message && film?.id !== one.film.id) toast(`${one.file.name}: ${error.message}`);
  } finally {
    sending = null;
    draw();
    next();
  }
}

// XMLHttpRequest, because fetch does not report the progress of an upload.
function send(one) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    one.request = request;
    request.open("PUT", `v1/films/${part(one.film.id)}/files/${part(one.slot)}`);
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.responseType = "json";
    request.upload.onprogress = ({ loaded }) => {
      const now = performance.now() / 1e3;
      one.loaded = loaded;
      one.samples = [...one.samples.filter(([time]) => now - time < RATE_S), [now, loaded]];
      draw();
    };
    request.onload = () => {
      const answer = request.response ?? {};
      if (request.status < 300) resolve(answer);
      else reject(new ApiError(answer.detail || `${request.status} ${request.statusText}`, { status: request.status, errors: answer.errors ?? [] }));
    };
    request.onerror = () => reject(new ApiError("The upload was interrupted: the server does not answer, or refused the file because of its size. Choose the file again."));
    request.onabort = () => reject(new ApiError(""));
    request.send(one.file);
  });
}

function draw() {
  if (!film) return;
  const missing = slots().filter((one) => !one.there).map((one) => one.title);
  const gone = film.missing.length ? "Backups do not contain films: upload the missing files again. " : "";
  $("film-files-note").textContent = missing.length ? `${gone}Missing: ${missing.join(", ")}. Files that are here stay here when the page is reloaded.` : "All files are here.";
  $("film-drop").hidden = !missing.length;
  const open = slots().map(row);
  if ($("film-files").children.length !== open.length) $("film-files").replaceChildren(...open.map(([item]) => item));
  else open.forEach(([item, mark], k) => {
    const old = $("film-files").children[k];
    if (old.dataset.mark === mark) return;
    const focused = old.contains(document.activeElement);
    old.replaceWith(item);
    if (focused) item.querySelector("button")?.focus();
  });
}

// The item of a file, and a text that is another one when it has to be drawn anew.
function row({ slot, title, what, there, camera, accept }) {
  const mine = sending?.film.id === film.id && sending.slot === slot ? sending : null;
  const waits = queue.find((one) => one.film.id === film.id && one.slot === slot);
  const error = errors.get(key(film.id, slot));
  const state = mine ? progress(mine) : waits ? `${waits.file.name} waits` : there ? stored(camera) : `${what} missing`;
  const input = el("input", { type: "file", accept, hidden: true, ariaLabel: `File of ${title}` });
  input.addEventListener("change", () => input.files.length && add(slot, input.files[0]));
  const button = mine
    ? el("button", { type: "button", ariaLabel: `Cancel the upload of ${title}`, onclick: () => mine.request.abort() }, "Cancel")
    : el("button", { type: "button", ariaLabel: `${there ? "Replace" : "Choose"} ${title}`, onclick: () => input.click() }, there ? "Replace" : "Choose");
  const item = el("li", {}, el("div", {}, el("strong", {}, title), " ", el("span", { className: there && !mine ? "badge good" : "badge" }, there && !mine ? "here" : mine ? "uploading" : waits ? "waiting" : "missing"),
    el("p", { className: "quiet" }, state)), el("span", {}, button, input), mine ? bar(mine) : null, error ? fault(error) : null);
  item.dataset.mark = [state, there, Boolean(mine), error?.text].join("|");
  return [item, item.dataset.mark];
}

const stored = (camera) => (camera ? [size(camera.bytes), camera.frames === null ? null : plural(camera.frames, "frame"), `${camera.width_px} × ${camera.height_px} pixels`,
  camera.rate_hz ? `${Number(camera.rate_hz.toPrecision(6))} frames per second` : null].filter(Boolean).join(", ") : "calibration of all cameras");

function progress({ file, loaded, samples }) {
  if (loaded >= file.size) return `Checking ${file.name}`;
  const [first, last] = [samples[0], samples.at(-1)];
  const rate = samples.length > 1 && last[0] > first[0] ? (last[1] - first[1]) / (last[0] - first[0]) : null;
  const left = rate ? duration((file.size - loaded) / rate) : null;
  return [`${file.name}: ${size(loaded)} of ${size(file.size)}`, rate ? `${size(rate)}/s` : null, left ? `${left} left` : null].filter(Boolean).join(", ");
}

function bar({ file, loaded }) {
  const node = el("div", { className: "bar" }, el("span"));
  node.firstElementChild.style.width = `${(100 * loaded) / Math.max(file.size, 1)}%`;
  return node;
}

function fault(error) {
  const items = error.errors.map((one) => el("li", {}, [one.where, one.message].filter(Boolean).join(": ")));
  return el("div", { className: "error", role: "alert" }, el("p", {}, error.message), items.length ? el("ul", {}, ...items) : null);
}
