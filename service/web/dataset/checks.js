// What the checks of the upload say, beside the first picture and at the chart that a mistake concerns; stated noise.

import { get, part } from "../base/api.js";
import { $, el, plural, rounded, significant, toast } from "../base/format.js";
import { showWarnings } from "../parts/warnings.js";

const CONDITIONS = ["air pressure", "air temperature", "airspeed", "pressure and rig", "density", "thickness", "mass", "body pitch", "phase lag"];
const OVER_TIME = ["frequency", "time unit", "unsteady", "cut", "constant channel", "duplicate", "jumps", "frozen marker"];

// The chart, farther down, that a mistake concerns; null for one that the first picture of the page shows.
function place({ kind }, dataset) {
  if (CONDITIONS.includes(kind)) return "conditions";
  return dataset.kind === "tracks" && OVER_TIME.includes(kind) ? "samples" : null;
}

export async function showChecks(dataset, isCurrent) {
  showWarnings(dataset);
  for (const node of document.querySelectorAll("[data-beside]")) {
    const those = dataset.warnings.filter((one) => place(one, dataset) === node.dataset.beside);
    node.replaceChildren(...those.map((one) => el("p", {}, el("strong", {}, "Likely mistake: "), `${one.where}: ${one.value}; expected ${one.expected}. Change: `, el("code", {}, one.change))));
  }
  $("checks").replaceChildren();
  $("checks-summary").textContent = "The checks are being fetched"; // a summary without words has no name
  try {
    const found = await get(`datasets/${part(dataset.id)}/checks`);
    if (isCurrent()) list(found);
  } catch (error) {
    if (!isCurrent()) return;
    $("checks-summary").textContent = "The checks could not be fetched";
    toast(error.message);
  }
}

function list({ checks, carried_out: carriedOut }) {
  const clean = checks.filter((one) => !one.found).length;
  const found = clean < checks.length;
  $("checks-summary").textContent = !carriedOut ? "An earlier version stored this dataset, without checks"
    : found ? `The other ${plural(clean, "check")} found nothing` : `${plural(clean, "check")} found nothing`;
  const after = !carriedOut ? "Upload the dataset again, to have it checked by:" : found ? "A check is left out where the mistake found makes its question meaningless. Correct it, and check again." : "";
  $("checks").replaceChildren(...(after ? [el("li", {}, after)] : []), ...checks.map((one) => el("li", {},
    el("strong", {}, one.name), one.found ? el("span", { className: "badge bad" }, `found ${one.found}`) : "", ` ${one.question}`)));
}

// Rows [name, text] of stated noise; without any, what to state.
function showNoise(rows, remedy) {
  $("noise-missing").hidden = rows.length > 0;
  $("noise-missing").textContent = `Not stated; a diagnosis estimates it. To state it, write ${remedy}`;
  $("noise").replaceChildren(...rows.flatMap(([name, text]) => [el("dt", {}, name), el("dd", {}, text)]));
}

const span = (values, digits = 2) => {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  return low === high ? rounded(low, digits) : `${rounded(low, digits)} to ${rounded(high, digits)}`;
};

export function showMarkerNoise(noise, wing) {
  const rows = [];
  if (noise) {
    const deviations = noise.standard_deviation_mm;
    rows.push(["standard deviation", ["x", "y", "z"].map((name, k) => `${name} ${span(deviations.map((one) => one[k]))}`).join(", ") + " mm"]);
    const related = noise.correlation;
    rows.push(["correlation", related ? ["xy", "xz", "yz"].map((name, k) => `${name} ${span(related.map((one) => one[k]))}`).join(", ") : "not stated: taken as 0"]);
  }
  const frame = wing.frame_error;
  if (frame) {
    rows.push(["frame error", `rotation ${frame.rotation_deg.map((one) => significant(one, 2)).join(", ")}° about x, y, z; origin ${frame.origin_mm.map((one) => significant(one, 2)).join(", ")} mm`]);
  }
  if (wing.cameras.length) {
    const places = wing.cameras.map(({ name, centre_mm: at }) => `${name} at ${at.map((one) => Math.round(one)).join(", ")} mm`);
    rows.push(["cameras", places.join("; ")]);
  }
  showNoise(rows, "standard_deviation_m of the recording, frame_error and cameras in dataset.yaml.");
}

export function showForceNoise({ forces, low_pass_hz: cutoff }) {
  const rows = forces.filter((one) => one.noise_n !== null).map((one) => [`force ${one.name}`, `standard deviation ${rounded(1e3 * one.noise_n, 2)} mN`]);
  if (cutoff !== null) rows.push(["low-pass", `applied before, ${significant(cutoff)} Hz`]);
  showNoise(rows, "standard_deviation_n of the recording in dataset.yaml.");
}

export function showSeriesNoise(channels, noise) {
  const stated = channels.filter((one) => (noise[one.name] ?? null) !== null);
  showNoise(stated.map((one) => [one.name, `standard deviation ${significant(noise[one.name], 2)}${one.unit === "1" ? "" : ` ${one.unit}`}`]), "standard_deviation of the channel in dataset.yaml.");
}
