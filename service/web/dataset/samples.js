// Coordinates of one marker over time or over the beat; missing samples are gaps, shaded and counted.

import { get, part } from "../base/api.js";
import { $, plural, rounded, toast } from "../base/format.js";
import { axis, draw, PHASE } from "../base/plots.js";

const SPARSE = 4; // samples per beat below which no line joins them
const MOST_SHADED = 150;
const TITLES = { x: "x aft, mm", y: "y out, mm", z: "z up, mm" };

let dataset = null;
let recording = null;
let rest = null; // rest positions by the name of the marker
let samples = null;
let request = 0;

const over = () => document.querySelector("input[name=samples-over]:checked").value;

export function setUpSamples() {
  $("samples-marker").addEventListener("change", load);
  for (const input of document.querySelectorAll("input[name=samples-over]")) input.addEventListener("change", redrawSamples);
}

export function hideSamples() {
  request += 1;
  samples = null;
}

// Show the coordinates of a marker of the recording of ``tracks``: of the one that was shown, else of one near the tip.
export async function showSamples(next, tracks, wing) {
  [dataset, recording] = [next, tracks.recording];
  rest = new Map(wing.markers.map((one) => [one.name, one.position_mm]));
  const before = $("samples-marker").value;
  const label = (name, m) => (tracks.missing[m] ? `${name} (${tracks.missing[m].toLocaleString("en")} missing)` : name);
  $("samples-marker").replaceChildren(...tracks.markers.map((name, m) => new Option(label(name, m), name)));
  $("samples-marker").value = tracks.markers.includes(before) ? before : outermost(tracks);
  await load();
}

const outermost = (tracks) => tracks.markers.reduce((far, name) => ((rest.get(name)?.[1] ?? 0) > (rest.get(far)?.[1] ?? 0) ? name : far));

async function load() {
  const mine = ++request;
  const marker = $("samples-marker").value;
  try {
    const found = await get(`datasets/${part(dataset.id)}/samples?recording=${part(recording)}&marker=${part(marker)}`);
    if (mine !== request) return;
    samples = found;
  } catch (error) {
    if (mine === request) toast(error.message);
    return;
  }
  $("samples-note").textContent = noteOn(samples);
  await redrawSamples();
}

// How many samples are missing and shown; the coordinates of a marker are missing together or one by one.
export function noteOn({ channels, samples: count, stride }) {
  const missing = channels.map((one) => one.missing.samples);
  const most = Math.max(...missing);
  const alike = missing.every((one) => one === most);
  const runs = channels[missing.indexOf(most)].missing.gaps.length;
  const gaps = !most ? `No sample of ${count.toLocaleString("en")} is missing.`
    : `${alike ? most.toLocaleString("en") : channels.map((one) => `${one.missing.samples} ${one.name}`).join(", ")} of ${count.toLocaleString("en")} samples missing (${rounded((100 * most) / count, 2)} %), in ${plural(runs, "gap")}${runs >= 200 ? " or more" : ""}; gaps are shaded.`;
  return `${gaps}${stride > 1 ? ` One in ${stride} of the samples is shown.` : ""}`;
}

export async function redrawSamples() {
  if (!samples) return;
  await draw($("samples"), (look) => chart(look, samples, over() === "beat")).catch((error) => toast(error.message));
}

// Shaded stretches where a channel has no samples; ``half`` (s) is half of the time between two samples.
export const shades = (look, gaps, half, yref) => gaps.slice(0, MOST_SHADED).map((gap) => ({
  type: "rect", xref: "x", yref, x0: gap.from_s - half, x1: gap.to_s + half, y0: 0, y1: 1, line: { width: 0 }, fillcolor: `${look.bad}2e`, layer: "below",
}));

function chart(look, { time_s: time, phase, channels, samples: count, stride, marker }, beat) {
  const beats = phase.at(-1) - phase[0];
  const dots = beat || count / Math.max(beats, 1) < SPARSE;
  const half = time.length > 1 ? (time.at(-1) - time[0]) / (time.length - 1) / stride / 2 : 0;
  const x = beat ? phase.map((value) => value % 1) : time;
  const axes = {};
  const shapes = [];
  const traces = channels.flatMap(({ name, values, missing: { gaps } }, row) => {
    const suffix = row ? row + 1 : "";
    const top = 1 - row / channels.length;
    axes[`yaxis${suffix}`] = axis(look, TITLES[name], { domain: [top - 1 / channels.length + 0.03, top - 0.02], nticks: 5 });
    const still = rest.get(marker)?.["xyz".indexOf(name)];
    if (still !== undefined) shapes.push({ type: "line", xref: "paper", x0: 0, x1: 1, yref: `y${suffix}`, y0: still, y1: still, line: { color: look.series[1], width: 1.5, dash: "dot" } });
    if (!beat) shapes.push(...shades(look, gaps, half, `y${suffix} domain`));
    const alone = values.map((value, k) => (value !== null && (values[k - 1] ?? null) === null && (values[k + 1] ?? null) === null ? value : null));
    const common = { x, type: "scatter", xaxis: "x", yaxis: `y${suffix}`, line: { color: look.ink, width: 1.25 }, marker: { color: look.ink, size: dots ? 4 : 3 },
      hovertemplate: `%{y:.2f} mm at %{x:.4g}${beat ? " of the beat" : " s"}<extra>${name}</extra>` };
    return [{ ...common, name, y: values, mode: dots ? "markers" : "lines", connectgaps: false }, ...(dots ? [] : [{ ...common, name: `${name} alone`, y: alone, mode: "markers" }])];
  });
  const last = channels.length > 1 ? channels.length : "";
  return {
    traces, shapes, ...axes, margin: { l: 10, r: 8, t: 16, b: 10 },
    annotations: [{ text: "dotted: described at rest", xref: "paper", yref: "paper", x: 1, y: 1, xanchor: "right", yanchor: "bottom", showarrow: false, font: { size: 11, color: look.series[1] } }],
    xaxis: axis(look, beat ? "phase of the beat" : "time, s", { showgrid: false, anchor: `y${last}`, ...(beat ? PHASE : { range: [time[0], time.at(-1)] }) }),
  };
}
