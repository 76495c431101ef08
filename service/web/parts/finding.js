// What a diagnosis found, as figures: evidence, where on the wing and in the beat, before and after.

import { $, DASH, el, fixed, significant } from "../base/format.js";
import { lines } from "../base/plots.js";
import { drawMarkers, drawMissing, drawPhases } from "./residuals.js";
import { capital, spoken } from "../base/labels.js";

const RANKED = 6;
const ALMOST = 0.999;

let finding = null;
const stage = () => document.querySelector("input[name=stage]:checked").value;
const unit = () => (finding.unit === "m" ? "mm" : "mN");
const size = (value) => (value === null ? DASH : `${significant(1e3 * value, 3)} ${unit()}`);
const percent = (part) => (part === null || part === undefined ? DASH : `${significant(100 * part, part > 0.1 ? 3 : 2)} %`);
const chance = (part) => (part > ALMOST && part < 1 ? "> 99.9 %" : part > 0 && part < 1 - ALMOST ? "< 0.1 %" : percent(part));

export function setUpFinding() {
  document.querySelectorAll("input[name=stage]").forEach((input) => input.addEventListener("change", drawMaps));
  $("missing-recording").addEventListener("change", drawMaps);
  $("overlay").addEventListener("change", drawOverlay);
  $("ranking-all").addEventListener("change", drawRanking);
}

export function showFinding(next) {
  finding = next;
  $("finding").hidden = !finding;
  if (!finding) return;
  for (const id of ["where-note", "overlay-note"]) $(id).textContent = "";
  drawNumbers();
  drawChances();
  drawRanking();
  drawWhere();
  drawRecordings();
  drawGenes();
  drawNext();
  redrawFinding();
}

export function redrawFinding() {
  if (!finding) return;
  drawMaps();
  drawOverlay();
}

const told = (id, error) => { $(id).textContent = error.message; };

function drawNumbers() {
  const { floors, proof } = finding;
  const cell = (label, text, main = false) => el("div", { className: main ? "main" : "" }, el("dt", {}, label), el("dd", {}, text));
  const cells = [cell("left by the nominal model, in parts of the noise", `${significant(finding.strength, 3)}×`), cell("noise, from the scatter between beats", size(floors.noise)),
    cell("floor: what a right model would leave", size(floors.total))];
  if (proof) {
    cells.push(cell("held out, before, over the floor", `${significant(proof.before.value, 3)}×`));
    if (finding.added_effects.length) cells.push(cell("held out, after, over the floor", `${significant(proof.after.value, 3)}×`, true));
  }
  $("finding-numbers").replaceChildren(...cells);
}

function meter(part, className = "") {
  const bar = el("i", { className });
  bar.style.width = `${100 * Math.min(1, Math.max(0, part))}%`;
  return el("span", { className: "meter", ariaHidden: "true" }, bar);
}

function drawChances() {
  $("chances").tBodies[0].replaceChildren(...Object.entries(finding.probabilities).map(([verdict, part]) =>
    el("tr", { className: verdict === finding.verdict ? "total" : "" }, el("th", { scope: "row" }, verdict), el("td", { className: "n" }, chance(part)),
      el("td", { className: "wide" }, meter(part)))));
}

function drawRanking() {
  const all = $("ranking-all").checked;
  const named = (one) => one.effects.length > 0 && (finding.verdict === "ambiguous" ? finding.indistinguishable : [finding.named])
    .some((names) => names.length === one.effects.length && names.every((name) => one.effects.includes(name)));
  const shown = finding.hypotheses.filter((one, i) => all || i < RANKED);
  $("ranking-more").hidden = finding.hypotheses.length <= RANKED;
  $("ranking").tBodies[0].replaceChildren(...shown.map((one) => el("tr", { className: named(one) ? "named" : "" },
    el("th", { scope: "row", className: "prose" }, el("span", {}, one.title), " ", el("small", {}, one.effects.length ? one.family : "as it is"),
      one.signature ? el("small", { className: "below" }, capital(one.signature)) : null, one.source ? el("small", { className: "below" }, one.source) : null),
    el("td", { className: "n" }, chance(one.probability), meter(one.probability)), el("td", { className: "n" }, percent(one.explained), meter(one.explained)),
    el("td", { className: "n" }, percent(one.predicted)), el("td", { className: "n" }, significant(one.evidence, 3)), el("td", { className: "n" }, size(one.misfit),
      one.refitted ? null : el("small", { className: "below" }, "by slopes, not refitted")))));
  const alike = finding.indistinguishable.map((names) => names.map(spoken).join(" with "));
  $("alike").textContent = alike.length > 1 ? `These recordings cannot tell apart: ${alike.join("; ")}.` : "";
}

function drawWhere() {
  const { where } = finding;
  const parts = where ? [`${capital(where.words)}.`, ...where.exponents.map(({ variable, power, low, high, unit: of }) =>
    `Power of ${variable} with which it grows: ${fixed(power.value, 1)}${power.low === null || power.high === null ? ", not bounded" : ` (${fixed(power.low, 1)} to ${fixed(power.high, 1)})`}, `
    + `between ${significant(low, 3)} and ${significant(high, 3)} ${of}.`)] : ["Nothing is left to be located."];
  $("where-words").replaceChildren(...parts.map((text) => el("li", {}, text)));
  document.querySelector("input[name=stage][value=before]").checked = true;
  const placed = finding.markers.some((marker) => marker.x !== null);
  // Curves of forces show both at once.
  $("stages").hidden = !finding.added_effects.length || !(placed || finding.phase_map?.bands.length > 1);
  $("markers-part").hidden = !placed;
  $("phases-part").hidden = !finding.phase_map;
  $("missing-part").hidden = !finding.missing.length;
  $("missing-recording").replaceChildren(...finding.missing.map((one, i) => new Option(one.recording, i)));
}

function drawMaps() {
  const which = stage();
  const [first] = finding.markers;
  if (first && first.x !== null) drawMarkers($("markers-map"), finding, which, unit()).catch((error) => told("where-note", error));
  if (finding.phase_map) drawPhases($("phases-map"), finding.phase_map, which, unit(), finding.added_effects.length > 0).catch((error) => told("where-note", error));
  const load = finding.missing[Number($("missing-recording").value)];
  if (!load) return;
  $("missing-title").textContent = load.rod ? `What the ${load.rod} rod turns further than it is said to`
    : load.unit === "N" ? "Force that is missing, of the recording itself" : "Force that is missing, along the flap normal";
  drawMissing($("missing-map"), load).catch((error) => told("where-note", error));
}

function drawRecordings() {
  const after = finding.added_effects.length > 0;
  const largest = Math.max(...finding.recordings.flatMap((one) => [one.before.value, one.after.value, one.floor]), 1e-30);
  const bars = (one) => {
    const twin = el("div", { className: "twin", ariaHidden: "true" }, el("i"), el("i"));
    [one.before, after ? one.after : { value: 0 }].forEach(({ value }, i) => { twin.children[i].style.width = `${(100 * value) / largest}%`; });
    const floor = el("span", { className: "floor" });
    floor.style.left = `${(100 * one.floor) / largest}%`;
    twin.append(floor);
    return twin;
  };
  const value = (interval) => el("td", { className: "n" }, size(interval.value), interval.low === null || interval.high === null ? null
    : el("small", {}, ` ${significant(1e3 * interval.low, 3)} to ${significant(1e3 * interval.high, 3)}`));
  $("proof-words").textContent = finding.proof ? `${capital(finding.proof.words)}.` : "No recording was held out, so nothing here is proved on recordings that were not seen.";
  $("before-after").classList.toggle("alone", !after);
  $("before-after").tBodies[0].replaceChildren(...finding.recordings.map((one) => el("tr", {},
    el("th", { scope: "row" }, one.name), el("td", {}, el("span", { className: one.held_out ? "badge held" : "badge" }, one.held_out ? "held out" : "fitted")),
    value(one.before), after ? value(one.after) : el("td", { className: "n" }, DASH), el("td", { className: "n" }, size(one.floor)), el("td", { className: "wide" }, bars(one)))));
  $("overlay-part").hidden = !finding.overlays.length;
  $("overlay").replaceChildren(...finding.overlays.map((one, i) =>
    new Option(`${one.recording}, ${one.channel.replace("_", " ")}${one.held_out ? " (held out)" : ""}`, i)));
}

// Samples of several beats, in the order of their phases.
function drawOverlay() {
  const one = finding.overlays[Number($("overlay").value)];
  if (!one) return;
  const order = one.phase.map((_, i) => i).sort((a, b) => one.phase[a] - one.phase[b]);
  const pick = (values) => order.map((i) => 1e3 * values[i]);
  const curves = [["recorded", pick(one.recorded)], ["nominal model, refitted", pick(one.before)]];
  if (finding.added_effects.length) curves.push(["with what was found", pick(one.after)]);
  lines($("overlay-plot"), order.map((i) => one.phase[i]), curves, { unit: unit(), first: "markers" }).catch((error) => told("overlay-note", error));
}

function drawGenes() {
  const bounds = ({ low, high }) => (low === null && high === null ? "not bounded" : low === null ? `below ${significant(high, 3)}`
    : high === null ? `above ${significant(low, 3)}` : `${significant(low, 3)} to ${significant(high, 3)}`);
  const isFound = (gene) => finding.added_effects.some((name) => gene.name.startsWith(`${name}.`));
  const found = finding.genes.filter(isFound);
  $("found-genes-part").hidden = !finding.genes.length;
  $("found-genes").tBodies[0].replaceChildren(...[...found, ...finding.genes.filter((gene) => !isFound(gene))].map((gene) =>
    el("tr", { className: isFound(gene) ? "named" : "" }, el("th", { scope: "row" }, gene.name), el("td", { className: "n" }, significant(gene.value.value, 4)),
      el("td", {}, bounds(gene.value)), el("td", {}, gene.unit === "1" ? "" : gene.unit), el("td", { className: "prose" }, gene.description))));
}

function drawNext() {
  $("law-words").hidden = !finding.law;
  $("law-words").textContent = finding.law ? `A free-form law for what is left: ${finding.law.words}` : "";
  $("advice-part").hidden = !finding.advice.length;
  $("advice").replaceChildren(...finding.advice.map((one) => el("li", {}, capital(one.words))));
  $("finding-remarks").hidden = !finding.remarks.length;
  $("finding-remarks").replaceChildren(...finding.remarks.map((remark) => el("li", {}, `${capital(remark)}.`)));
}
