// A dataset of series: what was recorded, its recordings, and their values over time.

import { get, part } from "../base/api.js";
import { $, DASH, el, plain, significant, toast } from "../base/format.js";
import { recordingOptions } from "../base/labels.js";
import { axis, draw, PHASE, zeroAxis } from "../base/plots.js";
import { showSeriesNoise } from "../dataset/checks.js";
import { shades } from "../dataset/samples.js";

const PANELS = 6; // that are drawn at once
const FEW = 40; // samples up to which each has a dot

let dataset = null;
let values = null;
let request = 0;

const withUnit = ({ name, unit }) => (unit === "1" ? name : `${name}, ${unit}`);

export function setUpSeries() {
  $("series-recording").addEventListener("change", load);
  $("series-shown").addEventListener("change", drawPanels);
  for (const input of document.querySelectorAll("input[name=series-over]")) input.addEventListener("change", drawPanels);
}

export function hideSeries() {
  request += 1;
  [dataset, values] = [null, null];
  $("panels").replaceChildren();
}

export async function showSeries(next) {
  dataset = next;
  drawQuantities(dataset.rig);
  $("series-recording").replaceChildren(...recordingOptions(dataset));
  await load();
}

function drawQuantities(rig) {
  const kinds = [["channel", rig.channels], ["input", rig.inputs], ["setting", rig.settings]];
  $("quantities").tBodies[0].replaceChildren(...kinds.flatMap(([kind, those]) => those.map((one) => el("tr", {},
    el("th", { scope: "row" }, one.name), el("td", {}, kind), el("td", {}, one.unit === "1" ? DASH : one.unit),
    el("td", { className: "prose" }, [one.place, one.description].filter(Boolean).join("; ") || DASH)))));
}

// Head and rows of the table of recordings.
export function seriesRecordings({ recordings, rig }) {
  const differ = new Set(recordings.map((one) => one.channels.join())).size > 1;
  const number = (text) => el("td", { className: "n" }, text);
  const heads = ["Samples", "Duration, s", "Missing, %", ...rig.settings.map(withUnit)];
  const head = el("tr", {}, ...["Recording", "Use", ...(differ ? ["Channels"] : [])].map((text) => el("th", { scope: "col" }, text)),
    ...heads.map((text) => el("th", { scope: "col", className: "n" }, text)));
  const rows = recordings.map((one) => el("tr", {},
    el("td", {}, one.name), el("td", {}, el("span", { className: one.held_out ? "badge held" : "badge" }, one.held_out ? "held out" : "to fit")),
    ...(differ ? [el("td", { className: "prose" }, one.channels.join(", "))] : []),
    number(one.frames.toLocaleString("en")), number(significant(one.duration_s)), number(significant(one.missing_percent)),
    ...rig.settings.map(({ name }) => number(significant(one.settings[name])))));
  return { head, rows };
}

async function load() {
  const mine = ++request;
  const { id } = dataset;
  const name = $("series-recording").value;
  try {
    const answer = await get(`datasets/${part(id)}/series?recording=${part(name)}`);
    if (mine !== request) return;
    values = answer;
  } catch (error) {
    if (mine === request) toast(error.message);
    return;
  }
  fillShown();
  $("series-over").hidden = !values.period_s;
  showSeriesNoise(dataset.rig.channels, values.noise);
  await drawPanels();
}

// The recorded channels and inputs of the recording that is shown.
const recorded = () => [[dataset.rig.channels, values.channels, ""], [dataset.rig.inputs, values.inputs, "input "]].flatMap(([those, found, kind]) =>
  those.filter(({ name }) => name in found).map((one) => ({ ...one, kind, y: found[one.name] })));

// Many channels are drawn a few at a time.
function fillShown() {
  const all = recorded();
  const groups = Array.from({ length: Math.ceil(all.length / PANELS) }, (_, k) => all.slice(k * PANELS, (k + 1) * PANELS));
  const chosen = Number($("series-shown").value) || 0;
  $("series-shown").replaceChildren(...groups.map((group, k) =>
    new Option(group.length > 1 ? `${group[0].name} to ${group.at(-1).name}` : group[0].name, String(k))));
  $("series-shown").value = String(Math.min(chosen, groups.length - 1));
  $("series-shown").parentElement.hidden = groups.length < 2;
  $("series-note").textContent = note();
}

const overBeat = () => Boolean(values.period_s) && document.querySelector("input[name=series-over]:checked").value === "beat";

// What is missing, in which channels, and how many samples are shown.
function note() {
  const { frames } = dataset.recordings.find((one) => one.name === values.recording);
  const some = values.stride > 1 ? `One in ${values.stride} of the ${frames.toLocaleString("en")} samples is shown.` : "";
  const counts = Object.entries(values.missing).filter(([, gaps]) => gaps.samples);
  const lost = counts.map(([name, gaps]) => `${gaps.samples.toLocaleString("en")} of ${name}`);
  return [lost.length ? `Missing samples: ${lost.slice(0, PANELS).join(", ")}${lost.length > PANELS ? ", …" : ""}; gaps are shaded over time.` : "No sample is missing.", some].join(" ");
}

async function drawPanels() {
  if (!values) return;
  const first = PANELS * Number($("series-shown").value);
  const nodes = recorded().slice(first, first + PANELS).map((one) => {
    const plot = el("div", { className: "plot low" });
    return { one, plot, node: el("div", {}, el("h4", { className: "figure-title" }, `${one.kind}${withUnit(one)}`), plot) };
  });
  $("panels").replaceChildren(...nodes.map(({ node }) => node));
  await Promise.all(nodes.map(({ one, plot }) => draw(plot, (look) => chart(look, one, values.time_s)))).catch((error) => toast(error.message));
}

export const redrawSeries = drawPanels;

// Samples over the phase of the period, with a gap between one beat and the next.
function folded(y, time) {
  const phase = time.map((value) => (value - time[0]) / values.period_s);
  const points = phase.flatMap((value, k) => [...(k && Math.floor(value) !== Math.floor(phase[k - 1]) ? [[null, null]] : []), [value % 1, y[k]]]);
  return { x: points.map((point) => point[0]), y: points.map((point) => point[1]) };
}

function chart(look, { name, y, unit }, time) {
  const beat = overBeat();
  // A sample between two that are missing is on no line.
  const alone = y.map((value, k) => (value !== null && (y[k - 1] ?? null) === null && (y[k + 1] ?? null) === null ? value : null));
  const at = beat ? "of the beat" : "s";
  const trace = { x: time, type: "scatter", line: { color: look.accent, width: beat ? 1 : 1.5 }, marker: { color: look.accent, size: 4 }, hovertemplate: `%{y:.4g} at %{x:.4g} ${at}<extra></extra>` };
  const drawn = (column) => (beat ? folded(column, time) : { y: column });
  const half = time.length > 1 ? (time.at(-1) - time[0]) / (time.length - 1) / values.stride / 2 : 0;
  return {
    traces: [{ ...trace, ...drawn(y), mode: y.length <= FEW ? "lines+markers" : "lines", opacity: beat ? 0.6 : 1 },
      ...(alone.some((value) => value !== null) ? [{ ...trace, ...drawn(alone), mode: "markers" }] : [])],
    shapes: beat ? [] : shades(look, values.missing[name]?.gaps ?? [], half, "y domain"),
    margin: { l: 10, r: 8, t: 8, b: 10 },
    xaxis: beat ? axis(look, "phase of the period", { showgrid: false, ...PHASE }) : axis(look, "time, s", { showgrid: false, range: [time[0], time.at(-1)] }),
    yaxis: zeroAxis(look, unit === "1" ? "" : plain(unit)),
  };
}
