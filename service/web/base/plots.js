// Plotly, loaded when the first figure is drawn, and the look that all figures share.

let loading = null;

export function plotly() {
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

export const CONFIG = { responsive: true, displayModeBar: false, displaylogo: false, scrollZoom: false };

export function theme() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ink: colour("ink"), quiet: colour("quiet"), faint: colour("faint"), line: colour("line"),
    series: [1, 2, 3, 4, 5, 6].map((k) => colour(`series-${k}`)), accent: colour("accent"), ground: colour("ground"), surface: colour("surface"),
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: colour("quiet") },
  };
}

export function layout(look, extra) {
  return {
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: look.font, showlegend: false,
    hoverlabel: { bgcolor: look.surface, bordercolor: look.line, font: { color: look.ink, size: 12 } },
    ...extra,
  };
}

export const axis = (look, extra) => ({
  gridcolor: look.line, linecolor: look.line, zeroline: false, ticks: "", automargin: true, ...extra,
});

export const legend = (look) => ({
  showlegend: true, legend: { orientation: "h", traceorder: "normal", x: 0, y: 1.02, yanchor: "bottom", font: { color: look.ink, size: 12 } },
});

export const PHASE = { range: [0, 1], dtick: 0.25 };

// Curves [name, y] over the phase of the beat, or with ``dots`` over something else; ``first`` is how the first is drawn.
export async function lines(node, x, series, { unit, x: xTitle = "phase of the beat", dots = false, shades = false, first = null }) {
  const Plotly = await plotly();
  const look = theme();
  const traces = series.map(([name, y], k) => {
    const colour = shades ? look.accent : look.series[k];
    return {
      x, y, name, type: "scatter", mode: (k === 0 && first) || (dots ? "lines+markers" : "lines"), opacity: shades ? 1 - (0.75 * k) / series.length : 1,
      line: { color: colour, width: 2, simplify: false }, marker: { color: colour, size: 6 }, hovertemplate: `%{y:.3g} ${unit}<extra>${name}</extra>`,
    };
  });
  const figure = layout(look, {
    margin: { l: 10, r: 8, t: 30, b: 10 }, hovermode: "x unified", ...legend(look),
    xaxis: axis(look, { title: { text: xTitle, standoff: 6 }, showgrid: false, ...(dots ? {} : PHASE) }),
    yaxis: axis(look, { title: { text: unit, standoff: 6 }, zeroline: true, zerolinecolor: look.faint, zerolinewidth: 1, nticks: 6 }),
  });
  return Plotly.react(node, traces, figure, CONFIG);
}
