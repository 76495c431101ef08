// Fitness by generation: best and mean on a log axis, with the boundaries of the stages.

import { mm, significant } from "./format.js";
import { axis, CONFIG, layout, plotly, theme } from "./plots.js";
import { mn } from "./words.js";

const GAP = { sequence: null, best: null, mean: null };
const SIDE_BY_SIDE = 3; // stages whose names fit over the figure; of more, they stand upright
const UNDER_NAMES = 0.78;
const LONGEST_UPRIGHT = 9;
const FEW = 12; // points of a stage, each worth a dot

// "test-1, Gauss-Newton" is named by its recording, unless it finishes a search on the same one.
function stageLabel(name, stages, upright) {
  const base = name.replace(", Gauss-Newton", "");
  if (base !== name && stages.has(base)) return upright ? "" : "Gauss-Newton";
  if (!upright) return base === name ? `${name} stage` : base;
  return base.length > LONGEST_UPRIGHT ? `${base.slice(0, LONGEST_UPRIGHT - 1)}…` : base;
}

const MARKERS = {
  unit: "m²", hover: (item) => `, ${mm(item.best_mm)} mm per marker`,
  about: "Sum of squared distances between simulated and recorded markers; lower is better.",
};
const FORCES = {
  unit: "N²", hover: (item) => `, RMS ${mn(item.best_mn)} mN, ${item.stage}: genes moved by ${significant(item.diversity, 2)} of their range`,
  about: "Sum of squared differences between modelled and recorded forces; lower is better. Gauss-Newton weighs recordings and axes by their noise, so that the sum need not fall every time.",
};

export const aboutHistory = (forces) => (forces ? FORCES : MARKERS).about;

export async function drawHistory(node, items, forces = false) {
  const shown = forces ? FORCES : MARKERS;
  const Plotly = await plotly();
  const look = theme();
  const x = items.map((item) => item.sequence);
  // The stages sum over different recordings: a line across their boundary would compare what cannot be compared.
  const points = items.flatMap((item, i) => (i && items[i - 1].stage !== item.stage ? [GAP, item] : [item]));
  const boundaries = items.filter((item, i) => i === 0 || items[i - 1].stage !== item.stage);
  const stages = new Set(boundaries.map((item) => item.stage));
  const upright = boundaries.length > SIDE_BY_SIDE;
  const dots = items.length < 3 || (forces && items.length < FEW * boundaries.length);
  const line = (name, value, colour, width, labels) => ({
    x: points.map((item) => item.sequence), y: points.map(value), name, mode: dots ? "lines+markers" : "lines", type: "scatter",
    line: { color: colour, width }, marker: { color: colour, size: 6 }, text: labels,
    hovertemplate: `%{y:.4g} ${shown.unit}${labels ? "%{text}" : ""}<extra>${name}</extra>`,
  });
  const traces = [
    // A Gauss-Newton iteration has one individual, so no mean beside it.
    line("mean", (item) => (item.mean === item.best ? null : item.mean), look.faint, 1.5),
    line("best", (item) => item.best, look.accent, 2.5, points.map((item) => (item === GAP ? "" : shown.hover(item)))),
  ];
  const figure = layout(look, {
    margin: { l: 10, r: 52, t: 26, b: 10 }, hovermode: "x unified",
    xaxis: axis(look, { title: { text: "generation", standoff: 8 }, showgrid: false, range: span(x), tickformat: "d" }),
    yaxis: axis(look, {
      title: { text: `fitness, ${shown.unit}`, standoff: 8 }, type: "log", domain: [0, upright ? UNDER_NAMES : 1], ...logTicks(traces.flatMap((trace) => trace.y)),
    }),
    shapes: boundaries.slice(1).map((item) => ({
      type: "line", x0: item.sequence - 0.5, x1: item.sequence - 0.5, yref: "paper", y0: 0, y1: 1,
      line: { color: look.quiet, width: 1, dash: "dot" },
    })),
    annotations: [
      ...boundaries.map((item, i) => ({
        text: stageLabel(item.stage, stages, upright), x: i || upright ? item.sequence - 0.5 : item.sequence, yref: "paper", y: 1, xanchor: "left",
        yanchor: upright ? "top" : "bottom", textangle: upright ? 90 : 0, showarrow: false, font: { color: look.quiet, size: 12 },
      })),
      ...endLabels(traces),
    ],
  });
  return Plotly.react(node, traces, figure, CONFIG);
}

const span = (x) => (x.length > 1 ? [x[0] - 0.5, x.at(-1) + 0.5] : [0.5, 2.5]);

// Ticks at whole powers of ten, or at 1, 2, 5 where there are too few of those.
function logTicks(values) {
  const known = values.filter((value) => value > 0);
  if (!known.length) return {};
  const [low, high] = [Math.min(...known), Math.max(...known)];
  const digits = high / low < 300 ? (high / low < 10 ? [1, 2, 3, 4, 6, 8] : [1, 2, 5]) : [1];
  const ticks = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power += 1) {
    ticks.push(...digits.map((digit) => digit * 10 ** power));
  }
  return { tickmode: "array", tickvals: ticks, ticktext: ticks.map((tick) => significant(tick, 1)) };
}

// The name stands at the end of its line, so that nobody has to look it up in a legend.
function endLabels(traces) {
  const labels = traces.map(endLabel).filter(Boolean);
  const known = traces.flatMap((trace) => trace.y).filter((value) => value > 0).map(Math.log10);
  const height = Math.max(...known) - Math.min(...known);
  if (labels.length === 2 && labels[0].y - labels[1].y < 0.1 * height) {
    labels[0].yshift = 8;
    labels[1].yshift = -6;
  }
  return labels;
}

function endLabel(trace) {
  const last = trace.y.findLastIndex((value) => value > 0);
  if (last < 0) return null;
  return {
    text: trace.name, x: trace.x[last], y: Math.log10(trace.y[last]), xanchor: "left", xshift: 8,
    showarrow: false, font: { color: trace.line.color, size: 13 },
  };
}
