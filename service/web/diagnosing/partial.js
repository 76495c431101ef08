// What a running diagnosis knows so far: the misfit of the nominal model on the wing, and the leading hypotheses.

import { fill, get, part } from "../base/api.js";
import { $, el, plain, rounded, toast } from "../base/format.js";
import { axis, draw, zeroAxis } from "../base/plots.js";

const REFRESH_MS = 2000;

let known = null;
let of = "";
let fetchedAt = 0;
let fetching = false;
let ready = null;
let later = null;

// Show what the diagnosis knows, or hide it (null, or one that has its finding).
export function showPartial(diagnosis) {
  const over = !diagnosis || diagnosis.state === "SUCCEEDED" || diagnosis.state === "QUEUED";
  if (over || diagnosis.id !== of) {
    [known, of, fetchedAt] = [null, over ? "" : diagnosis.id, 0]; // an answer on its way is not shown any more
    $("partial").hidden = true;
  }
  if (!over) refresh(diagnosis);
}

function drawStage(diagnosis) {
  $("partial-stage").textContent = diagnosis.state === "RUNNING" ? `Now: ${diagnosis.stage ?? "starting"}.` : "The diagnosis ended before it had a finding.";
}

export function redrawPartial() {
  if (known) drawMisfit();
}

async function refresh(diagnosis) {
  const { id, steps } = diagnosis;
  if (known) drawStage(diagnosis);
  const soon = Date.now() - fetchedAt < REFRESH_MS;
  clearTimeout(later);
  if (fetching || soon) later = setTimeout(() => of === id && refresh(diagnosis), REFRESH_MS); // the last one is not missed
  if (!steps || fetching || soon) return;
  [fetching, fetchedAt] = [true, Date.now()];
  try {
    const answer = await get(`diagnoses/${part(id)}/partial`);
    if (!answer) return; // the nominal model is not fitted yet
    await (ready ??= fill($("partial"), "diagnosing/partial.html"));
    if (of !== id) return;
    known = answer;
    $("partial").hidden = false;
    drawStage(diagnosis);
    drawLeads();
    drawMisfit();
  } catch (error) {
    if (!known) ready = null;
    if (!error.away) toast(error.message);
  } finally {
    fetching = false;
  }
}

function drawLeads() {
  const { misfit, noise, tested, suspects, leads } = known;
  $("partial-nominal").textContent = `The residual of the nominal model is ${rounded(misfit / noise, 2)} times the noise.`;
  $("partial-tested").textContent = `${tested} of ${suspects} effects tested. Nothing is decided: a lead can be overtaken, and some look alike.`;
  $("partial-leads").replaceChildren(...leads.map(({ title, explained, refitted }) => {
    const bar = el("span", { className: refitted ? "share" : "share predicted", ariaHidden: "true" }, el("i"));
    bar.firstChild.style.width = `${100 * Math.max(explained, 0)}%`;
    const words = `${refitted ? "explains" : "would explain"} ${Math.round(100 * Math.max(explained, 0))} %`;
    return el("li", {}, el("span", { className: "line" }, el("strong", {}, title), el("span", {}, words)), bar);
  }));
  $("partial-leads-note").hidden = leads.length > 0;
}

function drawMisfit() {
  const placed = known.places.filter(({ x, y }) => x !== null && y !== null);
  $("partial-map-title").textContent = placed.length ? "Misfit of the nominal model on the wing, seen from above" : "Misfit of the nominal model";
  draw($("partial-map"), (look) => (placed.length ? wing(look, placed) : bars(look))).catch((error) => toast(error.message));
}

const scale = (unit, value) => ({ m: 1e3 * value, N: 1e3 * value })[unit] ?? value;
const UNITS = { m: "mm", N: "mN", 1: "" };
const unitOf = (unit) => UNITS[unit] ?? plain(unit);

function wing(look, placed) {
  const outline = [...known.outline, ...known.outline.slice(0, 1)];
  const values = placed.map(({ misfit }) => scale("m", misfit));
  return {
    traces: [
      { x: outline.map(([, y]) => 1e3 * y), y: outline.map(([x]) => 1e3 * x), type: "scatter", mode: "lines", line: { color: look.faint, width: 1.5 }, hoverinfo: "skip" },
      { x: placed.map(({ y }) => 1e3 * y), y: placed.map(({ x }) => 1e3 * x), type: "scatter", mode: "markers", text: placed.map(({ name }) => plain(name)),
        marker: { size: 13, color: values, cmin: 0, colorscale: [[0, look.surface], [1, look.series[1]]], line: { color: look.quiet, width: 1 },
          colorbar: { title: { text: "mm", side: "right" }, thickness: 10, outlinewidth: 0 } },
        customdata: values, hovertemplate: "marker %{text}: %{customdata:.3g} mm beyond the noise<extra></extra>" },
    ],
    xaxis: axis(look, "span, mm", { showgrid: false }), yaxis: axis(look, "chord, mm", { showgrid: false, scaleanchor: "x", autorange: "reversed" }),
  };
}

// Force axes and channels have no place on a wing.
function bars(look) {
  return {
    traces: [{ type: "bar", orientation: "h", y: known.places.map(({ name }) => plain(name)), x: known.places.map(({ unit, misfit }) => scale(unit, misfit)),
      text: known.places.map(({ unit, misfit }) => `${rounded(scale(unit, misfit))} ${unitOf(unit)}`), marker: { color: look.series[1] },
      hovertemplate: "%{y}: %{text} beyond the noise<extra></extra>" }],
    xaxis: zeroAxis(look, ""), yaxis: axis(look, "", { autorange: "reversed", showgrid: false }),
  };
}
