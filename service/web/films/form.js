// The form that starts a tracking of a film.

import { get, postJson } from "../base/api.js";
import { showErrors } from "../base/form_errors.js";
import { $ } from "../base/format.js";
import { randomKey } from "../pages/submit.js";
import { allLabels, labelFault, showWing } from "./labels.js";

const NUMBERS = ["clocks_within_ms", "first_frame", "last_frame"];
const MOST_WINGS = 200;

let film = null;
let hooks = {};
let sent = null;

export function setUpForm(given) {
  hooks = given;
  const form = $("track-form");
  form.kind.addEventListener("change", hooks.onKind);
  form.light.addEventListener("change", showFields);
  form.dataset_id.addEventListener("change", wingChosen);
  form.addEventListener("submit", submit);
}

// Show the form for ``next``; a new film resets it.
export async function showForm(next) {
  const fresh = film?.id !== next.id;
  film = next;
  if (!fresh) return;
  const form = $("track-form");
  form.reset();
  showErrors(form, $("track-errors"), null);
  showFields();
  form.dataset_id.replaceChildren(new Option("none", ""));
  wingChosen();
  hooks.onKind();
  const { items } = await get(`datasets?limit=${MOST_WINGS}`);
  if (film.id === next.id) form.dataset_id.append(...items.filter((one) => one.kind === "tracks").map((one) => new Option(`${one.name} (${one.markers} markers)`, one.id)));
}

// A strobe shows the clocks by its flashes.
function showFields() {
  const form = $("track-form");
  $("track-clocks").hidden = form.light.value === "strobe";
}

function wingChosen() {
  const { value } = $("track-form").dataset_id;
  $("track-wing-note").textContent = value ? "The markers are identified by their places on this wing, and get their names."
    : "Without a wing the markers get the names t01, t02, …; a marker that is ambiguous at every instant is left out.";
  showWing(value);
}

// Text that is no number is sent as it is: the server says what is wrong with it.
const number = (text) => (Number.isFinite(Number(text)) ? Number(text) : text);

function body(form) {
  const value = { film_id: film.id, kind: form.kind.value, light: form.light.value };
  for (const name of NUMBERS) {
    const text = form.elements.namedItem(name).value.trim();
    if (text && !(name === "clocks_within_ms" && form.light.value === "strobe")) value[name] = number(text);
  }
  if (form.dataset_id.value) value.dataset_id = form.dataset_id.value;
  const title = form.elements.namedItem("name").value.trim(); // form.name is the name of the form itself
  if (title) value.name = title;
  const labels = allLabels();
  if (labels) value.labels = labels;
  return value;
}

async function submit(event) {
  event.preventDefault();
  const form = $("track-form");
  const button = form.querySelector("[type=submit]");
  if (button.disabled) return;
  const fault = labelFault();
  showErrors(form, $("track-errors"), fault ? { message: fault } : null);
  if (fault) return;
  const value = body(form);
  // The same input sent twice is one tracking: the key changes only with the input.
  const text = JSON.stringify(value);
  if (sent?.text !== text) sent = { text, key: randomKey() };
  button.disabled = true;
  try {
    const tracking = await postJson("trackings", value, { "Idempotency-Key": sent.key });
    sent = null;
    location.hash = `tracking=${encodeURIComponent(tracking.id)}`;
  } catch (error) {
    showErrors(form, $("track-errors"), error);
  } finally {
    button.disabled = false;
  }
}
