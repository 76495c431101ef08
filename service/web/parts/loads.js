// Loads over one beat: torques, powers, forces, bending moments, energies.

import { get, part } from "../base/api.js";
import { $, keyNumber, rounded, significant } from "../base/format.js";
import { lines } from "../base/plots.js";

const OUTPUTS = ["motors", "air", "strips", "sections", "power", "energy", "averages"];

const CUTS_SHOWN = 6;
const SETTLED_MS = 400;

let wanted = null;
let shown = "";
let request = 0;
let loads = null;
let visible = false;

// Loads are simulated only when their section stays visible: sections above it appear one after the other.
export function setUpLoads() {
  let settling = null;
  new IntersectionObserver((entries) => {
    visible = entries.at(-1).isIntersecting;
    clearTimeout(settling);
    if (visible) settling = setTimeout(load, SETTLED_MS);
  }).observe($("loads-section"));
}

// Show the loads of a run under a recording's condition; ``version`` changes when the genome may have changed.
export function showLoads(run, recording, genome, version) {
  wanted = { run, recording, genome, key: [run.id, recording, genome, version].join("/") };
  load();
}

export function clearLoads() {
  [wanted, loads, shown] = [null, null, ""];
  request += 1;
  $("loads-note").textContent = "";
  $("loads").hidden = true;
}

export function redrawLoads() {
  if (loads) draw();
}

async function load() {
  if (!wanted || !visible || wanted.key === shown) return;
  const mine = ++request;
  const { run, recording, genome, key } = wanted;
  shown = key;
  if (!loads) $("loads-note").textContent = "Simulating…";
  const query = new URLSearchParams([["recording", recording], ["genome", genome], ...OUTPUTS.map((name) => ["outputs", name])]);
  try {
    const answer = await get(`runs/${part(run.id)}/loads?${query}`);
    if (mine !== request) return;
    loads = answer;
  } catch (error) {
    if (mine !== request) return;
    shown = "";
    loads = null;
    $("loads").hidden = true;
    $("loads-note").textContent = error.message;
    return;
  }
  const off = Math.abs(loads.outputs.averages.closing_error_percent);
  $("loads-note").textContent = `${recording}, ${genome} genome, one periodic beat; phase 0 is where the wing crosses the horizontal `
    + `upwards. The energy balance closes to ${rounded(off, 2)} % of the energy entering the wing.`;
  $("loads").hidden = false;
  drawAverages(loads.outputs.averages);
  draw();
}

function drawAverages(means) {
  const cell = (label, value, unit) => keyNumber(label, significant(value, 3), unit);
  const { front, rear } = means.peak_motor_torque_n_m;
  const peak = keyNumber("peak torque, front and rear motor, N m", `${significant(front, 2)}, ${significant(rear, 2)}`);
  $("loads-numbers").replaceChildren(
    cell("mean lift", means.lift_n, "N"), cell("mean thrust", means.thrust_n, "N"),
    cell("supplied by both motors", means.supplied_w, "W"), cell("transferred to the air", means.to_air_w, "W"),
    cell("lost in the wing's dampers", means.dissipated_w, "W"), peak,
  );
}

async function draw() {
  const out = loads.outputs;
  const torque = out.motor_torque_n_m;
  const power = out.power_w;
  const [kinetic, elastic, gravitational] = ["kinetic", "elastic", "gravitational"].map((kind) => out.energy_j[kind]);
  // A few evenly spaced sections, including the root.
  const stride = Math.ceil(out.sections.length / CUTS_SHOWN);
  const cuts = out.sections.filter((_, s) => s % stride === 0).map((section) => [
    section.name === "root" ? "root" : `${significant(section.span_mm, 3)} mm`, section.moment_n_m.map((moment) => moment[0]),
  ]);
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const middle = out.strips.map((strip) => mean(strip.span_mm));
  const byStrip = (key) => out.strips.map((strip) => mean(strip[key]));
  await Promise.all([
    lines($("load-torque"), out.phase, [["front", torque.front], ["rear", torque.rear]], { unit: "N m" }),
    lines($("load-power"), out.phase, [
      ["front motor", power.front_motor], ["rear motor", power.rear_motor], ["air", power.air], ["dampers", power.dampers],
    ], { unit: "W" }),
    lines($("load-air"), out.phase, [["lift", out.lift_n], ["thrust", out.thrust_n]], { unit: "N" }),
    lines($("load-strips"), middle, [["lift", byStrip("lift_n")], ["thrust", byStrip("thrust_n")]],
      { unit: "N", x: "mm along the span", dots: true }),
    lines($("load-bending"), out.phase, cuts, { unit: "N m", shades: true }),
    lines($("load-energy"), out.phase, [["kinetic", kinetic], ["elastic", elastic], ["gravitational", gravitational]], { unit: "J" }),
  ]).catch((error) => { $("loads-note").textContent = error.message; });
}
