// The side column: jobs that have not ended; and what all lists show of a job: its state, name, bar and time left.

import { isFinal } from "../base/api.js";
import { $, duration, el } from "../base/format.js";
import { modelOf } from "../base/labels.js";

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
export function replaced(list, items) {
  const fresh = el("ul", {}, ...items);
  if (list.dataset.shown === fresh.innerHTML) return;
  list.dataset.shown = fresh.innerHTML;
  const focused = list.contains(document.activeElement) ? document.activeElement.dataset.key : null;
  list.replaceChildren(...items);
  if (focused) list.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}

export const keyed = (node, key) => {
  node.dataset.key = key;
  return node;
};

const PAGES = { runs: "run", diagnoses: "diagnosis", trackings: "tracking" };

// Show the jobs that have not ended, by kind; without any there is no side column. ``isCurrent(page, id)``: the one shown.
export function drawActive(active, isCurrent) {
  const items = Object.entries(PAGES).flatMap(([kind, page]) => active[kind].map((job) => {
    const bar = el("div", { className: "bar" }, el("span"));
    setBar(bar, job);
    const card = el("a", { className: "card", href: `#${page}=${encodeURIComponent(job.id)}` },
      el("span", { className: "line" }, el("strong", {}, kind === "runs" ? runName(job) : job.name), badge(job)), bar,
      el("span", { className: "line" }, el("span", {}, page), el("span", {}, timeLeft(job) || `${Math.round(100 * job.progress)} %`)));
    const current = isCurrent(page, job.id);
    if (current) card.setAttribute("aria-current", "true");
    return el("li", { className: current ? "current" : "" }, keyed(card, `active-${job.id}`));
  }));
  document.body.classList.toggle("idle", !items.length);
  replaced($("active-jobs"), items);
}
