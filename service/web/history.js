// Fitness by generation: best and mean on a log axis, with the boundaries of the stages.

import { mm, significant } from "./format.js";
import { axis, CONFIG, layout, plotly, theme } from "./plots.js";

const GAP = { sequence: null, best: null, mean: null, best_mm: null };

export async function drawHistory(node, items) {
  const Plotly = await plotly();
  const look = theme();
  const x = items.map((item) => item.sequence);
  // The stages sum over different recordings: a line across their boundary would compare what cannot be compared.
  const points = items.flatMap((item, i) => (i && items[i - 1].stage !== item.stage ? [GAP, item] : [item]));
  const line = (name, key, colour, width, labels) => ({
    x: points.map((item) => item.sequence), y: points.map((item) => item[key]), name, mode: items.length < 3 ? "lines+markers" : "lines", type: "scatter",
    line: { color: colour, width }, marker: { color: colour, size: 6 }, text: labels,
    hovertemplate: `%{y:.4g} m²${labels ? ", %{text} mm per marker" : ""}<extra>${name}</extra>`,
  });
  const traces = [
    line("mean", "mean", look.faint, 1.5),
    line("best", "best", look.accent, 2.5, points.map((item) => mm(item.best_mm))),
  ];
  const boundaries = items.filter((item, i) => i === 0 || items[i - 1].stage !== item.stage);
  const figure = layout(look, {
    margin: { l: 10, r: 52, t: 26, b: 10 }, hovermode: "x unified",
    xaxis: axis(look, { title: { text: "generation", standoff: 8 }, showgrid: false, range: span(x), tickformat: "d" }),
    yaxis: axis(look, {
      title: { text: "fitness, m²", standoff: 8 }, type: "log", ...logTicks(traces.flatMap((trace) => trace.y)),
    }),
    shapes: boundaries.slice(1).map((item) => ({
      type: "line", x0: item.sequence - 0.5, x1: item.sequence - 0.5, yref: "paper", y0: 0, y1: 1,
      line: { color: look.quiet, width: 1, dash: "dot" },
    })),
    annotations: [
      ...boundaries.map((item, i) => ({
        text: `${item.stage} stage`, x: i ? item.sequence - 0.5 : item.sequence, yref: "paper", y: 1, xanchor: "left",
        yanchor: "bottom", showarrow: false, font: { color: look.quiet, size: 12 },
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
  const digits = high / low < 300 ? [1, 2, 5] : [1];
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
