// The charts of all pages: Plotly, loaded when the first one is drawn, and the look that they share.

let loading = null;

function plotly() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "assets/plotly.min.js";
    script.onload = () => resolve(window.Plotly);
    script.onerror = () => {
      loading = null;
      script.remove();
      reject(new Error("The drawing library could not be loaded."));
    };
    document.head.append(script);
  });
  return loading;
}

const CONFIG = { responsive: true, displayModeBar: false, displaylogo: false, scrollZoom: false };

export const PHASE = { range: [0, 1], dtick: 0.25 };

// Colours and font of the page, in its light or dark theme.
function theme() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ink: colour("ink"), quiet: colour("quiet"), faint: colour("faint"), line: colour("line"),
    series: [1, 2, 3, 4, 5, 6].map((k) => colour(`series-${k}`)), accent: colour("accent"), bad: colour("bad"), ground: colour("ground"), surface: colour("surface"),
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colour("quiet") },
  };
}

export const axis = (look, title, extra = {}) => ({
  gridcolor: look.line, linecolor: look.line, zeroline: false, ticks: "", automargin: true, title: { text: title, standoff: 6 }, ...extra,
});

// An axis on which zero is marked.
export const zeroAxis = (look, title, extra = {}) =>
  axis(look, title, { zeroline: true, zerolinecolor: look.faint, zerolinewidth: 1, nticks: 6, ...extra });

// Draw a chart into ``node``. ``build`` takes the theme; it returns the traces and what differs from the common layout.
export async function draw(node, build) {
  const Plotly = await plotly();
  const look = theme();
  const { traces, ...own } = build(look);
  await Plotly.react(node, traces, {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: look.font, margin: { l: 10, r: 8, t: 30, b: 10 },
    showlegend: false, legend: { orientation: "h", traceorder: "normal", x: 0, y: 1.02, yanchor: "bottom", font: { color: look.ink, size: 12 } },
    hoverlabel: { bgcolor: look.surface, bordercolor: look.line, font: { color: look.ink, size: 12 } },
    ...own,
  }, CONFIG);
  // A chart that was drawn while its page was left has a width of its own.
  if (node.clientWidth && Math.abs(node._fullLayout.width - node.clientWidth) > 1) await Plotly.Plots.resize(node);
}

// Draw curves [name, y] over the phase of the beat, or over something else with ``dots``.
export const lines = (node, x, series, { unit, x: xTitle = "phase of the beat", dots = false, shades = false }) => draw(node, (look) => ({
  traces: series.map(([name, y], k) => {
    const colour = shades ? look.accent : look.series[k];
    return {
      x, y, name, type: "scatter", mode: dots ? "lines+markers" : "lines", opacity: shades ? 1 - (0.75 * k) / series.length : 1,
      line: { color: colour, width: 2, simplify: false }, marker: { color: colour, size: 6 }, hovertemplate: `%{y:.3g} ${unit}<extra>${name}</extra>`,
    };
  }),
  showlegend: true, hovermode: "x unified", xaxis: axis(look, xTitle, { showgrid: false, ...(dots ? {} : PHASE) }), yaxis: zeroAxis(look, unit),
}));

// A chart in two panels over one x axis: ``traces`` above, and below them ``residual`` (y2), recorded minus simulated.
export function withResidual(look, { traces, residual, x, unit, residualUnit = unit, y = {} }) {
  return {
    traces: [...traces, ...residual.map((trace) => ({ showlegend: false, ...trace, yaxis: "y2" }))], showlegend: true, hovermode: "x unified",
    margin: { l: 10, r: 8, t: 30, b: 34 },
    xaxis: { ...x, anchor: "y2" }, yaxis: { ...zeroAxis(look, unit), domain: [0.34, 1], ...y },
    yaxis2: { ...zeroAxis(look, `residual${residualUnit ? `, ${residualUnit}` : ""}`), domain: [0, 0.26], nticks: 4 },
  };
}

// The line of recorded minus simulated values.
export const residualLine = (look, x, recorded, simulated, name, more = {}) => ({
  x, y: recorded.map((value, i) => (value === null || simulated[i] === null ? null : value - simulated[i])), name: `residual, ${name}`,
  type: "scatter", mode: "lines", line: { color: look.accent, width: 1.5, simplify: false }, hovertemplate: `%{y:.3~s}<extra>residual, ${name}</extra>`, ...more,
});
