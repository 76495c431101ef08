// All films and trackings, and the form of a new film.

import { get, isFinal, part, postJson } from "../base/api.js";
import { showErrors } from "../base/form_errors.js";
import { $, el, size, toast, when } from "../base/format.js";
import { badge, timeLeft } from "../parts/sidebar.js";
import { randomKey, remove } from "../pages/submit.js";

const SHOWN = 50;
const POLL_MS = 2500;
const NAME = /^\s*(?:-\s*)?name\s*[:=]\s*["']?([A-Za-z0-9_-]{1,40})["']?\s*$/; // of a camera, a line of cameras.yaml

const KINDS = {
  films: { what: "film", row: filmRow, none: "No films yet." },
  trackings: { what: "tracking", row: trackingRow, none: "No trackings yet." },
};

let lists = { films: [], trackings: [] };
let cursors = { films: null, trackings: null };
let shown = false;
let timer = null;
let calibration = null; // a cameras.yaml whose names were read: the first file of the new film
let hooks = {};

export function setUpList(given) {
  hooks = given;
  $("films-form").addEventListener("submit", create);
  for (const kind of Object.keys(KINDS)) $(`${kind}-more`).addEventListener("click", () => more(kind));
  $("films-from-yaml").addEventListener("click", () => $("films-yaml").click());
  $("films-yaml").addEventListener("change", readNames);
}

export async function showList(next) {
  shown = next;
  clearTimeout(timer);
  $("films-list").hidden = !shown;
  if (!shown) return;
  document.title = "From films to tracks · wingfit";
  await load();
}

async function load() {
  clearTimeout(timer);
  try {
    for (const kind of Object.keys(KINDS)) if (!document.hidden) await page(kind);
    $("films-problem").hidden = true;
  } catch (error) {
    $("films-problem").textContent = error.message;
    $("films-problem").hidden = false;
  }
  clearTimeout(timer);
  if (shown) timer = setTimeout(load, POLL_MS);
}

// The newest items; those that "Show more" added stay.
async function page(kind) {
  const { items, next_cursor: cursor } = await get(`${kind}?limit=${SHOWN}`);
  const known = new Set(items.map((one) => one.id));
  const older = lists[kind].length > SHOWN ? lists[kind].slice(SHOWN).filter((one) => !known.has(one.id)) : [];
  lists[kind] = [...items, ...older];
  if (!older.length) cursors[kind] = cursor;
  draw(kind);
}

async function more(kind) {
  try {
    const { items, next_cursor: cursor } = await get(`${kind}?limit=${SHOWN}&cursor=${part(cursors[kind])}`);
    lists[kind].push(...items);
    cursors[kind] = cursor;
    draw(kind);
  } catch (error) {
    toast(error.message);
  }
}

function draw(kind) {
  const { row, none } = KINDS[kind];
  const table = $(`${kind}-table`);
  const rows = el("tbody", {}, ...lists[kind].map(row));
  if (table.dataset.shown !== rows.innerHTML) {
    const focused = table.contains(document.activeElement) ? document.activeElement.dataset.key : null;
    table.dataset.shown = rows.innerHTML;
    table.tBodies[0].replaceWith(rows);
    if (focused) table.querySelector(`[data-key="${CSS.escape(focused)}"]`)?.focus();
  }
  table.hidden = !lists[kind].length;
  $(`${kind}-none`).textContent = lists[kind].length ? "" : none;
  $(`${kind}-more`).hidden = !cursors[kind];
}

function keyed(node, key) {
  node.dataset.key = key;
  return node;
}

const link = (page, { id, name }, row = id) => keyed(el("a", { href: `#${page}=${part(id)}` }, name), `${page}-${row}`);

const deletion = (kind, one) => keyed(el("button", { type: "button", ariaLabel: `Delete ${one.name}`, onclick: async () => (await remove(kind, one.id, one.name)) && load() }, "Delete"), `delete-${one.id}`);

// Files that were never uploaded, or that are gone from the disk of the server.
function missingFiles({ calibration, cameras, missing }) {
  return [calibration && !missing.includes("cameras") ? null : "cameras.yaml", ...cameras.map((one) => (one.bytes === null || missing.includes(one.name) ? one.name : null))].filter(Boolean);
}

function filmRow(film) {
  const missing = missingFiles(film);
  return el("tr", {}, el("td", {}, link("film", film)), el("td", {}, film.cameras.map((one) => one.name).join(", ")),
    el("td", {}, film.ready ? el("span", { className: "badge good" }, "ready") : `missing: ${missing.join(", ")}`), el("td", { className: "n" }, size(film.size_bytes)),
    el("td", {}, when(film.created_at)), el("td", {}, deletion("films", film)));
}

function trackingRow(tracking) {
  const film = lists.films.find((one) => one.id === tracking.film_id);
  return el("tr", {}, el("td", {}, link("tracking", tracking)), el("td", {}, film ? link("film", film, tracking.id) : tracking.film_id),
    el("td", {}, badge(tracking), el("small", {}, timeLeft(tracking) ? ` ${timeLeft(tracking)}` : "")), el("td", {}, when(tracking.created_at)),
    el("td", {}, isFinal(tracking) ? deletion("trackings", tracking) : ""));
}

// The names of the cameras stand in lines of cameras.yaml; the server reads the file itself when it is sent.
async function readNames() {
  const [file] = $("films-yaml").files;
  $("films-yaml").value = "";
  if (!file) return;
  const names = (await file.text()).split("\n").map((line) => line.match(NAME)?.[1]).filter(Boolean);
  const state = $("films-yaml-state");
  if (!names.length) {
    state.textContent = `${file.name} has no names of cameras; write it with wingfit cameras, or convert it with wingfit cameras convert.`;
    return;
  }
  calibration = file;
  $("films-form").elements.namedItem("cameras").value = names.join(", ");
  $("films-form").elements.namedItem("name").focus();
  state.textContent = `${file.name} is sent when the film is created. Remove the names of cameras that did not film.`;
}

const words = (text) => text.split(/[\s,;]+/).filter(Boolean);

async function create(event) {
  event.preventDefault();
  const form = $("films-form");
  const field = (name) => form.elements.namedItem(name).value.trim();
  const cameras = words(field("cameras"));
  const rates = words(field("rate_hz")).map((text) => (Number.isFinite(Number(text)) ? Number(text) : text));
  showErrors(form, $("films-errors"), null);
  if (rates.length > 1 && rates.length !== cameras.length) {
    const message = `has ${rates.length} rates for ${cameras.length} cameras; state one for all, or one for each`;
    showErrors(form, $("films-errors"), { message: "The film was not created.", errors: [{ where: "body.rate_hz", message, value: null }] });
    return;
  }
  const body = { name: field("name"), cameras };
  if (rates.length) body.rate_hz = Object.fromEntries(cameras.map((name, k) => [name, rates[rates.length > 1 ? k : 0]]));
  const button = form.querySelector("[type=submit]");
  button.disabled = true;
  try {
    const film = await postJson("films", body, { "Idempotency-Key": randomKey() });
    form.reset();
    $("films-yaml-state").textContent = "";
    hooks.onCreated(film, calibration);
    calibration = null;
  } catch (error) {
    showErrors(form, $("films-errors"), error);
  } finally {
    button.disabled = false;
  }
}
