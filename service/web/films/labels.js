// Markers of one instant that are labelled by hand, in the pictures of the cameras.

import { getText, part } from "../base/api.js";
import { $, el, plural } from "../base/format.js";

const LEAST_MARKERS = 6;
const LEAST_CAMERAS = 2;

let film = null;
let labels = []; // {camera, frame, marker, x_px, y_px}
let before = []; // earlier states, for undo
let names = []; // of the wing's markers, if they are known
let hooks = {};

export function setUpLabels(given) {
  hooks = given;
  $("label-on").addEventListener("change", () => hooks.onChange());
  $("label-marker").addEventListener("input", () => choose($("label-marker").value));
  $("label-next").addEventListener("click", nextMarker);
  $("label-undo").addEventListener("click", undo);
  $("label-clear").addEventListener("click", () => put([]));
  $("label-part").addEventListener("toggle", () => {
    $("label-on").checked = $("label-part").open;
    hooks.onChange();
  });
}

export const isLabelling = () => $("label-on").checked && $("label-part").open;

export function undo() {
  if (before.length) {
    labels = before.pop();
    changed();
  }
  return true;
}

export function nextMarker() {
  choose(following());
  return true;
}

// What a click in the picture of ``camera`` does.
export function hintFor(camera) {
  const marker = chosen();
  if (!marker) return "Choose a marker to label.";
  return seenBy(marker).includes(camera) ? `${marker} is labelled here.` : `Click marker ${marker}.`;
}

export const labelsAt = (camera, frame) => labels.filter((one) => one.camera === camera && one.frame === frame);

// The labels of a request; null if there are none.
export const allLabels = () => (labels.length ? labels : null);

// Labels belong to a film; they outlive a reload of the page in the same tab.
export function showLabels(next) {
  if (film?.id === next.id) {
    film = next;
    return;
  }
  film = next;
  before = [];
  try {
    labels = JSON.parse(sessionStorage.getItem(`labels ${film.id}`)) ?? [];
  } catch { /* no storage: labels last as long as the page */
    labels = [];
  }
  $("label-part").open = labels.length > 0;
  $("label-marker").value = "";
  choose(following());
  hooks.onChange();
}

// The wing was chosen: its drawing has the names and places of its markers.
export async function showWing(id) {
  names = [];
  $("label-drawing").replaceChildren();
  $("label-drawing").hidden = true;
  if (id) {
    try {
      const text = await getText(`datasets/${part(id)}/drawing`);
      const drawing = document.importNode(new DOMParser().parseFromString(text, "image/svg+xml").documentElement, true);
      $("label-drawing").replaceChildren(drawing);
      const marks = [...drawing.querySelectorAll("text.marker")];
      names = marks.map((node) => node.textContent);
      for (const node of marks) node.addEventListener("click", () => choose(node.textContent));
      $("label-drawing").hidden = !names.length;
    } catch { /* without a drawing the names are typed */ }
  }
  $("label-names").replaceChildren(...names.map((text) => new Option(text, text)));
  $("label-marker").value = "";
  choose(following());
}

const cameras = () => film.cameras.map((one) => one.name);
const seenBy = (marker) => cameras().filter((camera) => labels.some((one) => one.camera === camera && one.marker === marker));
const chosen = () => $("label-marker").value.trim();

// The marker after the chosen one that is still missing in a camera; a first one if none is chosen.
function following() {
  const listed = names.length ? names : numbered();
  const from = listed.indexOf(chosen()) + 1;
  const order = [...listed.slice(from), ...listed.slice(0, from)];
  return order.find((marker) => seenBy(marker).length < cameras().length && marker !== chosen()) ?? chosen();
}

// Without a wing, markers are numbered.
function numbered() {
  const used = new Set(labels.map((one) => one.marker));
  return Array.from({ length: used.size + 2 }, (_, k) => `m${String(k + 1).padStart(2, "0")}`);
}

function choose(marker) {
  $("label-marker").value = marker;
  draw();
  hooks.onChange();
}

// Name the detection {x_px, y_px} in a frame of a camera by the chosen marker.
export function label(camera, frame, { x_px, y_px }) {
  const marker = chosen();
  const other = labels.find((one) => one.camera === camera && one.frame !== frame);
  if (!marker) return say("Choose a marker first.");
  if (names.length && !names.includes(marker)) return say(`The wing has no marker ${marker}; choose one of its drawing.`);
  if (other) {
    return say(`The labels of camera ${camera} are in frame ${other.frame}; labels are of one instant. `,
      el("button", { type: "button", onclick: () => hooks.onGo(camera, other.frame) }, `Go to frame ${other.frame}`));
  }
  const same = (one) => one.camera === camera && (one.marker === marker || (one.x_px === x_px && one.y_px === y_px));
  put([...labels.filter((one) => !same(one)), { camera, frame, marker, x_px, y_px }]);
  if (seenBy(marker).length === cameras().length) choose(following());
}

function put(next) {
  before.push(labels);
  labels = next;
  changed();
}

function changed() {
  try {
    sessionStorage.setItem(`labels ${film.id}`, JSON.stringify(labels));
  } catch { /* as above */ }
  draw();
  hooks.onChange();
}

const say = (...content) => $("label-state").replaceChildren(...content);

function draw() {
  const markers = [...new Set(labels.map((one) => one.marker))].sort();
  const whole = markers.filter((marker) => seenBy(marker).length >= LEAST_CAMERAS);
  const enough = whole.length >= LEAST_MARKERS;
  $("label-summary").textContent = labels.length ? `Labels by hand: ${plural(markers.length, "marker")}` : "Label markers by hand (optional)";
  const absent = chosen() ? cameras().filter((camera) => !seenBy(chosen()).includes(camera)) : [];
  const next = absent.length ? `Next: ${chosen()} in camera ${absent.join(" or ")}. ` : "";
  say(`${next}${plural(whole.length, "marker")} labelled in ${LEAST_CAMERAS} cameras or more; ${enough ? "that is enough." : `at least ${LEAST_MARKERS} are needed.`}`);
  $("label-undo").disabled = !before.length;
  $("label-clear").disabled = !labels.length;
  for (const node of $("label-drawing").querySelectorAll("text.marker")) node.classList.toggle("chosen", node.textContent === chosen());
  $("label-table").hidden = !labels.length;
  $("label-table").tHead.replaceChildren(el("tr", {}, ...["Marker", ...cameras().map((one) => `${one}, px`), ""].map((head) =>
    el("th", { scope: "col" }, head || el("span", { className: "hidden" }, "Remove")))));
  $("label-table").tBodies[0].replaceChildren(...markers.map((marker) => el("tr", {}, el("td", {}, marker),
    ...cameras().map((camera) => {
      const found = labels.find((one) => one.camera === camera && one.marker === marker);
      return el("td", {}, found ? `${found.x_px.toFixed(1)}, ${found.y_px.toFixed(1)}` : "");
    }),
    el("td", {}, el("button", { type: "button", ariaLabel: `Remove ${marker}`, onclick: () => put(labels.filter((one) => one.marker !== marker)) }, "Remove")))));
}

// Why the labels would be refused; null if they serve, or if there are none.
export function labelFault() {
  const markers = [...new Set(labels.map((one) => one.marker))];
  if (!labels.length || markers.filter((marker) => seenBy(marker).length >= LEAST_CAMERAS).length >= LEAST_MARKERS) return null;
  return `At least ${LEAST_MARKERS} markers labelled in ${LEAST_CAMERAS} cameras are needed; label more, or remove all labels.`;
}
