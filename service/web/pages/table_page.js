// Tables of all runs, diagnoses and datasets (#runs, #diagnoses, #datasets), newest first.

import { get, part } from "../base/api.js";
import { $, DASH, el, plural, size, toast, when } from "../base/format.js";
import { badge, runName, stateWord, timeLeft } from "../parts/sidebar.js";
import { warningBadge } from "../parts/warnings.js";
import { isForces, isSeries, METHODS, misfit, modelOf, withEffects } from "../base/labels.js";

const SHOWN = 100;
export const MOST_COMPARED = 6;
const STATES = ["QUEUED", "RUNNING", "PAUSED", "SUCCEEDED", "FAILED", "CANCELLED"];

const KINDS = {
  runs: {
    title: "Runs", page: "run", states: STATES, row: runRow,
    heads: ["", "Name", "Dataset", "State", "Misfit", "Model", "Method", "Generations", "Submitted"],
  },
  diagnoses: {
    title: "Diagnoses", page: "diagnosis", states: STATES.filter((state) => state !== "PAUSED"), row: diagnosisRow,
    heads: ["Name", "Dataset", "State", "Verdict", "Model", "Submitted"],
  },
  datasets: {
    title: "Datasets", page: "dataset", row: datasetRow,
    heads: ["Name", "Kind", "Recordings", "Held out", "Size", "Uploaded"],
  },
};

let kind = null;
let filters = {};
let items = [];
let cursor = null;
let names = new Map();
let chosen = new Set();
let request = 0;

// A link with a key, by which the focus is restored after the rows are redrawn.
function open(page, id, text, row = id) {
  const link = el("a", { href: `#${page}=${part(id)}` }, text);
  link.dataset.key = `${page}-${row}`;
  return link;
}
const datasetName = (id) => names.get(id) ?? id;

export function setUpListing() {
  for (const name of ["state", "dataset"]) $(`listing-${name}`).addEventListener("change", filtered);
  $("listing-more").addEventListener("click", () => load());
  $("compare").addEventListener("click", () => { location.hash = `compare=${[...chosen].map(part).join(",")}`; });
}

// Show the table of ``next`` ("runs", "diagnoses", "datasets"), or hide it; ``parameters`` are those of the address.
export async function showListing(next, parameters) {
  const mine = ++request;
  kind = next;
  $("listing").hidden = !kind;
  if (!kind) return;
  const { title, heads, states } = KINDS[kind];
  document.title = `${title} · wingfit`;
  filters = Object.fromEntries(["state", "dataset_id"].filter((name) => states && parameters.get(name) && (name !== "state" || states.includes(parameters.get(name)))).map((name) => [name, parameters.get(name)]));
  [items, cursor, chosen] = [[], null, new Set()];
  $("listing-title").textContent = title;
  $("listing-filters").hidden = !states;
  $("compare").hidden = kind !== "runs";
  $("listing-import").hidden = kind !== "datasets";
  $("listing-table").tHead.replaceChildren(el("tr", {}, ...heads.map((head) =>
    el("th", { scope: "col" }, head || el("span", { className: "hidden" }, "Compare")))));
  draw();
  if (states) await fillFilters(states, mine);
  if (mine === request) await load(true);
}

// Take over changes from the lists of the sidebar.
export function refreshListing(fresh) {
  if (!kind) return;
  const known = new Map(fresh[kind].map((item) => [item.id, item]));
  if (!items.some((item) => known.has(item.id) && JSON.stringify(known.get(item.id)) !== JSON.stringify(item))) return;
  items = items.map((item) => known.get(item.id) ?? item);
  draw();
}

async function fillFilters(states, mine) {
  try {
    const page = await get("datasets?limit=200");
    names = new Map(page.items.map((dataset) => [dataset.id, dataset.name]));
  } catch { /* the filter then lists ids; loading the table reports the error */ }
  if (mine !== request) return;
  $("listing-state").replaceChildren(new Option("all", ""), ...states.map((state) => new Option(stateWord(state), state)));
  $("listing-state").value = filters.state ?? "";
  const known = [...names].map(([id, name]) => new Option(name, id));
  if (filters.dataset_id && !names.has(filters.dataset_id)) known.push(new Option(filters.dataset_id, filters.dataset_id));
  $("listing-dataset").replaceChildren(new Option("all", ""), ...known);
  $("listing-dataset").value = filters.dataset_id ?? "";
}

function filtered() {
  const query = new URLSearchParams([["state", $("listing-state").value], ["dataset_id", $("listing-dataset").value]].filter(([, value]) => value));
  location.hash = [kind, query.toString()].filter(Boolean).join("&");
}

async function load(first = false) {
  const mine = ++request;
  $("listing-note").textContent = first ? "Loading…" : $("listing-note").textContent;
  $("listing-more").disabled = true;
  const query = new URLSearchParams({ limit: SHOWN, ...filters, ...(cursor ? { cursor } : {}) });
  try {
    const page = await get(`${kind}?${query}`);
    if (mine !== request) return;
    items = [...items, ...page.items];
    cursor = page.next_cursor;
  } catch (error) {
    if (mine !== request) return;
    toast(error.text);
  }
  $("listing-more").disabled = false;
  draw(true);
}

function draw(loaded = false) {
  const { row, title } = KINDS[kind];
  const focused = document.activeElement?.dataset?.key;
  $("listing-table").tBodies[0].replaceChildren(...items.map(row));
  if (focused) $("listing-table").querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
  $("listing-table").hidden = !items.length;
  $("listing-more").hidden = !cursor;
  if (loaded) {
    const none = Object.keys(filters).length ? `No ${title.toLowerCase()} match the filter.` : `No ${title.toLowerCase()} yet.`;
    $("listing-note").textContent = items.length ? `${items.length}${cursor ? " newest" : ""}, newest first` : none;
  }
  updateCompareButton();
}

function updateCompareButton() {
  $("compare").disabled = chosen.size < 2;
  $("compare").textContent = chosen.size ? `Compare ${plural(chosen.size, "run")}` : "Compare";
}

function choice(run) {
  const box = el("input", { type: "checkbox", checked: chosen.has(run.id), ariaLabel: `Compare ${runName(run)}` });
  box.dataset.key = `choose-${run.id}`;
  box.addEventListener("change", () => {
    if (box.checked && chosen.size >= MOST_COMPARED) {
      box.checked = false;
      toast(`At most ${MOST_COMPARED} runs can be compared`);
      return;
    }
    chosen[box.checked ? "add" : "delete"](run.id);
    updateCompareButton();
  });
  return box;
}

const cell = (...content) => el("td", {}, ...content);

function runRow(run) {
  const { value, unit } = misfit(run);
  const method = [METHODS[run.spec.method] ?? run.spec.method, run.spec.mode].filter(Boolean).join(", ");
  return el("tr", {}, cell(choice(run)), cell(open("run", run.id, runName(run))), cell(open("dataset", run.dataset_id, datasetName(run.dataset_id), run.id)),
    cell(badge(run), el("small", {}, timeLeft(run) ? ` ${timeLeft(run)}` : "")), cell(value === DASH ? DASH : `${value} ${unit}`),
    cell([modelOf(run), withEffects(run)].filter(Boolean).join(" ")), cell(method), cell(run.generations.toLocaleString("en")), cell(when(run.created_at)));
}

function diagnosisRow(diagnosis) {
  return el("tr", {}, cell(open("diagnosis", diagnosis.id, diagnosis.name)), cell(open("dataset", diagnosis.dataset_id, datasetName(diagnosis.dataset_id), diagnosis.id)),
    cell(badge(diagnosis), el("small", {}, timeLeft(diagnosis) ? ` ${timeLeft(diagnosis)}` : "")), cell(diagnosis.verdict ?? DASH),
    cell([modelOf(diagnosis), withEffects(diagnosis)].filter(Boolean).join(" ")), cell(when(diagnosis.created_at)));
}

function kindOf(dataset) {
  if (isSeries(dataset)) return `series of rig ${dataset.rig.name}`;
  return isForces(dataset) ? "forces" : "tracked markers";
}

function datasetRow(dataset) {
  const held = dataset.recordings.filter((recording) => recording.held_out).length;
  return el("tr", {}, cell(open("dataset", dataset.id, dataset.name), ...warningBadge(dataset)), cell(kindOf(dataset)),
    cell(String(dataset.recordings.length)), cell(String(held)), cell(size(dataset.size_bytes)), cell(when(dataset.created_at)));
}
