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
    series: [1, 2, 3, 4].map((k) => colour(`series-${k}`)), accent: colour("accent"), ground: colour("ground"), surface: colour("surface"),
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
