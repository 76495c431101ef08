// The start page (#): three steps as long as there is no dataset; then the newest findings, runs and datasets.

import { part, poll } from "../base/api.js";
import { $, DASH, el, plural, size, when } from "../base/format.js";
import { contents, fitBadge, misfit } from "../base/labels.js";
import { badge, keyed, replaced, runName } from "../parts/sidebar.js";
import { warningBadge } from "../parts/warnings.js";

const SHOWN = 5;
const TITLES = ["Newest results", "Start in three steps"];

let names = new Map();

// The newest items of all kinds.
export async function newest() {
  const [diagnoses, runs, datasets] = await Promise.all(
    [`diagnoses?state=SUCCEEDED&limit=${SHOWN}`, `runs?limit=${SHOWN}`, `datasets?limit=${SHOWN}`].map((path) => poll(path).then((page) => page.items)));
  for (const dataset of datasets) names.set(dataset.id, dataset.name);
  const unknown = [...new Set([...diagnoses, ...runs].map((job) => job.dataset_id))].filter((id) => !names.has(id));
  await Promise.all(unknown.map((id) => poll(`datasets/${part(id)}`).then((dataset) => names.set(id, dataset.name), () => names.set(id, id))));
  return { diagnoses, runs, datasets };
}

const text = (content) => el("span", { className: "quiet", title: content }, content);

function line(page, job, name, ...tags) {
  const card = el("a", { className: "card", href: `#${page}=${part(job.id)}` }, el("strong", { title: name }, name), el("span", { className: "tags" }, ...tags),
    text(names.get(job.dataset_id) ?? job.dataset_id), text(when(job.created_at)));
  return el("li", {}, keyed(card, job.id));
}

function ofRun(run) {
  const { value, unit } = misfit(run);
  return line("run", run, runName(run), badge(run), fitBadge(run), value === DASH ? null : text(`${value} ${unit}`));
}

function ofDataset(dataset, { onRun, onDiagnose, onDelete }) {
  const held = dataset.recordings.filter((recording) => recording.held_out).length;
  const about = `${plural(dataset.recordings.length, "recording")} of ${contents(dataset)}${held ? `, ${held} held out` : ""}`;
  const button = (label, action, key) => keyed(el("button", { type: "button", ariaLabel: `${label}: ${dataset.name}`, onclick: () => action(dataset) }, label), `${key}-${dataset.id}`);
  return el("li", {}, el("div", { className: "card" },
    el("span", {}, el("a", { href: `#dataset=${part(dataset.id)}`, title: dataset.description }, el("strong", {}, dataset.name)), ...warningBadge(dataset)),
    text(about), text(size(dataset.size_bytes)),
    el("span", { className: "buttons" }, button("Diagnose", onDiagnose, "diagnose"), button("New run", onRun, "run"),
      keyed(el("a", { className: "link-button", href: `v1/datasets/${part(dataset.id)}/archive`, download: "", ariaLabel: `Download: ${dataset.name}` }, "Download"), `get-${dataset.id}`),
      button("Delete", onDelete, "delete"))));
}

export function drawHome({ diagnoses, runs, datasets }, actions) {
  const empty = !datasets.length;
  $("home-steps").hidden = !empty;
  $("home-lists").hidden = empty;
  const title = $("empty-title"); // it may say what was not found
  if (TITLES.includes(title.textContent)) title.textContent = TITLES[Number(empty)];
  title.classList.toggle("hidden", title.textContent === TITLES[0]);
  const none = (words) => [el("li", { className: "none" }, words)];
  replaced($("newest-diagnoses"), diagnoses.length ? diagnoses.map((one) => line("diagnosis", one, one.name, el("span", {}, one.verdict), fitBadge(one))) : none("No findings yet: diagnose a dataset."));
  replaced($("newest-runs"), runs.length ? runs.map(ofRun) : none("No runs yet."));
  replaced($("newest-datasets"), datasets.length ? datasets.map((one) => ofDataset(one, actions)) : none("No datasets yet."));
}
