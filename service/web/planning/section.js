// The section "Plan" of a dataset: form, progress, answer. A plan goes on while other pages are looked at.

import { fill, part, postJson } from "../base/api.js";
import { command, copyable } from "../base/copying.js";
import { $, duration, el, plural, toast } from "../base/format.js";
import { isSeries } from "../base/labels.js";
import { drawAdditions, redrawAdditions } from "./additions.js";
import { drawHead, words } from "./head.js";
import { drawEffects } from "./effects.js";
import { effort, setUpForm, showFaults, showForm, values } from "./form.js";
import { drawGenes } from "./genes.js";

const TICK_MS = 1000;
const LONG_SECONDS = 20; // from which the genes, which take a few seconds, are shown first
const SLOWEST = 20; // times the usual time, which is that of an idle machine

let ready = null;
let dataset = null;
const plans = new Map(); // by id of the dataset: {stop, began, expected, first, failure, plan}; stop is null once it has ended
const pace = { tracks: 1, forces: 1 }; // how much longer than usual a plan took on this server
let ticking = null;

async function build() {
  await fill($("plan-part"), "planning/section.html");
  setUpForm({ onStart: start });
  $("plan-cancel").addEventListener("click", () => plans.get(dataset.id)?.stop?.abort());
}

// Hide what belongs to the dataset shown before.
export function hidePlan() {
  dataset = null;
  clearInterval(ticking);
  $("plan-part").hidden = true;
}

export async function showPlan(next) {
  dataset = next;
  if (isSeries(next)) {
    showCommand(next);
    $("plan-part").hidden = false;
    return;
  }
  try {
    await (ready ??= build());
  } catch (error) {
    ready = null;
    toast(error.message);
    return;
  }
  if (dataset !== next) return;
  $("plan-part").hidden = false; // not before: its name is its title
  const counted = next.recordings.filter((one) => !one.held_out).length;
  $("plan-about").textContent = `What recordings like these will show: how well each gene will be known, which effects will be distinguished, what to record next. The ${plural(counted, "recording")} to fit ${counted === 1 ? "is" : "are"} counted, with the noise seen in ${counted === 1 ? "it" : "them"}: after more data, plan again. Nothing is stored.`;
  show();
  await showForm(next);
  const { stop = null, failure = null } = plans.get(next.id) ?? {};
  if (dataset === next && failure && !stop) showFaults(failure, false);
}

// The server has no simulation of a rig of the user's own.
function showCommand({ id }) {
  ready = null;
  $("plan-part").replaceChildren(
    el("h3", { id: "plan-title", tabIndex: -1 }, "Plan"),
    el("p", { className: "quiet" }, "What recordings like these will show: how well each gene will be known, which effects will be distinguished, what to record next. Your machine simulates the rig: download the dataset, and plan there."),
    copyable(`${command(`wingfit datasets download ${id} -o ${id}.zip`)} && wingfit plan ${id}.zip --rig my_rig.py`, "commands that plan with a rig of your own"));
}

export function redrawPlan() {
  const one = dataset && plans.get(dataset.id);
  if (one?.plan && !$("plan-answer").hidden) redrawAdditions(one.plan, dataset);
}

export function revealPlan() {
  $("plan-title").scrollIntoView({ block: "start" });
  $("plan-title").focus({ preventScroll: true });
}

export function forgetPlan(id) {
  plans.get(id)?.stop?.abort();
  plans.delete(id);
}

// Seconds that a plan usually takes: simulations of all effects in the recordings, and in those that could be added.
function usual(kind, { effects, recordings, bodies, more }) {
  const each = kind === "tracks" ? ((0.8 + 0.3 * effects) * bodies) / 11 : 0.2 + 0.03 * effects;
  return Math.max(1, each * recordings * (more ? 1 : 0.5));
}

async function start() {
  const of = dataset;
  if (plans.get(of.id)?.stop) return;
  const stop = new AbortController();
  const work = effort();
  const one = { stop, began: Date.now(), expected: usual(of.kind, work) * pace[of.kind], first: false, failure: null, plan: plans.get(of.id)?.plan ?? null };
  plans.set(of.id, one);
  showFaults(null);
  show();
  const ask = (body) => postJson(`datasets/${part(of.id)}/plan`, body, {}, stop.signal);
  let failure = null;
  try {
    const body = await values();
    stop.signal.throwIfAborted();
    if (body.suspects !== null && one.expected > LONG_SECONDS) {
      one.plan = await ask({ ...body, suspects: null });
      one.first = true;
      const taken = (Date.now() - one.began) / 1e3;
      one.expected = taken + (usual(of.kind, work) * taken) / usual(of.kind, { ...work, effects: 0 }); // the effects take as much longer
      if (dataset?.id === of.id) show(); // it may have been fetched anew meanwhile
    }
    one.plan = await ask(body);
    pace[of.kind] = Math.min(SLOWEST, Math.max(1 / SLOWEST, (Date.now() - one.began) / 1e3 / usual(of.kind, work)));
  } catch (error) {
    failure = error;
  }
  const cancelled = stop.signal.aborted;
  one.stop = null;
  one.failure = cancelled ? null : failure;
  if (dataset?.id === of.id) {
    show();
    if (cancelled) toast(one.first ? "The plan was cancelled; what is shown has no effects" : "The plan was cancelled");
    else if (failure) showFaults(failure);
    else say(words(one.plan));
  } else if (!cancelled && plans.has(of.id)) {
    toast(failure ? `The plan of ${of.name} failed: ${failure.message}` : `The plan of ${of.name} is ready`);
  }
}

const say = (text) => { $("plan-said").textContent = text; };

// Show the plan of this dataset as it stands.
function show() {
  const one = plans.get(dataset.id) ?? null;
  const running = Boolean(one?.stop);
  clearInterval(ticking);
  $("plan-start").disabled = running;
  $("plan-start").textContent = running ? "Planning…" : one?.plan ? "Plan again" : "Plan";
  $("plan-cancel").hidden = !running;
  $("plan-progress").hidden = !running;
  if (running) {
    tick(one);
    ticking = setInterval(() => tick(one), TICK_MS);
    say(one.first ? "The genes are planned. The effects follow." : "The plan is being made.");
  }
  $("plan-answer").hidden = !one?.plan;
  $("plan-answer").classList.toggle("old", running && !one.first);
  if (!one?.plan) return;
  drawHead(one.plan);
  drawGenes(one.plan);
  drawAdditions(one.plan, dataset);
  drawEffects(one.plan);
}

function tick(one) {
  const seconds = (Date.now() - one.began) / 1e3;
  const share = Math.min(0.95, seconds / one.expected);
  const late = seconds > 1.2 * one.expected;
  $("plan-bar").firstElementChild.style.width = `${100 * share}%`;
  $("plan-bar").setAttribute("aria-valuetext", `${Math.round(seconds)} s`);
  $("plan-status").textContent = `Computing, ${duration(seconds)}; usually ${one.expected < 5 ? "a few seconds" : `about ${duration(one.expected)}`}.`
    + (one.first ? " The genes are below; the effects follow." : "")
    + (late ? " The server is busy: one plan is made at a time." : one.expected > LONG_SECONDS ? " You can look at other pages meanwhile." : "");
}
