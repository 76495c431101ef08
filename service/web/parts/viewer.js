// The wing: choice of recording, genome and phase, and playback.

import { get, part } from "../base/api.js";
import { $, mm, significant } from "../base/format.js";
import { recordingOptions } from "../base/labels.js";
import { clearLoads, setUpLoads, showLoads } from "./loads.js";
import { byPhase, drawBeat, drawWing, meanDistance } from "./wing.js";

const BEAT_MS = 3000;
const REFRESH_MS = 15000;

let run = null;
let tracks = null;
let requested = "";
let fetchedAt = 0;
let timer = null;
let request = 0;
let restart = false;

const genome = () => document.querySelector("input[name=genome]:checked").value;

export function setUpViewer() {
  setUpLoads();
  $("recording").addEventListener("change", () => load());
  document.querySelectorAll("input[name=genome]").forEach((input) => input.addEventListener("change", () => load()));
  $("phase").addEventListener("input", () => { stop(); draw(); });
  $("play").addEventListener("click", () => (timer ? stop() : play()));
}

// Show a run; its best genome may have changed since the last call.
export function showWing(next, dataset) {
  const changed = run?.id !== next.id;
  const ended = run?.state !== next.state;
  run = next;
  if (changed) {
    stop();
    tracks = null;
    clearLoads();
    $("recording").replaceChildren(...recordingOptions(dataset));
  }
  const hasBest = run.generations > 0;
  document.querySelector("input[name=genome][value=best]").disabled = !hasBest;
  if (!hasBest) document.querySelector("input[name=genome][value=nominal]").checked = true;
  else if (restart) document.querySelector("input[name=genome][value=best]").checked = true;
  restart = !hasBest;
  const stale = run.state === "RUNNING" && genome() === "best" && Date.now() - fetchedAt > REFRESH_MS;
  if (changed || ended || stale || key() !== requested) load({ quiet: !changed });
}

export function hideWing() {
  stop();
  request += 1;
  [run, tracks] = [null, null];
  clearLoads();
}

export function redrawWing() {
  if (tracks) draw();
}

const key = () => `${run.id}/${$("recording").value}/${genome()}`;

async function load({ quiet = false } = {}) {
  const mine = ++request;
  requested = key();
  fetchedAt = Date.now();
  if (!quiet) $("wing-note").textContent = "Simulating…";
  const query = new URLSearchParams({ recording: $("recording").value, genome: genome() });
  try {
    const answer = await get(`runs/${part(run.id)}/comparison?${query}`);
    if (mine !== request) return;
    tracks = byPhase(answer);
  } catch (error) {
    if (mine !== request) return;
    $("wing-note").textContent = error.message;
    clearLoads();
    return;
  }
  const slider = $("phase");
  slider.max = tracks.phase.length - 1;
  const which = genome() === "best" ? (run.state === "SUCCEEDED" ? "best genome" : "best genome so far") : "nominal genome";
  $("wing-note").textContent = `Mean distance ${mm(meanDistance(tracks))} mm per marker on ${tracks.recording} with the ${which}. `
    + (tracks.stride > 1 ? `Shown is, and the mean is over, one instant in ${tracks.stride}. ` : "")
    + `Solved with ${tracks.numerics.steps_per_beat} steps per beat, estimated error ${significant(tracks.numerics.estimated_error_mm, 2)} mm.`;
  draw();
  showLoads(run, tracks.recording, genome(), genome() === "best" ? run.generations : 0);
}

async function draw() {
  const frame = Math.min(Number($("phase").value), tracks.phase.length - 1);
  const text = tracks.phase[frame].toFixed(2);
  $("phase-value").textContent = text;
  $("phase").setAttribute("aria-valuetext", `phase ${text} of the beat`);
  try {
    await Promise.all([drawWing($("wing"), tracks, frame), drawBeat($("beat"), tracks, frame)]);
  } catch (error) {
    $("wing-note").textContent = error.message;
  }
}

function play() {
  if (!tracks) return;
  // Stroboscopic recordings have more frames than can be drawn in a beat.
  const stride = Math.ceil(tracks.phase.length / 45);
  const step = () => {
    $("phase").value = (Number($("phase").value) + stride) % tracks.phase.length;
    draw();
  };
  timer = setInterval(step, Math.max(60, (BEAT_MS * stride) / tracks.phase.length));
  $("play").textContent = "Pause";
  $("play").setAttribute("aria-pressed", "true");
}

function stop() {
  clearInterval(timer);
  timer = null;
  $("play").textContent = "Play";
  $("play").setAttribute("aria-pressed", "false");
}
