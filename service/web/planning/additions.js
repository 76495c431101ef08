// What to record next, where these conditions lie, and how many beats, frames and markers suffice.

import { $, el, plain, plural, toast } from "../base/format.js";
import { axis, draw } from "../base/plots.js";

const WAYS = [
  ["flap_frequency_hz", "flap frequency, Hz"], ["airspeed_m_s", "airspeed, m/s"], ["angle_of_attack_deg", "angle of attack, deg"],
  ["phase_lag_deg", "phase lag, deg"], ["pressure_mbar", "pressure, mbar"],
];
const PLOTS = { beats: "plan-beats", frames: "plan-frames-plot", markers: "plan-markers" };

export function drawAdditions(plan, dataset) {
  const { for_genes: genes, for_effects: effects, kind } = plan;
  $("plan-additions").hidden = !genes.length && !effects.length;
  list($("plan-for-genes"), genes, "standard_error_factor");
  list($("plan-for-effects"), effects, "separation_factor");
  $("plan-t").hidden = !plan.effects.length;
  $("plan-t-note").hidden = effects.length > 0;
  $("plan-t-note").textContent = "No two of the effects that will be detected need to be distinguished.";
  const beyond = [...new Set([...genes, ...effects].flatMap((one) => one.beyond))];
  $("plan-beyond").hidden = !beyond.length;
  $("plan-beyond").textContent = `Marked: ${beyond.join(" and ")} beyond the recorded range; the rig must allow it.`;
  $("plan-frames-title").textContent = `${kind === "forces" ? "Samples" : "Frames"} per beat`;
  $("plan-enough").textContent = enough(plan);
  for (const [what, id] of Object.entries(PLOTS)) $(id).parentElement.hidden = !points(plan, what).length;
  redrawAdditions(plan, dataset);
}

export function redrawAdditions(plan, dataset) {
  const charts = Object.entries(PLOTS).filter(([what]) => points(plan, what).length).map(([what, id]) => draw($(id), (look) => variants(look, points(plan, what), plan)));
  if (!$("plan-additions").hidden) charts.push(conditions(plan, dataset));
  Promise.all(charts).catch((error) => toast(error.message));
}

// The proposals of one kind. Their factors are those with all recordings up to that one; each has its own, too.
function list(node, proposals, factor) {
  const lowers = factor === "standard_error_factor";
  const farthest = Math.max(1, ...proposals.map((one) => one[factor]));
  node.replaceChildren(...proposals.map((one, k) => {
    const own = Math.round(100 * (one[factor] / (k ? proposals[k - 1][factor] : 1) - 1));
    const total = Math.round(100 * one[factor]);
    const share = el("span", { className: "share", ariaHidden: "true" }, el("i"));
    share.firstChild.style.width = `${(100 * one[factor]) / farthest}%`;
    const text = lowers ? `standard errors ${own < 0 ? "−" : "+"}${Math.abs(own)} %` : `distances of effects ${own < 0 ? "−" : "+"}${Math.abs(own)} %`;
    return el("li", {}, el("span", { className: "line" }, el("strong", {}, one.words), " ", one.beyond.length ? el("span", { className: "badge fit-doubtful", title: `beyond the recorded range: ${one.beyond.join(", ")}` }, `beyond: ${one.beyond.join(", ")}`) : null),
      share, el("span", { className: "quiet" }, `${text}; with all up to here ${total} %`));
  }));
}

// Where the recorded and the proposed conditions lie, in the two settings that differ most.
function conditions(plan, dataset) {
  const at = (one) => (one.repeats === null ? one.condition : dataset.recordings.find(({ name }) => name === one.repeats) ?? {});
  const [genes, effects] = [plan.for_genes, plan.for_effects].map((proposals) => proposals.map(at));
  const all = [...dataset.recordings, ...genes, ...effects];
  const close = (value) => Number((value ?? 0).toPrecision(4));
  const varied = WAYS.map(([name, title]) => ({ name, title, count: new Set(all.map((one) => close(one[name]))).size })).sort((a, b) => b.count - a.count);
  const [across, up] = varied;
  $("plan-conditions-title").textContent = `Recorded and proposed conditions: ${up.title} against ${across.title}`;
  const dots = (look, those, name, marker, text = null, position = "top center") => ({
    type: "scatter", mode: text ? "markers+text" : "markers", name, x: those.map((one) => one[across.name]), y: those.map((one) => one[up.name]), marker,
    ...(text ? { text, textposition: position, textfont: { color: look.ink, size: 12 }, cliponaxis: false } : { text: those.map((one) => plain(one.name)) }),
    hovertemplate: `${text ? "" : "%{text}<br>"}${across.title} %{x:.4g}, ${up.title} %{y:.4g}<extra>${name}</extra>`,
  });
  // A condition that is proposed several times has all its places.
  const merged = (those) => {
    const groups = Map.groupBy(those.map((one, k) => [one, k + 1]), ([one]) => `${close(one[across.name])} ${close(one[up.name])}`);
    return [...groups.values()].map((group) => [group[0][0], group.map(([, k]) => k).join(", ")]);
  };
  const proposed = (look, those, name, marker, position) => {
    const found = merged(those);
    return found.length ? [dots(look, found.map(([one]) => one), name, marker, found.map(([, text]) => text), position)] : [];
  };
  return draw($("plan-conditions"), (look) => ({
    traces: [
      dots(look, dataset.recordings, "recorded", { size: 8, color: look.faint }),
      ...proposed(look, genes, "for the genes", { size: 15, symbol: "circle-open", color: look.accent, line: { width: 2.5 } }, "top center"),
      ...proposed(look, effects, "to distinguish effects", { size: 13, symbol: "diamond-open", color: look.series[1], line: { width: 2.5 } }, "bottom center"),
    ],
    showlegend: true, xaxis: axis(look, across.title), yaxis: axis(look, up.title),
  }));
}

// The planned number with its factor 1, and those that were tried, by number; none if there is nothing to compare.
function points(plan, what) {
  const those = plan.variants.filter((one) => one.what === what);
  if (!those.length) return [];
  const known = plan.genes.filter((gene) => gene.identified).length;
  const planned = { what, number: Math.round(plan[what]), standard_error_factor: 1, identified: known, planned: true };
  return [...those.filter((one) => one.number !== planned.number), planned].sort((a, b) => a.number - b.number);
}

// Fewest of each that identify as many genes as planned, and what more would identify.
function enough(plan) {
  const unit = { beats: "beats", frames: `${plan.kind === "forces" ? "samples" : "frames"} per beat`, markers: "markers" };
  const sentences = Object.keys(PLOTS).flatMap((what) => {
    const found = points(plan, what);
    if (!found.length) return [];
    const planned = found.find((one) => one.planned);
    const fewest = found.find((one) => one.identified >= planned.identified);
    const more = found.find((one) => one.identified > planned.identified);
    const same = fewest.number < planned.number ? `${fewest.number} ${unit[what]} identify as many genes as ${planned.number}` : `fewer than ${planned.number} ${unit[what]} identify fewer genes`;
    return [`${same}${more ? `; ${more.number} identify ${plural(more.identified, "gene")}` : ""}.`];
  });
  return `Planned (filled): ${plural(plan.genes.filter((gene) => gene.identified).length, "gene")} of ${plan.genes.length} identified. ${sentences.map((text) => text[0].toUpperCase() + text.slice(1)).join(" ")}`;
}

function variants(look, found, plan) {
  const numbers = found.map((one) => one.number);
  return {
    traces: [{
      type: "scatter", mode: "lines+markers", x: numbers, y: found.map((one) => one.standard_error_factor), line: { color: look.accent, width: 2 },
      marker: { color: found.map((one) => (one.planned ? look.accent : look.surface)), size: 9, line: { color: look.accent, width: 2 } },
      customdata: found.map((one) => one.identified), hovertemplate: `%{x}: standard errors × %{y:.2f}<br>%{customdata} of ${plan.genes.length} genes identified<extra></extra>`,
    }],
    shapes: [{ type: "line", xref: "paper", x0: 0, x1: 1, y0: 1, y1: 1, line: { color: look.faint, width: 1, dash: "dot" } }],
    margin: { l: 10, r: 12, t: 8, b: 10 },
    xaxis: axis(look, "", { type: "log", showgrid: false, tickmode: "array", tickvals: numbers, ticktext: numbers.map(String), tickangle: 0, minor: { ticks: "" } }),
    yaxis: axis(look, "standard errors, ×", { rangemode: "tozero", nticks: 5, tickformat: ".2~f" }),
  };
}

