// The chart of the count of markers that were found over time.

import { axis, draw } from "../base/plots.js";

export const drawFound = (node, { times_s: times, found, markers }) => draw(node, (look) => ({
  traces: [{
    x: times, y: found, type: "scatter", mode: "lines", line: { color: look.accent, width: 2, simplify: false },
    hovertemplate: "%{y} markers at %{x:.4g} s<extra></extra>",
  }],
  xaxis: axis(look, "time, s", { showgrid: false }),
  yaxis: axis(look, `markers of ${Object.keys(markers).length}`, { range: [0, 1.05 * Math.max(1, Object.keys(markers).length)], nticks: 6 }),
}));
