// Any frame of each camera side by side, with what the detector finds there.

import { call, get, part } from "../base/api.js";
import { $, el, plural } from "../base/format.js";
import { hintFor, isLabelling, label, labelsAt, nextMarker, undo } from "./labels.js";
import { cameraView, circle, cross, gainOf, latest, LOOK, name } from "./view.js";

const SNAP_PX = 18; // on the screen, from a click to a detection
const LIT = 40; // of 255: a frame of a strobe film with brighter pixels shows a flash
const SMALL_PX = 160; // width of the pictures in which a flash is sought
const MOST_DARK = 500; // frames between flashes
const SLOW_MS = 400;
const SETTLED_MS = 200;
const KEPT = 60; // detections of frames that are remembered
const DIRECTIONS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

let film = null;
let views = []; // of each camera: camera, view, frame, markers (null: not known), cursor
let detected = new Map(); // by camera, frame and kind: the markers

export function setUpLook() {
  $("look-detections").addEventListener("change", () => views.forEach((one) => one.load()));
  $("track-form").light.addEventListener("change", () => views.forEach(({ flash }) => { flash.hidden = $("track-form").light.value !== "strobe"; }));
  $("look-gain").addEventListener("input", () => views.forEach(({ view }) => view.setGain(gainOf($("look-gain")))));
}

// Another kind of markers was chosen.
export const detectAgain = () => views.forEach((one) => one.load());

// Show the cameras of ``next``, a film with all its videos; null hides them. The same film keeps its views.
export function showLook(next) {
  const key = (one) => (one ? JSON.stringify([one.id, one.cameras]) : "");
  const same = key(film) === key(next);
  film = next;
  if (same) return;
  for (const { view } of views) view.close();
  detected = new Map();
  views = film ? film.cameras.map(panel) : [];
  $("look-views").replaceChildren(...views.map((one) => one.node));
  for (const one of views) one.load();
}

export const drawLook = () => views.forEach(({ view }) => view.draw());

// Go to ``frame`` of the camera called ``camera``.
export const goTo = (camera, frame) => views.find((one) => one.camera.name === camera)?.go(frame, false);

function panel(camera) {
  const last = Math.max((camera.frames ?? 1) - 1, 0);
  const range = el("input", { type: "range", min: 0, max: last, step: 1, value: 0, ariaLabel: `Frame of camera ${camera.name}` });
  const number = el("input", { type: "text", inputMode: "numeric", value: "0", autocomplete: "off", ariaLabel: `Number of the frame of camera ${camera.name}` });
  const note = el("p", { className: "quiet note", role: "status" });
  const one = { camera, frame: 0, markers: null, cursor: null, note, hint: el("p", { className: "hint" }) };
  one.view = cameraView(camera, {
    paint: (pen, at, size) => paint(one, pen, at, size),
    onPick: (pixel, size) => pick(one, pixel, size),
    onKey: (event) => key(one, event),
    onCloser: () => one.fetch(),
  });
  const picture = latest(() => fetchPicture(one));
  const detection = latest(() => detect(one));
  let settled = null;
  one.fetch = () => {
    picture();
    clearTimeout(settled);
    settled = setTimeout(detection, SETTLED_MS); // detecting takes long: not while a slider moves
  };
  one.load = () => {
    one.markers = null;
    one.cursor = null;
    if (!$("look-detections").checked) one.note.textContent = "";
    one.view.draw();
    one.fetch();
  };
  one.go = (wanted, together = $("look-together").checked) => {
    const frame = Math.min(Math.max(Math.round(wanted) || 0, 0), last);
    const by = frame - one.frame;
    one.frame = frame;
    range.value = frame;
    number.value = String(frame);
    if (by) one.load();
    if (together && by) for (const other of views) if (other !== one) other.go(other.frame + by, false);
  };
  range.addEventListener("input", () => one.go(Number(range.value)));
  number.addEventListener("change", () => one.go(Number(number.value)));
  one.flash = el("button", { type: "button", ariaLabel: `Next flash, camera ${camera.name}`, onclick: () => nextFlash(one, last) }, "Next flash");
  one.flash.hidden = $("track-form").light.value !== "strobe";
  const facts = [`${camera.width_px} × ${camera.height_px}`, plural(last + 1, "frame"), camera.rate_hz ? `${Number(camera.rate_hz.toPrecision(6))} per second` : null];
  one.node = el("div", { className: "film-view" },
    el("h4", {}, camera.name, " ", el("small", {}, facts.filter(Boolean).join(", "))), one.view.canvas,
    el("div", { className: "controls" }, el("label", { className: "phase" }, "Frame ", range), number, one.flash, one.view.buttons), one.hint, note);
  one.view.setGain(gainOf($("look-gain")));
  return one;
}

// Fetch the picture of the present frame, if one with as many pixels is not there yet.
async function fetchPicture(one) {
  if (!views.includes(one)) return; // the page was left
  const { frame } = one;
  const width = one.view.pictureWidth();
  if (one.shown?.frame === frame && one.shown.width >= width) return;
  const slow = setTimeout(() => { one.note.textContent = `Loading frame ${frame}…`; }, SLOW_MS); // videos are decoded from their start
  try {
    const picture = await createImageBitmap(await call("GET", `${pathOf(one)}?width_px=${width}`, { as: "blob" }));
    one.shown = { frame, width };
    one.view.show(picture);
  } catch (error) {
    if (one.frame === frame) one.note.textContent = error.message;
  } finally {
    clearTimeout(slow);
  }
}

async function detect(one) {
  if (!views.includes(one) || !$("look-detections").checked || one.markers) return;
  const { frame } = one;
  const kind = kindOf();
  const key = `${pathOf(one)}/markers?kind=${kind}`;
  let markers = detected.get(key);
  if (!markers) {
    one.note.textContent = "Detecting…";
    try {
      ({ markers } = await get(key));
    } catch (error) {
      if (one.frame === frame) one.note.textContent = error.message;
      return;
    }
    detected.set(key, markers);
    if (detected.size > KEPT) detected.delete(detected.keys().next().value);
  }
  if (one.frame !== frame || kindOf() !== kind) return;
  one.markers = markers;
  const found = plural(one.markers.length, kind === "dot" ? "dot" : "chequer");
  one.note.textContent = `${found} found in frame ${frame}`;
  one.view.canvas.ariaLabel = `Camera ${one.camera.name}, frame ${frame}, ${found}`;
  one.view.draw();
}

// Go to the next frame with light: in a strobe film most are dark.
async function nextFlash(one, last) {
  const { frame: from } = one;
  one.flash.disabled = true;
  try {
    const end = Math.min(last, from + MOST_DARK);
    for (let frame = from + 1; frame <= end && one.frame === from && one.node.isConnected; frame += 1) {
      one.note.textContent = `Looking at frame ${frame}…`;
      if ((await brightest(pathOf({ ...one, frame }))) > LIT) return one.go(frame);
    }
    if (one.frame === from) one.note.textContent = `No light in frames ${from + 1} to ${end}.`;
  } catch (error) {
    one.note.textContent = error.message;
  } finally {
    one.flash.disabled = false;
  }
}

async function brightest(path) {
  const picture = await createImageBitmap(await call("GET", `${path}?width_px=${SMALL_PX}`, { as: "blob" }));
  const pen = new OffscreenCanvas(picture.width, picture.height).getContext("2d");
  pen.drawImage(picture, 0, 0);
  const { data } = pen.getImageData(0, 0, picture.width, picture.height);
  picture.close();
  return data.reduce((most, value, k) => (k % 4 === 0 && value > most ? value : most), 0);
}

const kindOf = () => $("track-form").kind.value;

const pathOf = ({ camera, frame }) => `films/${part(film.id)}/frames/${part(camera.name)}/${frame}`;

function paint(one, pen, at, size) {
  const reach = Math.min(6, Math.max(3, 6 * size)); // small crosses leave small markers visible
  one.view?.canvas.classList.toggle("labels", isLabelling());
  one.hint.textContent = isLabelling() ? hintFor(one.camera.name) : "";
  if ($("look-detections").checked) for (const { x_px: x, y_px: y } of one.markers ?? []) cross(pen, at(x, y), reach, LOOK.found);
  for (const { x_px: x, y_px: y, marker } of labelsAt(one.camera.name, one.frame)) {
    circle(pen, at(x, y), 8, LOOK.label, 2);
    name(pen, at(x, y), marker, LOOK.label);
  }
  if (one.cursor !== null && one.markers?.[one.cursor]) {
    const { x_px: x, y_px: y } = one.markers[one.cursor];
    circle(pen, at(x, y), 11, LOOK.cursor, 2);
  }
}

const apart = (marker, [x, y]) => Math.hypot(marker.x_px - x, marker.y_px - y);

function pick(one, pixel, size) {
  if (!isLabelling()) return;
  if (!one.markers?.length) {
    one.note.textContent = "No detection to label in this frame; show detections, or choose another frame.";
    return;
  }
  const nearest = one.markers.reduce((best, marker) => (apart(marker, pixel) < apart(best, pixel) ? marker : best));
  if (apart(nearest, pixel) * size > SNAP_PX) one.note.textContent = "No detection near the click; enlarge the picture, or choose another frame.";
  else label(one.camera.name, one.frame, nearest);
}

// With labels on, the arrow keys go to the next detection in their direction, and Enter labels it.
function key(one, event) {
  if (!isLabelling() || !one.markers?.length) return false;
  if (event.key.toLowerCase() === "u") return undo();
  if (event.key.toLowerCase() === "n") return nextMarker();
  if (event.key === "Enter") {
    if (one.cursor !== null) label(one.camera.name, one.frame, one.markers[one.cursor]);
    return true;
  }
  const direction = DIRECTIONS[event.key];
  if (!direction || event.shiftKey) return false;
  one.cursor = one.cursor === null ? 0 : nextIn(one.markers, one.cursor, direction);
  const { x_px: x, y_px: y } = one.markers[one.cursor];
  one.note.textContent = `Detection at ${x.toFixed(0)}, ${y.toFixed(0)}`;
  one.view.reveal([x, y]);
  return true;
}

// The marker in ``direction`` from the present one that is nearest, the way across counted twice.
function nextIn(markers, present, [dx, dy]) {
  const { x_px: x, y_px: y } = markers[present];
  let [best, least] = [present, Infinity];
  markers.forEach((marker, k) => {
    const [right, down] = [marker.x_px - x, marker.y_px - y];
    const along = right * dx + down * dy;
    const across = Math.abs(right * dy - down * dx);
    if (along > 0.5 && along + 2 * across < least) [best, least] = [k, along + 2 * across];
  });
  return best;
}
