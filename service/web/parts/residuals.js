// Maps of a finding: misfit on the wing, misfit over span and phase, the load that is missing.

import { plain } from "../base/format.js";
import { axis, CONFIG, layout, legend, PHASE, plotly, theme } from "../base/plots.js";

const MARGIN = { l: 10, r: 8, t: 8, b: 10 };
const bar = (look, title) => ({ thickness: 10, len: 0.9, outlinewidth: 0, title: { text: title, side: "right", font: { color: look.quiet } }, tickfont: { color: look.quiet } });
const shades = (look) => [[0, look.surface], [0.5, look.series[1]], [1, look.ink]];

// Both stages share one scale, so that a change of stage shows what was gained.
export async function drawMarkers(node, finding, stage, unit) {
  const Plotly = await plotly();
  const look = theme();
  const most = 1e3 * Math.max(...finding.markers.flatMap((one) => [one.before, one.after]));
  const [xs, ys] = [0, 1].map((k) => finding.outline.map((point) => 1e3 * point[k]));
  const outline = { type: "scatter", mode: "lines", x: [...ys, ys[0]], y: [...xs, xs[0]], hoverinfo: "skip", line: { color: look.faint, width: 1.5 }, fill: "toself", fillcolor: look.surface };
  const markers = {
    type: "scatter", mode: "markers", x: finding.markers.map((one) => 1e3 * one.y), y: finding.markers.map((one) => 1e3 * one.x),
    text: finding.markers.map((one) => plain(one.name)), customdata: finding.markers.map((one) => [one.span, one.chord, one.worst]),
    marker: { size: 13, color: finding.markers.map((one) => 1e3 * one[stage]), cmin: 0, cmax: most, colorscale: shades(look), line: { color: look.quiet, width: 1 }, colorbar: bar(look, unit) },
    hovertemplate: `%{text}: %{marker.color:.3g} ${unit}<br>span %{customdata[0]:.2f}, chord %{customdata[1]:.2f}, largest at phase %{customdata[2]:.2f}<extra></extra>`,
  };
  return Plotly.react(node, [outline, markers], layout(look, {
    margin: MARGIN, xaxis: axis(look, { title: { text: "along the span, mm", standoff: 6 }, showgrid: false }),
    yaxis: axis(look, { title: { text: "aft, mm", standoff: 6 }, autorange: "reversed", scaleanchor: "x", showgrid: false }),
  }), CONFIG);
}

export async function drawPhases(node, map, stage, unit, hasAfter) {
  const Plotly = await plotly();
  const look = theme();
  const scaled = (table) => table.map((row) => row.map((value) => 1e3 * value));
  const x = axis(look, { title: { text: "phase of the beat", standoff: 6 }, showgrid: false, ...PHASE });
  if (map.bands.length === 1) {
    const curve = (name, y, color, dash) => ({ type: "scatter", mode: "lines", name, x: map.phase, y, line: { color, width: 2, dash }, hovertemplate: `%{y:.3g} ${unit}<extra>${name}</extra>` });
    const traces = [curve("before", scaled(map.before)[0], look.series[1]), ...(hasAfter ? [curve("after", scaled(map.after)[0], look.accent)] : []),
      curve("noise alone", map.phase.map(() => 1e3 * map.noise), look.faint, "dot")];
    return Plotly.react(node, traces, layout(look, { margin: { ...MARGIN, t: 30 }, ...legend(look), hovermode: "x unified", xaxis: x, yaxis: axis(look, { title: { text: unit, standoff: 6 }, rangemode: "tozero" }) }), CONFIG);
  }
  const heat = {
    type: "heatmap", x: map.phase, y: map.bands, z: scaled(map[stage]), zmin: 0, zmax: 1e3 * Math.max(...map.before.flat(), ...map.after.flat()), colorscale: shades(look),
    colorbar: bar(look, unit), hovertemplate: `span %{y:.2f}, phase %{x:.2f}: %{z:.3g} ${unit}<extra></extra>`,
  };
  return Plotly.react(node, [heat], layout(look, { margin: MARGIN, xaxis: x, yaxis: axis(look, { title: { text: "span, root 0 to tip 1", standoff: 6 }, showgrid: false }) }), CONFIG);
}

// Over span and phase as a map; of a single station, or a rod, as a curve with its band.
export async function drawMissing(node, load) {
  const Plotly = await plotly();
  const look = theme();
  const turned = load.unit === "rad";
  const factor = turned ? 180 / Math.PI : 1;
  const unit = turned ? "°" : load.unit;
  const x = axis(look, { title: { text: "phase of the beat", standoff: 6 }, showgrid: false, ...PHASE });
  if (load.stations.length > 1) {
    const z = load.values.map((row) => row.map((value) => factor * value));
    const most = Math.max(...z.flat().map(Math.abs));
    const heat = {
      type: "heatmap", x: load.phase, y: load.stations, z, customdata: load.errors.map((row) => row.map((value) => factor * value)), zmin: -most, zmax: most,
      colorscale: [[0, look.series[0]], [0.5, look.surface], [1, look.series[1]]], colorbar: bar(look, unit),
      hovertemplate: `span %{y:.2f}, phase %{x:.2f}: %{z:.3g} ± %{customdata:.2g} ${unit}<extra></extra>`,
    };
    return Plotly.react(node, [heat], layout(look, { margin: MARGIN, xaxis: x, yaxis: axis(look, { title: { text: "span, root 0 to tip 1", standoff: 6 }, showgrid: false }) }), CONFIG);
  }
  const [values] = load.values;
  const [errors] = load.errors;
  const edge = (sign) => values.map((value, i) => factor * (value + 1.645 * sign * errors[i]));
  const band = { type: "scatter", mode: "lines", hoverinfo: "skip", showlegend: false, line: { width: 0, color: look.accent }, x: load.phase };
  return Plotly.react(node, [
    { ...band, y: edge(-1) }, { ...band, y: edge(1), fill: "tonexty" },
    { type: "scatter", mode: "lines", x: load.phase, y: values.map((value) => factor * value), line: { color: look.accent, width: 2 }, hovertemplate: `%{y:.3g} ${unit}<extra></extra>` },
  ], layout(look, { margin: MARGIN, xaxis: x, yaxis: axis(look, { title: { text: `${unit}, with 90 % band`, standoff: 6 }, zeroline: true, zerolinecolor: look.faint }) }), CONFIG);
}
