// Tables of all runs, diagnoses and datasets (#runs, #diagnoses, #datasets): sorted, filtered and paged by the server.

import { get, isFinal, part, poll } from "../base/api.js";
import { $, el, plural, toast } from "../base/format.js";
import { runName, stateWord } from "../parts/sidebar.js";
import { COLUMNS } from "./columns.js";
import { edit } from "./edit.js";

const SHOWN = 100;
const IN_GROUP = 50;
const TYPED_MS = 250;
export const MOST_COMPARED = 6;
const STATES = ["QUEUED", "RUNNING", "PAUSED", "SUCCEEDED", "FAILED", "CANCELLED"];
const NEWEST = "created_at";
const FILTERS = { runs: ["q", "state", "dataset_id", "badge"], diagnoses: ["q", "state", "dataset_id", "badge"], datasets: ["q", "kind"] };
const FIELDS = { q: "listing-q", state: "listing-state", dataset_id: "listing-dataset", badge: "listing-badge", kind: "listing-kind" };

let kind = null;
let filters = {};
let sort = NEWEST;
let ascending = false;
let grouped = false;
let groups = []; // {id, name, count, open, items, cursor}; without groups a single one, whose id is null
let more = false; // whether there are more groups than these
let total = null;
let names = new Map(); // of datasets, by id
let complete = false; // whether the datasets of all jobs are among them
let chosen = new Set();
let request = 0;
let typing = null;
let fixing = false;
let loading = true; // the rows of before stay until the first ones have come

const states = () => (kind === "diagnoses" ? STATES.filter((state) => state !== "PAUSED") : STATES);
const title = () => ({ runs: "Runs", diagnoses: "Diagnoses", datasets: "Datasets" })[kind];
const datasetName = (id) => names.get(id) ?? id;
const items = () => groups.flatMap((group) => group.items);

export function setUpListing({ onRun }) {
  for (const name of ["state", "dataset", "badge", "kind", "grouped"]) $(`listing-${name}`).addEventListener("change", () => { location.hash = address(); });
  // Each letter typed is no new entry of the history.
  $("listing-q").addEventListener("input", () => {
    clearTimeout(typing);
    typing = setTimeout(searched, TYPED_MS);
  });
  $("listing-filters").addEventListener("submit", (event) => {
    event.preventDefault();
    searched();
  });
  $("listing-more").addEventListener("click", () => load(groups[0]));
  $("listing-run").addEventListener("click", onRun);
  $("compare").addEventListener("click", () => { location.hash = `compare=${[...chosen].map(part).join(",")}`; });
}

function searched() {
  clearTimeout(typing);
  if (!kind) return;
  history.replaceState(null, "", `#${address()}`);
  show(new URLSearchParams(location.hash.slice(1)));
}

// What stands after # for the filters and the order on the page.
function address(order = { sort, ascending }) {
  const given = FILTERS[kind].map((name) => [name, $(FIELDS[name]).value.trim()]);
  const sorted = order.sort === NEWEST && !order.ascending ? [] : [["sort", order.sort], ["order", order.ascending ? "asc" : "desc"]];
  const query = [...given, ...sorted, ...(kind !== "datasets" && $("listing-grouped").checked ? [["grouped", "1"]] : [])].filter(([, value]) => value);
  return [kind, new URLSearchParams(query).toString()].filter(Boolean).join("&");
}

// Show the table of ``next`` ("runs", "diagnoses", "datasets"), or hide it; ``parameters`` are those of the address.
export async function showListing(next, parameters) {
  clearTimeout(typing);
  const other = kind !== next;
  kind = next;
  request += 1;
  $("listing").hidden = !kind;
  if (!kind) return;
  if (other) {
    [chosen, names, complete] = [new Set(), new Map(), false];
    clear();
  }
  document.title = `${title()} · wingfit`;
  $("listing-title").textContent = title();
  for (const node of document.querySelectorAll("#listing [data-jobs]")) node.hidden = kind === "datasets";
  for (const node of document.querySelectorAll("#listing [data-datasets]")) node.hidden = kind !== "datasets";
  for (const id of ["compare", "listing-run"]) $(id).hidden = kind !== "runs";
  $("listing-import").hidden = kind !== "datasets";
  await show(parameters);
}

async function show(parameters) {
  const mine = ++request;
  const valid = { state: states(), badge: ["good", "doubtful", "wrong"], kind: ["tracks", "forces", "series"] };
  filters = Object.fromEntries(FILTERS[kind].map((name) => [name, parameters.get(name)]).filter(([name, value]) => value && (valid[name] ?? [value]).includes(value)));
  sort = COLUMNS[kind].some((column) => column.sort === parameters.get("sort")) ? parameters.get("sort") : NEWEST;
  ascending = parameters.has("order") ? parameters.get("order") === "asc" : sort !== NEWEST;
  grouped = kind !== "datasets" && parameters.has("grouped");
  [groups, more, total] = [grouped ? [] : [group(null, "")], false, null];
  $("listing-grouped").checked = grouped;
  $("listing-note").textContent = "Loading…";
  fillFilters();
  loading = true;
  drawHead();
  if (grouped) await loadGroups(mine);
  else await Promise.all([load(groups[0], mine), kind === "datasets" ? null : count(mine)]);
  if (mine !== request || kind === "datasets") return;
  if (!complete) await loadNames(mine);
  else fillFilters();
}

const group = (id, name, jobs = null) => ({ id, name, count: jobs, open: id === null, items: [], cursor: null, loaded: false });

const query = (values) => new URLSearchParams(Object.entries(values).filter(([, value]) => value !== null && value !== undefined)).toString();

// The datasets among which can be chosen; their jobs are counted without the filters.
async function loadNames(mine) {
  const page = await get(`${kind}/groups`).catch(() => null); // the filter then lists ids; loading the table reports the error
  if (mine !== request || !page) return;
  for (const one of page.items) names.set(one.dataset_id, one.dataset_name);
  complete = true;
  fillFilters();
}

function learn(page) {
  for (const one of page.items) names.set(one.dataset_id, one.dataset_name);
  complete ||= !Object.keys(filters).length;
  total = page.next_cursor ? null : page.items.reduce((sum, one) => sum + one.count, 0);
}

async function count(mine) {
  const page = await get(`${kind}/groups?${query(filters)}`).catch(() => null);
  if (mine !== request || !page) return;
  learn(page);
  draw();
}

async function loadGroups(mine) {
  try {
    const page = await get(`${kind}/groups?${query(filters)}`);
    if (mine !== request) return;
    learn(page);
    groups = page.items.map((one) => group(one.dataset_id, one.dataset_name, one.count));
    more = page.next_cursor !== null;
  } catch (error) {
    if (mine === request) toast(error.text);
    return;
  }
  if (groups.length) {
    groups[0].open = true;
    await load(groups[0], mine);
  } else {
    loading = false;
    draw();
  }
}

function fillFilters() {
  const known = [...names].map(([id, name]) => new Option(name, id));
  if (filters.dataset_id && !names.has(filters.dataset_id)) known.push(new Option(filters.dataset_id, filters.dataset_id));
  $("listing-state").replaceChildren(new Option("all", ""), ...states().map((state) => new Option(stateWord(state), state)));
  $("listing-dataset").replaceChildren(new Option("all", ""), ...known);
  for (const name of FILTERS[kind]) {
    if (name !== "q" || document.activeElement !== $("listing-q")) $(FIELDS[name]).value = filters[name] ?? "";
  }
}

async function load(of, mine = ++request) {
  $("listing-more").disabled = true;
  const order = sort === NEWEST && !ascending ? {} : { sort, order: ascending ? "asc" : "desc" };
  const within = of.id === null ? {} : { dataset_id: of.id };
  try {
    const page = await get(`${kind}?${query({ limit: of.id === null ? SHOWN : IN_GROUP, ...filters, ...within, ...order, cursor: of.cursor })}`);
    if (mine !== request) return;
    of.items = [...of.items, ...page.items];
    of.cursor = page.next_cursor;
    of.loaded = true;
    loading = false;
  } catch (error) {
    if (mine !== request) return;
    toast(error.text);
  }
  $("listing-more").disabled = false;
  draw();
}

// Take over the changes of jobs that were active; ``active`` are those that still are, of all kinds.
export async function refreshListing(active) {
  if (!kind || kind === "datasets" || fixing) return;
  const known = new Map((active[kind] ?? []).map((item) => [item.id, item]));
  const gone = items().filter((item) => !isFinal(item) && !known.has(item.id)).slice(0, SHOWN);
  const mine = kind;
  fixing = true;
  try {
    for (const job of await Promise.all(gone.map((item) => poll(`${mine}/${part(item.id)}`).catch(() => null)))) if (job) known.set(job.id, job);
  } finally {
    fixing = false;
  }
  if (kind !== mine || !items().some((item) => known.has(item.id) && JSON.stringify(known.get(item.id)) !== JSON.stringify(item))) return;
  for (const one of groups) one.items = one.items.map((item) => known.get(item.id) ?? item);
  draw();
}

function drawHead() {
  const focused = document.activeElement?.dataset?.key;
  const heads = COLUMNS[kind].map((column) => {
    const mine = column.sort === sort;
    const button = el("button", { type: "button", onclick: () => { location.hash = address({ sort: column.sort, ascending: mine ? !ascending : column.sort !== NEWEST }); } }, column.head);
    button.dataset.key = `sort-${column.sort}`;
    const head = el("th", { scope: "col", className: column.number ? "n" : "" }, button);
    if (mine) head.ariaSort = ascending ? "ascending" : "descending";
    return head;
  });
  const hidden = (text) => el("th", { scope: "col" }, el("span", { className: "hidden" }, text));
  $("listing-table").tHead.replaceChildren(el("tr", {}, ...(kind === "runs" ? [hidden("Compare")] : []), ...heads, hidden("Edit")));
  if (focused?.startsWith("sort-")) $("listing-table").querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
}

function clear() {
  for (const body of [...$("listing-table").tBodies]) body.remove();
}

function draw() {
  if (loading) return;
  const table = $("listing-table");
  const focused = document.activeElement?.dataset?.key;
  clear();
  table.append(...groups.map((one) => el("tbody", {}, ...(one.id === null ? [] : [groupRow(one)]), ...(one.open ? one.items.map(row) : []), ...(one.id !== null && one.open && one.cursor ? [moreRow(one)] : []))));
  if (!table.tBodies.length) table.append(el("tbody"));
  if (focused) table.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
  const shown = items().length;
  table.hidden = !shown && !groups.some((one) => one.id !== null);
  $("listing-more").hidden = grouped || !groups[0]?.cursor;
  note(shown);
  updateCompareButton();
}

function note(shown) {
  const what = title().toLowerCase();
  const many = (count) => count.toLocaleString("en");
  const order = sort === NEWEST ? (ascending ? "oldest first" : "newest first") : `by ${COLUMNS[kind].find((one) => one.sort === sort).head.toLowerCase()}`;
  const all = total === null ? "" : ` of ${many(total)}`;
  if (grouped && groups.length) $("listing-note").textContent = `${total === null ? "" : `${many(total)} ${what} of `}${plural(groups.length, "dataset")}${more ? ", more than these" : ""}; in each, ${order}`;
  else if (shown) $("listing-note").textContent = `${many(shown)}${groups[0].cursor ? all || " of more" : ""}, ${order}`;
  else $("listing-note").textContent = Object.keys(filters).length ? `No ${what} match the filter.` : `No ${what} yet.`;
}

const width = () => COLUMNS[kind].length + (kind === "runs" ? 2 : 1);

function groupRow(one) {
  const button = el("button", { type: "button", onclick: async () => {
    one.open = !one.open;
    draw();
    if (one.open && !one.loaded) await load(one);
  } }, one.name);
  button.dataset.key = `group-${one.id}`;
  button.ariaExpanded = String(one.open);
  return el("tr", { className: "group" }, el("th", { scope: "rowgroup", colSpan: width() }, button, el("small", {}, ` ${plural(one.count, kind === "runs" ? "run" : "job")}`)));
}

function moreRow(one) {
  const button = el("button", { type: "button", onclick: () => load(one) }, "Show more");
  button.dataset.key = `more-${one.id}`;
  return el("tr", { className: "more" }, el("td", { colSpan: width() }, button));
}

function row(item) {
  const cells = COLUMNS[kind].map((column) => {
    const content = column.cell(item, datasetName);
    return el("td", { className: [column.number ? "n" : "", column.wraps ? "wraps" : ""].join(" ").trim() }, ...(Array.isArray(content) ? content : [content]));
  });
  const button = el("button", { type: "button", ariaLabel: `Edit name and notes of ${item.name}`, onclick: () => change(item) }, "Edit");
  button.dataset.key = `edit-${item.id}`;
  return el("tr", {}, ...(kind === "runs" ? [el("td", {}, choice(item))] : []), ...cells, el("td", {}, button));
}

async function change(item) {
  const changed = await edit(kind, item);
  if (!changed) return;
  for (const one of groups) one.items = one.items.map((other) => (other.id === changed.id ? changed : other));
  draw();
  $("listing-table").querySelector(`[data-key="${CSS.escape(`edit-${changed.id}`)}"]`)?.focus();
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
