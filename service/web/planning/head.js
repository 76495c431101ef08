// The answer of a plan in a sentence and key numbers.

import { showRemarks } from "../base/form_errors.js";
import { $, keyNumber, plural, rounded, significant } from "../base/format.js";

const SOURCES = { stated: "as stated", recordings: "as seen in the recordings", default: "a default; state yours" };

// Effects of typical size: those that are detected, and of these, those that nothing else looks like.
export function counted({ effects, confused, power }) {
  const alike = new Set(confused.flatMap(({ one, other }) => [one, other]));
  const detected = effects.filter((one) => one.detection_probability >= power);
  return { detected, apart: detected.filter(({ name }) => !alike.has(name)), alike };
}

export function words(plan) {
  const { genes, effects, for_genes: proposals } = plan;
  const known = genes.filter((gene) => gene.identified);
  const vague = genes.filter((gene) => !gene.identified).map(({ name }) => name);
  const parts = [vague.length
    ? `These recordings identify ${known.length} of ${plural(genes.length, "gene")}; not ${vague.join(", ")}.`
    : `These recordings identify ${genes.length === 1 ? "the gene" : `all ${genes.length} genes`}.`];
  if (effects.length) {
    const { detected, apart } = counted(plan);
    parts.push(`Of ${plural(effects.length, "effect")} of typical size, ${detected.length} will be detected, and ${apart.length} distinguished from all others.`);
  }
  if (proposals.length) {
    const { words: first, standard_error_factor: factor } = proposals[0];
    parts.push(`Record next for the genes: ${first}. It lowers their standard errors to ${Math.round(100 * factor)} %.`);
  }
  return parts.join(" ");
}

export function drawHead(plan) {
  const { genes, effects, noise, recordings, seconds, beats, frames, markers, kind } = plan;
  const { detected, apart } = counted(plan);
  const every = genes.filter((gene) => gene.identified).length;
  $("plan-sentence").textContent = words(plan);
  const cells = [keyNumber("genes identified", `${every} of ${genes.length}`, "", true)];
  if (effects.length) {
    cells.push(keyNumber("effects detected", `${detected.length} of ${effects.length}`, "", true), keyNumber("distinguished from all others", `${apart.length} of ${effects.length}`, "", true));
  }
  const per = kind === "forces" ? "samples" : "frames";
  cells.push(keyNumber(`${significant(beats, 3)} beats of ${significant(frames, 3)} ${per}${markers ? `, ${plural(markers, "marker")}` : ""}; ${significant(seconds, 3)} s of flapping`, String(recordings.length), recordings.length === 1 ? "recording" : "recordings"));
  const deviations = Object.values(noise.deviation);
  const [low, high] = [Math.min(...deviations), Math.max(...deviations)].map((value) => rounded(value, 2));
  const more = [noise.scatter_percent === null ? "" : `, ${rounded(noise.scatter_percent, 2)} % from beat to beat`, noise.correlation ? `, correlation ${rounded(noise.correlation, 2)}` : ""].join("");
  cells.push(keyNumber(`noise, ${SOURCES[noise.source] ?? noise.source}${more}`, low === high ? low : `${low}–${high}`, noise.unit));
  $("plan-numbers").replaceChildren(...cells);
  showRemarks($("plan-remarks"), plan.remarks, genes.map(({ name }) => name));
}
