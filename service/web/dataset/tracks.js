// Tracked markers of a dataset: the picture in 3-D with its choices, and the distances to the described positions.

import { get, part } from "../base/api.js";
import { $, DASH, el, fixed, plural, rounded, toast } from "../base/format.js";
import { recordingOptions } from "../base/labels.js";
import { drawScene, FAR, fixedParts } from "./scene.js";
import { hideSamples, redrawSamples, setUpSamples, showSamples } from "./samples.js";

const BEAT_MS = 3000;
const LEAST_MS = 80;
const MOST_BEATS = 400; // that can be chosen
const FEWEST_FRAMES = 6; // of a beat that can be looked at by itself

let dataset = null;
let wing = null;
let tracks = null;
let parts = null;
let timer = null;
let request = 0;
let turnable = false; // whether turning the picture places the names anew
let onNoise = () => {};

export function setUpTracks(hooks) {
  onNoise = hooks.onNoise;
  setUpSamples();
  $("picture-recording").addEventListener("change", () => load());
  $("picture-beat").addEventListener("change", () => load($("picture-beat").value));
  for (const id of ["picture-described", "picture-view", "picture-names"]) $(id).addEventListener("change", drawPicture);
  $("picture-phase").addEventListener("input", () => { stop(); drawPicture(); });
  $("picture-play").addEventListener("click", () => (timer ? stop() : play()));
}

export function hideTracks() {
  stop();
  request += 1;
  [dataset, wing, tracks, parts] = [null, null, null, null];
  hideSamples();
}

export async function showTracks(next) {
  dataset = next;
  $("picture-recording").replaceChildren(...recordingOptions(dataset));
  try {
    const found = await get(`datasets/${part(next.id)}/wing`);
    if (dataset !== next) return;
    wing = found;
  } catch (error) {
    $("picture-note").textContent = error.message;
    return;
  }
  await load();
}

export const redrawTracks = () => {
  if (tracks) drawPicture();
  redrawSamples();
};

async function load(beat = "") {
  const mine = ++request;
  const name = $("picture-recording").value;
  stop();
  try {
    const found = await get(`datasets/${part(dataset.id)}/tracks?recording=${part(name)}${beat ? `&beat=${beat}` : ""}`);
    if (mine !== request) return;
    tracks = found;
  } catch (error) {
    if (mine === request) $("picture-note").textContent = error.message;
    return;
  }
  parts = fixedParts(wing, tracks);
  if (!beat) fillBeats();
  $("picture-phase").max = Math.max(0, tracks.phase.length - 1);
  $("picture-phase").value = Math.min(Number($("picture-phase").value), Number($("picture-phase").max));
  sayDistance();
  listDistances();
  onNoise(tracks.noise, wing);
  const charts = [drawPicture()];
  if (!beat) charts.push(showSamples(dataset, tracks, wing));
  await Promise.all(charts);
}

function fillBeats() {
  const single = tracks.beats > 1 && tracks.frames / tracks.beats >= FEWEST_FRAMES;
  const count = single ? Math.min(tracks.beats, MOST_BEATS) : 0;
  $("picture-beat").replaceChildren(new Option(`mean of ${plural(tracks.beats, "beat")}`, ""),
    ...Array.from({ length: count }, (_, k) => new Option(`beat ${k + 1}`, String(k + 1))));
  $("picture-beat").parentElement.hidden = !single;
}

function sayDistance() {
  const { misfit_mm: misfit, misfit_percent: percent, start, frames, beats } = tracks;
  const far = percent !== null && percent > 100 * FAR;
  const parted = [
    misfit === null ? "No frame shows a marker."
      : el("span", { className: far ? "bad-word" : "good-word" }, `${rounded(misfit)} mm, ${rounded(percent, 2)} % of the span`),
    misfit === null ? "" : `: root mean square distance from the described positions, turned about the hinge. `,
    far ? "That is far: compare axes, signs, unit and names, unless the wing folds." : "An elastic wing leaves 0.3 to 6 %.",
    ` ${frames.toLocaleString("en")} frames of ${plural(beats, "beat")}; phase 0: ${start === "time 0" ? "time 0" : "the reference markers pass the hinge upwards"}.`,
  ];
  $("picture-note").replaceChildren(...parted);
}

// The markers farthest from where they are described come first.
function listDistances() {
  const rest = new Map(wing.markers.map((one) => [one.name, one.position_mm]));
  const number = (text) => el("td", { className: "n" }, text);
  const order = tracks.markers.map((_, m) => m).sort((a, b) => (tracks.distance_mm[b] ?? -1) - (tracks.distance_mm[a] ?? -1));
  $("distances").tBodies[0].replaceChildren(...order.map((m) => {
    const name = tracks.markers[m];
    const distance = tracks.distance_mm[m];
    const row = el("tr", {}, el("th", { scope: "row" }, name), number(distance === null ? DASH : rounded(distance)),
      number(tracks.missing[m].toLocaleString("en")), ...(rest.get(name) ?? [null, null, null]).map((value) => number(fixed(value, 1))));
    if (distance > FAR * wing.span_mm) row.classList.add("far");
    return row;
  }));
}

async function drawPicture() {
  if (!tracks?.phase.length) return;
  const frame = Math.min(Number($("picture-phase").value), tracks.phase.length - 1);
  const text = tracks.phase[frame].toFixed(2);
  $("picture-phase-value").textContent = text;
  $("picture-phase").setAttribute("aria-valuetext", `phase ${text} of the beat`);
  const shown = { wing, tracks, parts, frame, turned: $("picture-described").value === "turned", names: $("picture-names").checked, view: $("picture-view").value };
  await drawScene($("picture"), shown).catch((error) => toast(error.message));
  if (!turnable) $("picture").on?.("plotly_relayout", () => $("picture-names").checked && !timer && drawPicture()); // names have room elsewhere
  turnable = true;
}

function play() {
  if (!tracks) return;
  const step = () => {
    $("picture-phase").value = (Number($("picture-phase").value) + 1) % tracks.phase.length;
    drawPicture();
  };
  timer = setInterval(step, Math.max(LEAST_MS, BEAT_MS / tracks.phase.length));
  $("picture-play").textContent = "Pause";
  $("picture-play").setAttribute("aria-pressed", "true");
}

function stop() {
  clearInterval(timer);
  timer = null;
  $("picture-play").textContent = "Play";
  $("picture-play").setAttribute("aria-pressed", "false");
}
