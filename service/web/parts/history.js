// Chart of the fitness by generation: best, mean and present start on a log axis, with the boundaries of the stages.
// The values are sums of squares; of series, root mean squares in percent of the range.

import { mm, plain, significant, withForceUnit } from "../base/format.js";
import { axis, draw } from "../base/plots.js";
import { newtons, OF_RANGE } from "../base/labels.js";

const GAP = { sequence: null, best: null, mean: null };
const SIDE_BY_SIDE = 3; // stages whose names fit above the chart; more are written vertically
const UNDER_NAMES = 0.78;
const LONGEST_UPRIGHT = 9;
const FEW = 12; // points of a stage up to which each has a dot
const MOST_TICKS = 10;
const FEWEST_TICKS = 3;
const EVEN_TICKS = 8; // at most; of steps of 1, 2 and 5 at least three fall into the range
const NARROWEST = 0.02; // decades left free at either end, at least

const NEWTON = ", Gauss-Newton";

// "test-1, Gauss-Newton" is named by its recording, unless it finishes a search on the same one.
function stageLabel(name, stages, upright) {
  const base = name.replace(NEWTON, "");
  if (base !== name && stages.has(base)) return upright ? "" : "Gauss-Newton";
  if (!upright) return base === name ? `${name} stage` : base;
  return base.length > LONGEST_UPRIGHT ? `${base.slice(0, LONGEST_UPRIGHT - 1)}…` : base;
}

const TRACKS = {
  unit: "m²", value: (item, name) => item[name], hover: (item) => `, ${mm(item.best_mm)} mm per marker`,
  about: "Sum of squared distances between simulated and recorded markers; lower is better.",
};
const FORCES = {
  unit: "N²", value: (item, name) => item[name], hover: (item) => `, RMS ${withForceUnit(newtons(item.best_mn))}, ${plain(item.stage)}: genes moved by ${significant(item.diversity, 2)} of their range`,
  about: "Sum of squared differences between modelled and recorded forces; lower is better. Gauss-Newton weights recordings and axes by their noise, so this sum can rise.",
};

// The sums of squares are converted by the ratio that the best individual has.
const percent = (item, name) => (item[name] === null || !item.best ? null : item.best_percent * Math.sqrt(item[name] / item.best));
const SERIES = {
  unit: OF_RANGE, value: percent, hover: () => "",
  about: "Root mean square difference between simulated and recorded values, relative to the range of each channel; lower is better.",
};
const KINDS = { tracks: TRACKS, forces: FORCES, series: SERIES };

export const aboutHistory = (kind) => KINDS[kind].about;

export const drawHistory = (node, items, kind) => draw(node, (look) => chart(look, items, KINDS[kind]));

function chart(look, items, shown) {
  const x = items.map((item) => item.sequence);
  // Stages sum over different recordings, so their values are not comparable: no line joins them.
  const points = items.flatMap((item, i) => (i && items[i - 1].stage !== item.stage ? [GAP, item] : [item]));
  const boundaries = items.filter((item, i) => i === 0 || items[i - 1].stage !== item.stage);
  const stages = new Set(boundaries.map((item) => item.stage));
  const upright = boundaries.length > SIDE_BY_SIDE;
  const dots = items.length < 3 || (shown !== TRACKS && items.length < FEW * boundaries.length);
  const line = (name, value, colour, width, labels) => ({
    x: points.map((item) => item.sequence), y: points.map(value), name, mode: dots ? "lines+markers" : "lines", type: "scatter",
    line: { color: colour, width }, marker: { color: colour, size: 6 }, text: labels,
    hovertemplate: `%{y:.4g} ${shown.unit}${labels ? "%{text}" : ""}<extra>${name}</extra>`,
  });
  const traces = [
    // A Gauss-Newton iteration has one individual and no mean; from a second start, it may lie above the best.
    line("mean", (item) => (item.stage?.endsWith(NEWTON) || item.mean === item.best ? null : shown.value(item, "mean")), look.faint, 1.5),
    line("best", (item) => shown.value(item, "best"), look.accent, 2.5, points.map((item) => (item === GAP ? "" : shown.hover(item)))),
    line("this start", (item) => (item.stage?.endsWith(NEWTON) && item.mean !== item.best ? shown.value(item, "mean") : null), look.quiet, 1.5),
  ].filter((trace) => trace.name !== "this start" || trace.y.some((value) => value !== null));
  return {
    traces, margin: { l: 10, r: 52, t: 26, b: 10 }, hovermode: "x unified",
    xaxis: axis(look, "generation", { showgrid: false, range: span(x), ...wholeTicks(x) }),
    yaxis: axis(look, `fitness, ${shown.unit}`, { type: "log", domain: [0, upright ? UNDER_NAMES : 1], ...logTicks(traces.flatMap((trace) => trace.y)) }),
    shapes: boundaries.slice(1).map((item) => ({
      type: "line", x0: item.sequence - 0.5, x1: item.sequence - 0.5, yref: "paper", y0: 0, y1: 1,
      line: { color: look.quiet, width: 1, dash: "dot" },
    })),
    annotations: [
      ...boundaries.map((item, i) => ({
        text: plain(stageLabel(item.stage, stages, upright)), x: i || upright ? item.sequence - 0.5 : item.sequence, yref: "paper", y: 1, xanchor: "left",
        yanchor: upright ? "top" : "bottom", textangle: upright ? 90 : 0, showarrow: false, font: { color: look.quiet, size: 12 },
      })),
      ...endLabels(traces),
    ],
  };
}

const span = (x) => (x.length > 1 ? [x[0] - 0.5, x.at(-1) + 0.5] : [0.5, 2.5]);

const niceStep = (least) => {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((digit) => digit * power).find((step) => step >= least * (1 - 1e-9));
};

const multiples = (step, low, high) => {
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.max(Math.floor(high / step + 1e-9) - first + 1, 0) }, (_, i) => (first + i) * step);
};

// Ticks at whole generations only.
const wholeTicks = (x) => {
  const step = Math.max(1, niceStep(Math.max(x.at(-1) - x[0], 1) / MOST_TICKS));
  return { tickmode: "array", tickvals: multiples(step, x[0], x.at(-1)), tickformat: "d" };
};

// Range and ticks of a log axis: at powers of ten; also at 2 and 5 where these are too few; evenly in a narrow range.
function logTicks(values) {
  const known = values.filter((value) => value > 0);
  if (!known.length) return {};
  const ends = [Math.min(...known), Math.max(...known)].map(Math.log10);
  const pad = Math.max(0.06 * (ends[1] - ends[0]), NARROWEST);
  const range = [ends[0] - pad, ends[1] + pad];
  const [low, high] = range.map((power) => 10 ** power);
  const powers = multiples(1, Math.floor(range[0]), Math.ceil(range[1]));
  const inside = (digits) => powers.flatMap((power) => digits.map((digit) => digit * 10 ** power)).filter((tick) => tick >= low && tick <= high);
  const round = [[1], [1, 2, 5]].map(inside).find((ticks) => ticks.length >= FEWEST_TICKS);
  const step = niceStep((high - low) / EVEN_TICKS);
  const ticks = round ?? multiples(step, low, high);
  const digits = round ? 1 : Math.max(1, Math.floor(Math.log10(high) + 1e-9) - Math.floor(Math.log10(step) + 1e-9) + 1);
  return { range, tickmode: "array", tickvals: ticks, ticktext: ticks.map((tick) => significant(tick, digits)) };
}

// Names at the ends of the lines instead of a legend.
function endLabels(traces) {
  const labels = traces.map(endLabel).filter(Boolean);
  const known = traces.flatMap((trace) => trace.y).filter((value) => value > 0).map(Math.log10);
  const height = Math.max(...known) - Math.min(...known);
  const [upper, lower] = labels.slice(-2).sort((a, b) => b.y - a.y);
  if (lower && upper.y - lower.y < 0.1 * height) {
    upper.yshift = 8;
    lower.yshift = -6;
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
