// Forces over the beat, recorded and modelled, and their power spectra.

import { $, forceUnit, significant } from "../base/format.js";
import { axis, draw, PHASE, residualLine, withResidual } from "../base/plots.js";
import { QUANTITIES, SOURCES } from "../base/labels.js";

const HARMONICS = 8;
const DECADES = 6;

// Draw the quantities ``names`` (at most two); returns a note on the charts.
export async function drawBeats(forces, names, about) {
  const drawn = [];
  for (const k of [0, 1]) {
    for (const figure of ["beat", "spectrum"]) $(`${figure}-${k}`).parentElement.hidden = !names[k];
    if (!names[k]) continue;
    $(`beat-${k}-title`).textContent = `${QUANTITIES[names[k]]}: mean beat`;
    $(`spectrum-${k}-title`).textContent = `${QUANTITIES[names[k]]}: power spectrum`;
    drawn.push(draw($(`beat-${k}`), (look) => beat(look, forces, names[k])));
    const spectra = Boolean(forces.recorded_spectrum_n2_hz[names[k]]);
    $(`spectrum-${k}`).parentElement.hidden = !spectra;
    if (spectra) drawn.push(draw($(`spectrum-${k}`), (look) => spectrum(look, forces, names[k], about.flap_frequency_hz)));
  }
  await Promise.all(drawn);
  const differences = names.map((name) => meanBeatDifference(forces, name));
  const { unit, show } = forceUnit(differences);
  const off = names.map((name, k) => `${name} ${show(differences[k])} ${unit}`).join(", ");
  const wide = forces.standard_deviation_n[names[0]] ? " The band is one standard deviation between beats." : "";
  return [
    `${forces.recording}: ${significant(about.flap_frequency_hz)} Hz, body pitch ${significant(about.angle_of_attack_deg)}°, `
      + `${significant(about.airspeed_m_s)} m/s. RMS difference of the mean beats with the ${SOURCES[forces.source].toLowerCase()} model: ${off}.${wide}`,
    ...forces.remarks.map((remark) => `Note: ${remark}.`),
  ].join(" ");
}

function meanBeatDifference(forces, name) {
  const [recorded, modelled] = [forces.recorded_n[name], forces.modelled_n[name]];
  return Math.sqrt(recorded.reduce((sum, value, i) => sum + (value - modelled[i]) ** 2, 0) / recorded.length);
}

// Close the curve: the end of a beat is the start of the next.
const closed = (values) => [...values, values[0]];

function beat(look, forces, name) {
  const x = [...forces.phase, forces.phase[0] + 1];
  const recorded = closed(forces.recorded_n[name]);
  const spread = forces.standard_deviation_n[name] && closed(forces.standard_deviation_n[name]);
  const modelled = closed(forces.modelled_n[name]);
  const label = SOURCES[forces.source].toLowerCase();
  const edge = (centre, sign, extra) => ({
    x, y: centre.map((value, i) => value + sign * spread[i]), type: "scatter", mode: "lines", line: { width: 0 },
    hoverinfo: "skip", showlegend: false, ...extra,
  });
  const curve = (label, y, line) => ({
    x, y, name: label, type: "scatter", mode: "lines", line: { simplify: false, ...line }, hovertemplate: `%{y:.3~s}N<extra>${label}</extra>`,
  });
  const band = (centre) => (spread ? [edge(centre, -1, {}), edge(centre, 1, { fill: "tonexty", fillcolor: `${look.faint}59` })] : []);
  return withResidual(look, {
    traces: [...band(recorded), curve("recorded", recorded, { color: look.ink, width: 1.5 }),
      curve(label, modelled, { color: look.accent, width: 2, dash: "dash" })],
    residual: [...band(recorded.map(() => 0)), residualLine(look, x, recorded, modelled, label)],
    x: axis(look, "t*, beats; 0: wings closest", { showgrid: false, ...PHASE }), unit: "N",
  });
}

// The model is periodic: all its power is at harmonics of the flap frequency, drawn as dots.
function spectrum(look, forces, name, frequency) {
  const recorded = forces.recorded_spectrum_n2_hz[name];
  const modelled = forces.modelled_spectrum_n2_hz[name];
  const seen = forces.frequency_hz.map((hz, i) => i).filter((i) => forces.frequency_hz[i] > 0 && forces.frequency_hz[i] <= (HARMONICS + 0.5) * frequency);
  const highest = Math.max(...seen.map((i) => Math.max(recorded[i], modelled[i])));
  const floor = highest / 10 ** DECADES;
  const width = forces.frequency_hz[1] - forces.frequency_hz[0];
  const offHarmonic = (i) => Math.abs(forces.frequency_hz[i] - frequency * Math.round(forces.frequency_hz[i] / frequency));
  const series = (density, keep) => {
    const some = seen.filter(keep);
    return { x: some.map((i) => forces.frequency_hz[i]), y: some.map((i) => density[i]), type: "scatter" };
  };
  const label = SOURCES[forces.source].toLowerCase();
  const text = (who) => `%{x:.1f} Hz: %{y:.2e} N²/Hz<extra>${who}</extra>`;
  const traces = [
    { ...series(recorded, (i) => recorded[i] > 0), name: "recorded", mode: "lines", line: { color: look.ink, width: 1.5 }, hovertemplate: text("recorded") },
    { ...series(modelled, (i) => modelled[i] > floor && offHarmonic(i) <= width / 2), name: label, mode: "markers",
      marker: { color: look.accent, size: 8 }, hovertemplate: text(label) },
  ];
  const top = Math.log10(highest);
  return {
    traces, showlegend: true, xaxis: axis(look, "Hz", { showgrid: false, range: [0, (HARMONICS + 0.5) * frequency] }),
    yaxis: axis(look, "N²/Hz", { type: "log", range: [top - DECADES, top + 0.3], dtick: 2, exponentformat: "power" }),
  };
}
