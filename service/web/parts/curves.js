// A finished run on series: recorded and simulated values of one channel over time.

import { $, plain, plural, toast } from "../base/format.js";
import { axis, draw, residualLine, withResidual } from "../base/plots.js";

let curves = [];

export function setUpCurves() {
  $("curve").addEventListener("change", redrawCurves);
}

// ``found``: the curves of a result, worst first; none hides the chart.
export function showCurves(found) {
  curves = found ?? [];
  $("curves-part").hidden = !curves.length;
  if (!curves.length) return;
  $("curve").replaceChildren(...curves.map(({ recording, channel, held_out: heldOut }, k) =>
    new Option(`${channel} in ${recording}${heldOut ? " (held out)" : ""}`, String(k))));
  redrawCurves();
}

export function redrawCurves() {
  const curve = curves[Number($("curve").value)];
  if (!curve) return;
  const thinned = curve.stride > 1 ? ` One in ${curve.stride} of the samples is shown.` : "";
  const missing = curve.best ? "" : " The best genome cannot be simulated.";
  $("curves-note").textContent = `The ${plural(curves.length, "channel")} with the largest misfit, worst first.${thinned}${missing}`;
  draw($("curve-plot"), (look) => chart(look, curve)).catch((error) => toast(error.message));
}

function chart(look, { unit, time_s: time, recorded, nominal, best }) {
  const shown = [
    ["recorded", recorded, { color: look.ink, width: 1.5 }], ["nominal genome", nominal, { color: look.faint, width: 1.5, dash: "dot" }],
    ["best genome", best, { color: look.accent, width: 1.75, dash: "dash" }],
  ];
  const residual = [["nominal genome", nominal, { line: { color: look.faint, width: 1.25, dash: "dot" } }], ["best genome", best, {}]];
  return withResidual(look, {
    traces: shown.filter(([, y]) => y).map(([name, y, line]) => ({
      x: time, y, name, type: "scatter", mode: "lines", line, hovertemplate: `%{y:.4g}<extra>${name}</extra>`,
    })),
    residual: residual.filter(([, y]) => y).map(([name, y, more]) => residualLine(look, time, recorded, y, name, more)),
    x: axis(look, "time, s", { showgrid: false, range: [time[0], time.at(-1)] }), unit: unit === "1" ? "" : plain(unit),
  });
}
