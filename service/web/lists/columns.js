// The columns of the tables of runs, diagnoses and datasets: heading, order by which the server sorts, and content.

import { part } from "../base/api.js";
import { DASH, el, rounded, size, when } from "../base/format.js";
import { fitBadge, isForces, isSeries, METHODS, misfit, modelOf, withEffects } from "../base/labels.js";
import { badge, runName, timeLeft } from "../parts/sidebar.js";
import { warningBadge } from "../parts/warnings.js";

const UNKNOWN_NOISE = "The noise of the recordings is not known";

// A link with a key, by which the focus is restored after the rows are redrawn.
function open(page, id, text, row = id) {
  const link = el("a", { href: `#${page}=${part(id)}` }, text);
  link.dataset.key = `${page}-${row}`;
  return link;
}

const named = (page, item, text = item.name) => [open(page, item.id, text), item.notes ? el("small", { className: "note", title: item.notes }, item.notes) : null];

// A multiple of the noise; a job that has succeeded and has none was computed on recordings without known noise.
export function overNoise(job, name) {
  const value = job[name] ?? null;
  if (value !== null) return rounded(value, 2);
  if (job.state !== "SUCCEEDED") return DASH;
  const held = name === "held_out_over_noise" && (job.residual_over_noise ?? null) !== null;
  return el("span", { title: held ? "No recording was held out, or its noise is not known" : UNKNOWN_NOISE }, DASH);
}

const state = (job) => [badge(job), timeLeft(job) ? el("small", {}, ` ${timeLeft(job)}`) : null];
const model = (job) => [modelOf(job), withEffects(job)].filter(Boolean).join(" ");
const method = (run) => [METHODS[run.spec.method] ?? run.spec.method, run.spec.mode].filter(Boolean).join(", ");

function best(run) {
  const { value, unit } = misfit(run);
  return value === DASH ? DASH : `${value} ${unit}`;
}

export function kindOf(dataset) {
  if (isSeries(dataset)) return `series of rig ${dataset.rig.name}`;
  return isForces(dataset) ? "forces" : "tracked markers";
}

const FIT = [
  { head: "Fit", sort: "fit", cell: (job) => fitBadge(job) ?? DASH },
  { head: "Residual / noise", sort: "residual_over_noise", cell: (job) => overNoise(job, "residual_over_noise"), number: true },
  { head: "Held out / noise", sort: "held_out_over_noise", cell: (job) => overNoise(job, "held_out_over_noise"), number: true },
];
const dataset = { head: "Dataset", sort: "dataset", cell: (job, name) => open("dataset", job.dataset_id, name(job.dataset_id), job.id), wraps: true };
const submitted = (head) => ({ head, sort: "created_at", cell: (item) => when(item.created_at), wraps: true });

// ``cell`` takes an item, and a function from the id of a dataset to its name.
export const COLUMNS = {
  runs: [
    { head: "Name", sort: "name", cell: (run) => named("run", run, runName(run)), wraps: true },
    dataset, { head: "State", sort: "state", cell: state }, ...FIT,
    { head: "Misfit", sort: "misfit", cell: best, number: true },
    { head: "Model", sort: "model", cell: model, wraps: true },
    { head: "Method", sort: "method", cell: method, wraps: true },
    { head: "Generations", sort: "generations", cell: (run) => run.generations.toLocaleString("en"), number: true },
    submitted("Submitted"),
  ],
  diagnoses: [
    { head: "Name", sort: "name", cell: (diagnosis) => named("diagnosis", diagnosis), wraps: true },
    dataset, { head: "State", sort: "state", cell: state },
    { head: "Verdict", sort: "verdict", cell: (diagnosis) => diagnosis.verdict ?? DASH }, ...FIT,
    { head: "Model", sort: "model", cell: model, wraps: true },
    submitted("Submitted"),
  ],
  datasets: [
    { head: "Name", sort: "name", cell: (one) => [...named("dataset", one), ...warningBadge(one)], wraps: true },
    { head: "Kind", sort: "kind", cell: kindOf },
    { head: "Recordings", sort: "recordings", cell: (one) => String(one.recordings.length), number: true },
    { head: "Held out", sort: "held_out", cell: (one) => String(one.recordings.filter((recording) => recording.held_out).length), number: true },
    { head: "Size", sort: "size_bytes", cell: (one) => size(one.size_bytes), number: true },
    submitted("Uploaded"),
  ],
};
