// Recorded forces of a vehicle over the beat (all beats and their mean) or over time, with the motion of the wings.

import { get, part } from "../base/api.js";
import { $, plural, significant, toast, withForceUnit } from "../base/format.js";
import { QUANTITIES, recordingOptions } from "../base/labels.js";
import { axis, draw, PHASE, zeroAxis } from "../base/plots.js";
import { showForceNoise } from "./checks.js";
import { drawDirections } from "./directions.js";
import { noteOn, shades } from "./samples.js";

const WAYS = { lift: "upwards", drag: "backwards", x: "to the nose", z: "to the belly" };

let dataset = null;
let mean = null;
let samples = null;
let request = 0;

const choice = (name) => document.querySelector(`input[name=${name}]:checked`).value;

export function setUpForces() {
  $("data-forces-recording").addEventListener("change", load);
  for (const input of document.querySelectorAll("input[name=data-axes], input[name=data-over]")) input.addEventListener("change", redrawForces);
}

export function hideForces() {
  request += 1;
  [dataset, mean, samples] = [null, null, null];
}

export async function showForces(next) {
  dataset = next;
  $("data-forces-recording").replaceChildren(...recordingOptions(dataset));
  await load();
}

async function load() {
  const mine = ++request;
  const query = `recording=${part($("data-forces-recording").value)}`;
  try {
    const found = await Promise.all(["forces", "samples"].map((kind) => get(`datasets/${part(dataset.id)}/${kind}?${query}`)));
    if (mine !== request) return;
    [mean, samples] = found;
  } catch (error) {
    if (mine === request) toast(error.message);
    return;
  }
  showForceNoise(mean);
  const both = mean.forces.some((one) => one.name === "lift");
  document.querySelector("input[name=data-axes][value='lift drag']").disabled = !both;
  if (!both) document.querySelector("input[name=data-axes][value='x z']").checked = true;
  drawDirections($("force-axes"), condition().angle_of_attack_deg);
  await redrawForces();
}

const condition = () => dataset.recordings.find((one) => one.name === mean.recording);

// Forces by name: as recorded, and lift and drag of level flight (Armanini et al. 2016, Eq. 16).
function values(name) {
  const column = (axisName) => samples.channels.find((one) => one.name === axisName)?.values;
  if (name === "x" || name === "z") return column(name);
  const pitch = (condition().angle_of_attack_deg * Math.PI) / 180;
  const [sine, cosine] = [Math.sin(pitch), Math.cos(pitch)];
  const turned = name === "lift" ? (x, z) => x * sine - z * cosine : (x, z) => -x * cosine - z * sine;
  return column("x").map((x, k) => (x === null || column("z")[k] === null ? null : turned(x, column("z")[k])));
}

export async function redrawForces() {
  if (!mean) return;
  const beat = choice("data-over") === "beat";
  const names = choice("data-axes").split(" ").filter((name) => mean.forces.some((one) => one.name === name));
  const about = condition();
  const average = (name) => {
    const known = mean.forces.find((one) => one.name === name).mean_n.filter((value) => value !== null);
    return known.reduce((sum, value) => sum + value, 0) / known.length;
  };
  $("forces-note").textContent = [
    `${significant(about.flap_frequency_hz)} Hz, body pitch ${significant(about.angle_of_attack_deg)}°, ${significant(about.airspeed_m_s)} m/s; ${plural(mean.beats, "beat")}.`,
    `Mean ${names.map((name) => `${QUANTITIES[name].toLowerCase()} ${withForceUnit(average(name))}`).join(", ")}; weight ${withForceUnit(mean.weight_n)}.`,
    noteOn(samples).replace("gaps are shaded", "gaps are shaded over time"),
  ].join(" ");
  const drawn = [0, 1].map((k) => {
    const [node, title] = [$(`data-force-${k}`), $(`data-force-${k}-title`)];
    node.hidden = title.hidden = !names[k];
    if (!names[k]) return null;
    title.textContent = `${QUANTITIES[names[k]]}, positive ${WAYS[names[k]]}`;
    return draw(node, (look) => (beat ? overBeat(look, names[k]) : overTime(look, names[k])));
  });
  $("data-motion-title").textContent = `Wings, as ${mean.own_motion ? "recorded with these forces" : "described for all recordings"}: flap angle, and pitch at ${significant(mean.pitch_station)} of the span`;
  await Promise.all([...drawn, draw($("data-motion"), motion)]).catch((error) => toast(error.message));
}

const MARGIN = { l: 10, r: 8, t: 8, b: 10 };

function overBeat(look, name) {
  const all = values(name);
  const x = [];
  const y = [];
  samples.phase.forEach((phase, k) => {
    if (k && Math.floor(phase) !== Math.floor(samples.phase[k - 1])) [x, y].forEach((list) => list.push(null)); // a line for each beat
    x.push(phase % 1);
    y.push(all[k]);
  });
  const found = mean.forces.find((one) => one.name === name);
  return {
    traces: [
      { x, y, name: "all beats", type: "scatter", mode: "lines", line: { color: look.faint, width: 0.75 }, opacity: 0.45, hoverinfo: "skip" },
      { x: mean.phase, y: found.mean_n, name: "mean beat", type: "scatter", mode: "lines", line: { color: look.accent, width: 2.5 }, hovertemplate: "%{y:.3~s}N at %{x:.3f}<extra>mean beat</extra>" },
    ],
    showlegend: true, margin: { ...MARGIN, t: 26 }, xaxis: axis(look, "t*, beats; 0: wings closest", { showgrid: false, ...PHASE }), yaxis: zeroAxis(look, "N"),
  };
}

function overTime(look, name) {
  const time = samples.time_s;
  const half = time.length > 1 ? (time.at(-1) - time[0]) / (time.length - 1) / samples.stride / 2 : 0;
  const axes = name === "x" || name === "z" ? [name] : ["x", "z"];
  const gaps = samples.channels.filter((one) => axes.includes(one.name)).flatMap((one) => one.missing.gaps);
  return {
    traces: [{ x: time, y: values(name), name: "recorded", type: "scatter", mode: "lines", line: { color: look.ink, width: 1 }, hovertemplate: "%{y:.3~s}N at %{x:.4g} s<extra></extra>" }],
    shapes: shades(look, gaps, half, "y domain"), margin: MARGIN, xaxis: axis(look, "time, s", { showgrid: false, range: [time[0], time.at(-1)] }), yaxis: zeroAxis(look, "N"),
  };
}

function motion(look) {
  const curve = (name, y, colour, dash) => ({ x: mean.phase, y, name, type: "scatter", mode: "lines", line: { color: colour, width: 2, dash }, hovertemplate: `%{y:.1f}°<extra>${name}</extra>` });
  return {
    traces: [curve("flap angle", mean.flap_deg, look.series[1], "solid"), curve("wing pitch (90°: chord along the body)", mean.pitch_deg, look.series[2], "dash")],
    showlegend: true, margin: { ...MARGIN, t: 26 }, hovermode: "x unified", xaxis: axis(look, "t*, beats", { showgrid: false, ...PHASE }), yaxis: axis(look, "degrees", { nticks: 5 }),
  };
}
