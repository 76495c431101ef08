// A finished run on series: recorded and simulated values of one channel over time.

import { $, plain, plural, toast } from "../base/format.js";
import { axis, draw, residualLine, withResidual } from "../base/plots.js";

const GAP = 1.9; // usual steps: a longer one is a gap

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
  draw($("curve-plot"), (look) => chart(look, broken(curve))).catch((error) => toast(error.message));
}

// The curve with a break wherever a step over time is much longer than usual: samples are missing there.
function broken({ time_s: time, recorded, nominal, best, ...rest }) {
  const steps = time.slice(1).map((value, k) => value - time[k]);
  const usual = [...steps].sort((a, b) => a - b)[Math.floor(steps.length / 2)];
  const apart = (values) => values?.flatMap((value, k) => (k && steps[k - 1] > GAP * usual ? [null, value] : [value])) ?? null;
  const at = time.flatMap((value, k) => (k && steps[k - 1] > GAP * usual ? [(value + time[k - 1]) / 2, value] : [value]));
  return { ...rest, time_s: at, recorded: apart(recorded), nominal: apart(nominal), best: apart(best) };
}

function chart(look, { unit, time_s: time, recorded, nominal, best }) {
  const shown = [
    ["recorded", recorded, { color: look.ink, width: 1.5 }], ["nominal genome", nominal, { color: look.faint, width: 1.5, dash: "dot" }],
    ["best genome", best, { color: look.accent, width: 1.75, dash: "dash" }],
  ];
  // That of the nominal genome is so much larger that nothing would be seen of the other.
  const residual = best ? [["best genome", best, {}]] : [["nominal genome", nominal, { line: { color: look.faint, width: 1.25, dash: "dot" } }]];
  return withResidual(look, {
    traces: shown.filter(([, y]) => y).map(([name, y, line]) => ({
      x: time, y, name, type: "scatter", mode: "lines", line, hovertemplate: `%{y:.4g}<extra>${name}</extra>`,
    })),
    residual: residual.filter(([, y]) => y).map(([name, y, more]) => residualLine(look, time, recorded, y, name, more)),
    x: axis(look, "time, s", { showgrid: false, range: [time[0], time.at(-1)] }), unit: unit === "1" ? "" : plain(unit),
  });
}
