// A dataset of series: what was recorded, its recordings, and their values over time.

import { get, part } from "../base/api.js";
import { $, DASH, el, plain, significant, toast } from "../base/format.js";
import { recordingOptions } from "../base/labels.js";
import { axis, draw, zeroAxis } from "../base/plots.js";

const PANELS = 6; // that are drawn at once
const FEW = 40; // samples up to which each has a dot

let dataset = null;
let values = null;
let request = 0;

const withUnit = ({ name, unit }) => (unit === "1" ? name : `${name}, ${unit}`);

export function setUpSeries() {
  $("series-recording").addEventListener("change", load);
  $("series-shown").addEventListener("change", drawPanels);
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
    el("td", { className: "prose" }, one.description || DASH)))));
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
  const samples = dataset.recordings.find((one) => one.name === values.recording)?.frames;
  $("series-note").textContent = values.stride > 1 ? `One in ${values.stride} of the ${samples.toLocaleString("en")} samples is shown.` : "";
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

function chart(look, { y, unit }, time) {
  // A sample between two that are missing is on no line.
  const alone = y.map((value, k) => (value !== null && (y[k - 1] ?? null) === null && (y[k + 1] ?? null) === null ? value : null));
  const trace = { x: time, type: "scatter", line: { color: look.accent, width: 1.5 }, marker: { color: look.accent, size: 4 }, hovertemplate: "%{y:.4g} at %{x:.4g} s<extra></extra>" };
  return {
    traces: [{ ...trace, y, mode: y.length <= FEW ? "lines+markers" : "lines" },
      ...(alone.some((value) => value !== null) ? [{ ...trace, y: alone, mode: "markers" }] : [])],
    margin: { l: 10, r: 8, t: 8, b: 10 },
    xaxis: axis(look, "time, s", { showgrid: false, range: [time[0], time.at(-1)] }),
    yaxis: zeroAxis(look, unit === "1" ? "" : plain(unit)),
  };
}
