// Table of the recordings with their conditions, each with its unit, and a chart of the conditions.

import { $, el, plain, significant, toast } from "../base/format.js";
import { isForces, isSeries } from "../base/labels.js";
import { axis, draw } from "../base/plots.js";
import { seriesRecordings } from "../parts/series.js";

const WAYS = [
  ["phase_lag_deg", "phase lag, deg"], ["pressure_mbar", "pressure, mbar"], ["airspeed_m_s", "airspeed, m/s"],
  ["angle_of_attack_deg", "angle of attack, deg"], ["temperature_c", "temperature, °C"],
];
const FREQUENCY = ["flap_frequency_hz", "flap frequency, Hz"];

export function listRecordings(dataset) {
  const { head, rows } = isSeries(dataset) ? seriesRecordings(dataset) : flapping(dataset);
  $("recordings").tHead.replaceChildren(head);
  $("recordings").tBodies[0].replaceChildren(...rows);
}

function flapping(dataset) {
  const forces = isForces(dataset);
  const heads = ["Recording", "Use", forces ? "Samples" : "Frames", forces ? "Channels" : "Markers", "Missing, %", "Flap, Hz", "Lag, °", "Pressure, mbar",
    "Temperature, °C", "Airspeed, m/s", forces ? "Body pitch, °" : "Angle of attack, °"];
  const text = new Set(["Recording", "Use", "Channels"]);
  const head = el("tr", {}, ...heads.map((name) => el("th", { scope: "col", className: text.has(name) ? "" : "n" }, name)));
  const number = (value) => el("td", { className: "n" }, significant(value));
  const count = (value) => el("td", { className: "n" }, value.toLocaleString("en"));
  const rows = dataset.recordings.map((one) => el("tr", {},
    el("td", {}, one.name), el("td", {}, el("span", { className: one.held_out ? "badge held" : "badge" }, one.held_out ? "held out" : "to fit")),
    count(one.frames), forces ? el("td", {}, one.channels.map((name) => name.replace("force_", "")).join(", ")) : count(one.markers),
    number(one.missing_percent), number(one.flap_frequency_hz), number(one.phase_lag_deg), number(one.pressure_mbar),
    number(one.temperature_c), number(one.airspeed_m_s), number(one.angle_of_attack_deg)));
  return { head, rows };
}

// The two conditions to draw: the flap frequency and the other one with the most values; of series, two settings.
function pair(dataset) {
  const value = (name) => (isSeries(dataset) ? (one) => one.settings[name] : (one) => one[name]);
  const ways = isSeries(dataset) ? dataset.rig.settings.map(({ name, unit }) => [name, unit === "1" ? name : `${name}, ${unit}`]) : WAYS;
  const varied = ways.map(([name, title]) => ({ of: value(name), title, count: new Set(dataset.recordings.map(value(name))).size }));
  varied.sort((one, other) => other.count - one.count);
  return isSeries(dataset) ? varied.slice(0, 2) : [{ of: value(FREQUENCY[0]), title: FREQUENCY[1] }, varied[0]];
}

export async function drawConditions(dataset) {
  const [across, up] = pair(dataset);
  $("conditions-part").hidden = !up || dataset.recordings.length < 2;
  if ($("conditions-part").hidden) return;
  $("conditions-title").textContent = `${up.title} against ${across.title}`;
  const dots = (look, held, label, symbol) => {
    const those = dataset.recordings.filter((one) => one.held_out === held);
    return {
      type: "scatter", mode: "markers", name: label, x: those.map(across.of), y: those.map(up.of),
      text: those.map((one) => plain(one.name)), marker: { size: 11, symbol, color: held ? look.series[1] : look.accent, line: { width: 2 } },
      hovertemplate: `%{text}<br>${plain(across.title)} %{x:.4g}, ${plain(up.title)} %{y:.4g}<extra>${label}</extra>`,
    };
  };
  await draw($("conditions"), (look) => ({
    traces: [dots(look, false, "to fit", "circle"), dots(look, true, "held out", "circle-open")],
    showlegend: true, xaxis: axis(look, plain(across.title)), yaxis: axis(look, plain(up.title)),
  })).catch((error) => toast(error.message));
}
