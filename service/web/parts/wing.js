// Recorded and simulated markers: in 3-D at one phase, and their height over the beat.

import { plain, significant } from "../base/format.js";
import { axis, draw, PHASE, zeroAxis } from "../base/plots.js";

const SHOWN = 3;
const AXES = ["x aft, mm", "y span, mm", "z up, mm"];

// Frames in order of phase: a stroboscopic recording takes them from many beats.
export function byPhase(tracks) {
  const order = tracks.phase.map((_, i) => i).sort((a, b) => tracks.phase[a] - tracks.phase[b]);
  const pick = (list) => order.map((i) => list[i]);
  return {
    ...tracks, phase: pick(tracks.phase), recorded_mm: pick(tracks.recorded_mm), simulated_mm: pick(tracks.simulated_mm),
  };
}

const isSeen = (point) => point.every((value) => value !== null);

export function meanDistance(tracks) {
  let sum = 0;
  let count = 0;
  tracks.recorded_mm.forEach((frame, t) => frame.forEach((point, m) => {
    const other = tracks.simulated_mm[t][m];
    if (!isSeen(point) || !isSeen(other)) return;
    sum += Math.hypot(...point.map((value, k) => value - other[k]));
    count += 1;
  }));
  return count ? sum / count : null;
}

const coordinates = (points) => ({
  x: points.map((p) => p[0]), y: points.map((p) => p[1]), z: points.map((p) => p[2]),
});

function extents(tracks) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const frames of [tracks.recorded_mm, tracks.simulated_mm]) {
    for (const point of frames.flat()) {
      point.forEach((value, k) => {
        if (value === null) return;
        low[k] = Math.min(low[k], value);
        high[k] = Math.max(high[k], value);
      });
    }
  }
  // A margin, so that no marker lies on the edge of the box.
  return low.map((value, k) => (value <= high[k] ? [value - 10, high[k] + 10] : [-10, 10]));
}

function segments(recorded, simulated) {
  const points = [];
  recorded.forEach((point, m) => {
    if (isSeen(point) && isSeen(simulated[m])) points.push(point, simulated[m], [null, null, null]);
  });
  return points;
}

export const drawWing = (node, tracks, frame) => draw(node, (look) => wing(look, node, tracks, frame));

function wing(look, node, tracks, frame) {
  const recorded = tracks.recorded_mm[frame];
  const simulated = tracks.simulated_mm[frame];
  const points = (name, list, marker) => ({
    type: "scatter3d", mode: "markers", name, ...coordinates(list), marker, text: tracks.markers.map(plain),
    hovertemplate: `%{text}<br>x %{x:.1f}, y %{y:.1f}, z %{z:.1f} mm<extra>${name}</extra>`,
  });
  const traces = [
    { type: "scatter3d", mode: "lines", ...coordinates(segments(recorded, simulated)), hoverinfo: "skip",
      showlegend: false, line: { color: look.faint, width: 2 } },
    points("recorded", recorded, { size: 4.5, color: look.ink, symbol: "circle-open", line: { width: 1 } }),
    points("simulated", simulated, { size: 3.5, color: look.accent }),
    // The simulated wing as a surface through its markers, seen from above.
    { type: "mesh3d", ...coordinates(simulated.filter(isSeen)), delaunayaxis: "z", color: look.accent, opacity: 0.18, hoverinfo: "skip", flatshading: true },
  ];
  const box = (k, range) => ({
    title: { text: AXES[k], font: { size: 11 } }, range, gridcolor: look.line, zeroline: false, showbackground: false,
    color: look.quiet, nticks: 5, tickfont: { size: 10 },
  });
  const [x, y, z] = tracks.extents ??= extents(tracks);
  const lengths = [x, y, z].map(([low, high]) => high - low);
  // To scale, as large as the chart allows: its height sets the scale, so a narrow chart needs a smaller box.
  const zoom = Math.min(1.6, (1.4 * node.clientWidth) / node.clientHeight) / Math.max(...lengths);
  const [rx, ry, rz] = lengths.map((length) => length * zoom);
  return {
    traces, margin: { l: 0, r: 0, t: 24, b: 0 }, showlegend: true, uirevision: "camera",
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", itemsizing: "constant", font: { color: look.ink } },
    scene: {
      aspectmode: "manual", aspectratio: { x: rx, y: ry, z: rz }, xaxis: box(0, x), yaxis: box(1, y), zaxis: box(2, z), uirevision: "camera", dragmode: "turntable",
      camera: { eye: { x: 1.5, y: -0.75, z: 0.7 }, projection: { type: "orthographic" } },
    },
  };
}

// A few well-tracked markers from the root to the tip.
export function chosen(tracks) {
  const count = (m) => tracks.recorded_mm.filter((frame) => isSeen(frame[m])).length;
  const seen = tracks.markers.map((_, m) => m).filter((m) => count(m) >= tracks.phase.length / 2);
  const span = (m) => tracks.simulated_mm[0][m][1] ?? 0;
  const sorted = seen.sort((a, b) => span(a) - span(b));
  if (sorted.length <= SHOWN) return sorted;
  return Array.from({ length: SHOWN }, (_, i) => sorted[Math.round((i * (sorted.length - 1)) / (SHOWN - 1))]);
}

export const drawBeat = (node, tracks, frame) => draw(node, (look) => beat(look, tracks, frame));

function beat(look, tracks, frame) {
  const markers = chosen(tracks).reverse();
  const traces = [];
  const axes = {};
  const annotations = [];
  markers.forEach((m, row) => {
    const suffix = row ? row + 1 : "";
    const top = 1 - row / markers.length;
    const bottom = top - 1 / markers.length;
    const below = `y${markers.length + row + 1}`; // the residual
    const split = bottom + 0.3 / markers.length;
    const height = (frames) => frames.map((points) => points[m][2]);
    const common = { x: tracks.phase, xaxis: "x", yaxis: `y${suffix}`, type: "scatter" };
    const rest = height(tracks.recorded_mm).map((value, i) => (value === null ? null : value - tracks.simulated_mm[i][m][2]));
    traces.push(
      { ...common, y: height(tracks.recorded_mm), mode: "markers", name: "recorded",
        marker: { size: 5, symbol: "circle-open", color: look.ink, line: { width: 1 } },
        hovertemplate: "%{y:.1f} mm<extra>recorded</extra>" },
      { ...common, y: height(tracks.simulated_mm), mode: "lines", name: "simulated",
        line: { color: look.accent, width: 2 }, hovertemplate: "%{y:.1f} mm<extra>simulated</extra>" },
      { ...common, yaxis: below, y: rest, mode: "lines", name: "recorded minus simulated",
        line: { color: look.series[1], width: 1.5 }, hovertemplate: "%{y:.2f} mm<extra>recorded minus simulated</extra>" },
    );
    axes[`yaxis${suffix}`] = axis(look, "z, mm", { domain: [split + 0.02, top - 0.045], nticks: 4 });
    axes[`yaxis${below.slice(1)}`] = zeroAxis(look, "Δz", { domain: [bottom + 0.035, split - 0.01], nticks: 3 });
    annotations.push({
      text: `marker ${plain(tracks.markers[m])}, ${significant(tracks.simulated_mm[0][m][1], 3)} mm along the span`,
      xref: "paper", yref: "paper", x: 0, y: top - 0.045, xanchor: "left", yanchor: "bottom", showarrow: false,
      font: { size: 11, color: look.quiet },
    });
  });
  const now = tracks.phase[frame];
  return {
    traces, margin: { l: 10, r: 8, t: 4, b: 10 }, annotations, ...axes,
    xaxis: axis(look, "phase of the beat", { ...PHASE, showgrid: false, anchor: `y${2 * markers.length}` }),
    shapes: [{ type: "line", x0: now, x1: now, yref: "paper", y0: 0, y1: 1, line: { color: look.faint, width: 1 } }],
  };
}
