// The described wing and the recorded markers in 3-D, in the frame of the wing, to one scale on all axes.

import { plain } from "../base/format.js";
import { draw } from "../base/plots.js";
import { placed, projected } from "./labels.js";

const AXES = ["x aft", "y outboard", "z up"];
const ARROW = 0.3; // of the span
const MARGIN = 0.04; // of the span, around everything
const LABELLED = 0.7; // of the upper edge of the stroke plane, from the hinge: at its end there is no room above it
export const FAR = 0.15; // of the span: distances beyond which axes, names or unit are wrong (docs/checks.md)

const CAMERAS = {
  oblique: { eye: { x: 1.5, y: -0.75, z: 0.7 } },
  above: { eye: { x: 0, y: 0, z: 2 }, up: { x: -1, y: 0, z: 0 } },
  behind: { eye: { x: 2, y: 0, z: 0 } },
  root: { eye: { x: 0, y: -2, z: 0 } },
};
const GAP = [null, null, null];

export const isSeen = (point) => point !== undefined && point.every((value) => value !== null);

// A function that turns points about the hinge axis by ``degrees``.
export function turner({ hinge_mm: [, y0, z0] }, degrees) {
  const [cosine, sine] = [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
  return ([x, y, z]) => [x, y0 + cosine * (y - y0) - sine * (z - z0), z0 + sine * (y - y0) + cosine * (z - z0)];
}

const coordinates = (points) => ({ x: points.map((p) => p[0]), y: points.map((p) => p[1]), z: points.map((p) => p[2]) });

const parted = (pieces) => pieces.flatMap((piece) => [...piece, GAP]);

const line = (name, pieces, colour, width, extra = {}) => ({
  type: "scatter3d", mode: "lines", name, ...coordinates(parted(pieces)), line: { color: colour, width }, hoverinfo: "skip", showlegend: false, ...extra,
});

// What does not change with the phase: trails, hinge, axes and stroke plane, and the extent of it all.
export function fixedParts(wing, tracks) {
  const trails = tracks.markers.map((_, m) => {
    const path = tracks.positions_mm.map((frame) => frame[m]);
    return tracks.beat === null && path.length > 2 ? [...path, path[0]] : path;
  });
  const xs = wing.outline_mm.map((point) => point[0]);
  const [front, back] = [Math.min(...xs), Math.max(...xs)];
  const [, y0, z0] = wing.hinge_mm;
  const middle = [(front + back) / 2, y0, z0];
  const tip = [middle[0], Math.max(...wing.outline_mm.map((point) => point[1])), 0];
  const [low, high] = [Math.min(...wing.drive_deg), Math.max(...wing.drive_deg)];
  const arc = Array.from({ length: 25 }, (_, k) => turner(wing, low + ((high - low) * k) / 24)(tip));
  const parts = {
    trails, hinge: [[front - 0.1 * wing.span_mm, y0, z0], [back + 0.1 * wing.span_mm, y0, z0]], fan: [middle, ...arc],
    arrows: [0, 1, 2].map((k) => [[0, 0, 0], [0, 1, 2].map((n) => (n === k ? ARROW * wing.span_mm : 0))]), middle,
  };
  const angles = [0, ...tracks.angle_deg.filter((angle) => angle !== null)];
  const turned = [Math.min(...angles), Math.max(...angles), 0].flatMap((angle) => wing.outline_mm.map(turner(wing, angle)));
  const all = [...trails.flat().filter(isSeen), ...turned, ...parts.fan, ...parts.hinge, ...parts.arrows.flat(), ...wing.markers.map((one) => one.position_mm)];
  const margin = MARGIN * wing.span_mm;
  return { ...parts, ranges: [0, 1, 2].map((k) => {
    const values = all.map((point) => point[k]);
    return [values.reduce((a, b) => Math.min(a, b)) - margin, values.reduce((a, b) => Math.max(a, b)) + margin];
  }) };
}

// ``shown``: wing, tracks, parts, frame, turned (whether the described wing turns with the markers), names, view.
export const drawScene = (node, shown) => draw(node, (look) => scene(look, node, shown));

function scene(look, node, { wing, tracks, parts, frame, turned, names, view }) {
  const turn = turner(wing, (turned && tracks.angle_deg[frame]) || 0);
  const recorded = tracks.positions_mm[frame];
  const rest = new Map(wing.markers.map((one) => [one.name, turn(one.position_mm)]));
  const pairs = tracks.markers.map((name, m) => [recorded[m], rest.get(name)]).filter((pair) => pair.every(isSeen));
  // At rest, the stroke itself makes the distances long.
  const far = (pair) => turned && Math.hypot(...pair[0].map((value, k) => value - pair[1][k])) > FAR * wing.span_mm;
  const points = (name, labels, list, marker, extra = {}) => ({
    type: "scatter3d", mode: "markers", name, ...coordinates(list), marker, customdata: labels.map(plain), hovertemplate: `%{customdata}<br>x %{x:.1f}, y %{y:.1f}, z %{z:.1f} mm<extra>${name}</extra>`, ...extra,
  });
  const described = look.series[1];
  const lengths = parts.ranges.map(([low, high]) => high - low);
  // One scale, as large as the chart allows: its height sets the scale, so a narrow chart needs a smaller box.
  const zoom = Math.min(1.9, (1.6 * node.clientWidth) / node.clientHeight) / Math.max(...lengths);
  const ratio = lengths.map((length) => length * zoom);
  const places = wing.markers.map((one) => turn(one.position_mm));
  // The user may have turned the picture.
  const camera = node.layout?.scene?.uirevision === view ? node.layout.scene.camera : CAMERAS[view];
  const written = new Map(names ? placed(wing.markers.map((one) => one.name), projected(places, camera, { ranges: parts.ranges, ratio, height: node.clientHeight })).map((one) => [one.index, one]) : []);
  const outline = wing.outline_mm.map(turn);
  const tips = parts.arrows.map((arrow) => arrow[1]);
  const { fan } = parts;
  const traces = [
    { type: "mesh3d", name: "stroke plane", ...coordinates(fan), i: fan.slice(2).map(() => 0), j: fan.slice(2).map((_, k) => k + 1), k: fan.slice(2).map((_, k) => k + 2),
      color: look.series[2], opacity: 0.16, hoverinfo: "skip", flatshading: true },
    line("stroke plane", [[...fan, fan[0]]], look.series[2], 2),
    line("trails", parts.trails, look.faint, 1.5),
    line("outline", [outline], described, 3),
    line("rods", wing.rods.map((rod) => [turn(rod.root_mm), turn(rod.tip_mm)]), described, 5),
    line("hinge axis", [parts.hinge], look.ink, 4, { line: { color: look.ink, width: 4, dash: "dash" } }),
    line("distance", pairs.filter((pair) => !far(pair)), described, 2),
    line("far", pairs.filter(far), look.bad, 5),
    points("described", wing.markers.map((one) => one.name), places, { size: 5, color: described, symbol: "circle-open", line: { width: 1, color: described } },
      { showlegend: true }),
    points("recorded", tracks.markers, recorded, { size: 3.5, color: look.ink }, { showlegend: true }),
    // Those without room are transparent: Plotly draws names that come later too small.
    { type: "scatter3d", mode: "text", name: "names", ...coordinates(names ? places : []), text: wing.markers.map((one) => plain(one.name)), hoverinfo: "skip", showlegend: false,
      textposition: wing.markers.map((_, m) => written.get(m)?.side ?? "top center"),
      textfont: { size: 10, color: wing.markers.map((_, m) => (written.has(m) ? described : "rgba(0,0,0,0)")) } },
    line("axes", parts.arrows, look.accent, 6),
    { type: "scatter3d", mode: "text", name: "labels", ...coordinates([...tips, parts.hinge[0], fan[0].map((from, k) => from + LABELLED * (fan.at(-1)[k] - from))]), text: [...AXES, "hinge axis", "stroke plane"], hoverinfo: "skip",
      showlegend: false, textfont: { size: 12, color: [look.accent, look.accent, look.accent, look.ink, look.series[2]] }, textposition: [...tips.map(() => "top center"), "top center", "top left"] },
  ];
  const box = (k) => ({
    title: { text: `${"xyz"[k]}, mm`, font: { size: 11 } }, range: parts.ranges[k], gridcolor: look.line, zeroline: false, showbackground: false,
    color: look.quiet, nticks: 5, tickfont: { size: 10 },
  });
  const [x, y, z] = ratio;
  return {
    traces, margin: { l: 0, r: 0, t: 24, b: 0 }, showlegend: true, uirevision: view,
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom", itemsizing: "constant", font: { color: look.ink } },
    scene: {
      aspectmode: "manual", aspectratio: { x, y, z }, xaxis: box(0), yaxis: box(1), zaxis: box(2), uirevision: view, dragmode: "orbit",
      camera: { up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: 0 }, ...CAMERAS[view], projection: { type: "orthographic" } },
    },
  };
}
