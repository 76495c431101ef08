// The sidebar: newest runs, diagnoses and datasets.

import { isFinal } from "../base/api.js";
import { $, DASH, duration, el, plural, size, when } from "../base/format.js";
import { contents, misfit, modelOf } from "../base/labels.js";
import { warningBadge } from "./warnings.js";

const WORDS = {
  QUEUED: "waiting", RUNNING: "running", PAUSED: "paused", SUCCEEDED: "done", FAILED: "failed", CANCELLED: "cancelled",
};
const LOOKS = { RUNNING: "live", SUCCEEDED: "good", FAILED: "bad" };
const WISHES = { PAUSE: "pausing", CANCEL: "cancelling" };

export const stateWord = (state) => WORDS[state];

export const badge = (run) => el("span", { className: `badge ${LOOKS[run.state] ?? ""}` }, WISHES[run.pending_action] ?? WORDS[run.state]);

export const runName = (run) => run.name || `${modelOf(run)}, ${run.spec.mode}`;

export function setBar(bar, run) {
  const percent = Math.round(100 * run.progress);
  bar.firstElementChild.style.width = `${percent}%`;
  if (bar.role) bar.setAttribute("aria-valuenow", percent); // bars in the lists have no role: their text is beside them
  bar.classList.toggle("ended", isFinal(run) && run.state !== "SUCCEEDED");
}

export function timeLeft(run) {
  const left = duration(run.eta_seconds);
  if (run.state === "RUNNING") return left ? `${left} left` : "";
  return "";
}

// Replace the items only if they changed, so that polling does not interrupt a click, and restore the focus.
function replace(list, items) {
  const fresh = el("ul", {}, ...items);
  if (list.dataset.shown === fresh.innerHTML) return;
  list.dataset.shown = fresh.innerHTML;
  const focused = list.contains(document.activeElement) ? document.activeElement.dataset.key : null;
  list.replaceChildren(...items);
  if (focused) list.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}

const keyed = (node, key) => {
  node.dataset.key = key;
  return node;
};

export function drawRuns(runs, currentId) {
  const items = runs.map((run) => {
    const bar = el("div", { className: "bar" }, el("span"));
    setBar(bar, run);
    const { value, unit } = misfit(run);
    const best = value === DASH ? "" : `${value} ${unit}`;
    const card = el("a", { className: "card", href: `#run=${encodeURIComponent(run.id)}` },
      el("span", { className: "line" }, el("strong", {}, runName(run)), badge(run)), bar,
      el("span", { className: "line" }, el("span", {}, timeLeft(run) || when(run.created_at)), el("span", {}, best)));
    if (run.id === currentId) card.setAttribute("aria-current", "true");
    return el("li", { className: run.id === currentId ? "current" : "" }, keyed(card, run.id));
  });
  replace($("newest-runs"), items.length ? items : [el("li", { className: "none" }, "No runs yet.")]);
}

export function drawDiagnoses(diagnoses, currentId) {
  const items = diagnoses.map((diagnosis) => {
    const bar = el("div", { className: "bar" }, el("span"));
    setBar(bar, diagnosis);
    const card = el("a", { className: "card", href: `#diagnosis=${encodeURIComponent(diagnosis.id)}` },
      el("span", { className: "line" }, el("strong", {}, diagnosis.name), badge(diagnosis)), bar,
      el("span", { className: "line" }, el("span", {}, timeLeft(diagnosis) || when(diagnosis.created_at)),
        el("span", {}, diagnosis.verdict ?? "")));
    if (diagnosis.id === currentId) card.setAttribute("aria-current", "true");
    return el("li", { className: diagnosis.id === currentId ? "current" : "" }, keyed(card, diagnosis.id));
  });
  replace($("newest-diagnoses"), items.length ? items : [el("li", { className: "none" }, "No diagnoses yet.")]);
}

export function drawDatasets(datasets, { onRun, onDiagnose, onDelete }) {
  const items = datasets.map((dataset) => {
    const held = dataset.recordings.filter((recording) => recording.held_out).length;
    const about = `${plural(dataset.recordings.length, "recording")} of ${contents(dataset)}${held ? `, ${held} held out` : ""}`;
    const button = (text, action, key) => keyed(el("button", { type: "button", onclick: () => action(dataset) }, text), `${key}-${dataset.id}`);
    return el("li", {}, el("div", { className: "card" },
      el("a", { href: `#dataset=${encodeURIComponent(dataset.id)}`, title: dataset.description }, el("strong", {}, dataset.name)),
      ...warningBadge(dataset),
      el("span", { className: "line" }, el("span", {}, about), el("span", {}, size(dataset.size_bytes))),
      el("div", { className: "buttons" }, button("New run", onRun, "run"), button("Diagnose", onDiagnose, "diagnose"),
        keyed(el("a", { className: "link-button", href: `v1/datasets/${encodeURIComponent(dataset.id)}/archive`, download: "" }, "Download"), `get-${dataset.id}`),
        button("Delete", onDelete, "delete"))));
  });
  replace($("newest-datasets"), items.length ? items : [el("li", { className: "none" }, "No datasets yet. Upload a zip of a folder with dataset.yaml.")]);
}
