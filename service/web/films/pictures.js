// Pictures of some instants with the markers as the cameras saw them, and the projections of their places.

import { call, part } from "../base/api.js";
import { $, el, fixed, plural, rounded } from "../base/format.js";
import { cameraView, circle, cross, gainOf, latest, LOOK, name } from "./view.js";

const ROOMY = "(min-width: 40rem)"; // narrower pictures have no room for names
const WRONG_PX = 3; // seen and projected pixels that differ by more are drawn with a line between them

let film = null;
let strobe = false;
let instants = [];
let panels = []; // of each camera

export function setUpPictures() {
  $("seen-instant").addEventListener("change", choose);
  $("seen-names").addEventListener("change", () => panels.forEach((one) => one.view.draw()));
  $("seen-gain").addEventListener("input", () => panels.forEach((one) => one.view.setGain(gainOf($("seen-gain")))));
}

export function hidePictures() {
  for (const one of panels) one.view.close();
  [film, instants, panels] = [null, [], []];
  $("seen-views").replaceChildren();
}

// ``recorded`` is the film; null if it was deleted, and the pictures stay black. ``flashed``: in the light of a strobe.
export function showPictures(recorded, given, flashed) {
  hidePictures();
  [film, instants, strobe] = [recorded, given, flashed];
  $("seen-instant").replaceChildren(...instants.map((one, k) => new Option(`${fixed(one.time_s, 4)} s`, k)));
  if (!instants.length) return;
  $("seen-names").checked = matchMedia(ROOMY).matches;
  panels = instants[0].cameras.map((one) => panel(one.camera));
  $("seen-views").replaceChildren(...panels.map((one) => one.node));
  for (const one of panels) {
    const pixels = instants.flatMap((instant) => of(instant, one.camera).markers.map((marker) => marker.seen_px).filter(Boolean));
    if (pixels.length) one.view.fit(pixels);
  }
  choose();
}

function panel(camera) {
  const one = { camera, shown: null, picture: null, title: el("small"), note: el("p", { className: "quiet note", role: "status" }) };
  const fetch = latest(() => fetchPicture(one));
  one.fetch = fetch;
  one.view = cameraView(sizeOf(camera), { paint: (pen, at) => paint(one, pen, at), onCloser: fetch });
  one.node = el("div", { className: "film-view" }, el("h4", {}, camera, " ", one.title), one.view.canvas, el("div", { className: "controls" }, one.view.buttons), one.note);
  one.view.setGain(gainOf($("seen-gain")));
  return one;
}

function sizeOf(camera) {
  const known = film?.cameras.find((one) => one.name === camera);
  if (known?.width_px) return known;
  const pixels = instants.flatMap((one) => of(one, camera).markers.map((marker) => marker.seen_px ?? [0, 0]));
  const most = (k) => Math.ceil(Math.max(100, ...pixels.map((at) => at[k])) * 1.1);
  return { name: camera, width_px: most(0), height_px: most(1) };
}

const of = (instant, camera) => instant.cameras.find((one) => one.camera === camera);

function choose() {
  const instant = instants[Number($("seen-instant").value)];
  for (const one of panels) {
    one.shown = of(instant, one.camera);
    const apart = differences(one.shown);
    one.title.textContent = strobe ? `frames ${one.shown.frame} and ${one.shown.frame + 1}, added` : `frame ${one.shown.frame}`;
    one.note.textContent = apart.length ? `${plural(apart.length, "marker")} seen and projected, ${rounded(apart.sort((a, b) => a - b)[Math.floor(apart.length / 2)], 2)} px apart in the median, ${rounded(apart.at(-1), 2)} at most`
      : "No marker of this instant was seen here.";
    one.view.canvas.ariaLabel = `Camera ${one.camera}, frame ${one.shown.frame}: ${one.note.textContent}`;
    one.view.draw();
    one.fetch();
  }
}

const pairs = ({ markers }) => markers.filter((one) => one.seen_px && one.projected_px).map((one) => [one.seen_px, one.projected_px]);
const differences = (shown) => pairs(shown).map(([[x, y], [u, v]]) => Math.hypot(x - u, y - v));

async function fetchPicture(one) {
  if (!film) return;
  const { frame } = one.shown;
  const width = one.view.pictureWidth();
  if (one.picture?.frame === frame && one.picture.width >= width) return;
  try {
    const fetched = async (number) => createImageBitmap(await call("GET", `films/${part(film.id)}/frames/${part(one.camera)}/${number}?width_px=${width}`, { as: "blob" }));
    const picture = await fetched(frame);
    // The last rows of a frame and the first of the next one see the same flash.
    const whole = strobe ? await fetched(frame + 1).catch(() => null).then((next) => (next ? added(picture, next) : picture)) : picture;
    one.picture = { frame, width };
    one.view.show(whole);
  } catch (error) {
    one.note.textContent = error.message;
  }
}

function paint(one, pen, at) {
  if (!one.shown) return;
  for (const [from, to] of pairs(one.shown)) {
    if (Math.hypot(from[0] - to[0], from[1] - to[1]) <= WRONG_PX) continue;
    pen.strokeStyle = LOOK.cursor;
    pen.beginPath();
    pen.moveTo(...at(...from));
    pen.lineTo(...at(...to));
    pen.stroke();
  }
  for (const { marker, seen_px: seen, projected_px: projected } of one.shown.markers) {
    if (projected) cross(pen, at(...projected), 5, LOOK.found);
    if (seen) circle(pen, at(...seen), 7, LOOK.seen);
    if (seen && $("seen-names").checked) name(pen, at(...seen), marker, LOOK.seen);
  }
}

function added(one, other) {
  const sum = new OffscreenCanvas(one.width, one.height);
  const pen = sum.getContext("2d");
  pen.drawImage(one, 0, 0);
  pen.globalCompositeOperation = "lighter";
  pen.drawImage(other, 0, 0);
  for (const picture of [one, other]) picture.close();
  return sum.transferToImageBitmap();
}
