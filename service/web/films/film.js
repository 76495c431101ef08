// One film (#film=ID): its files, what the cameras see, the form that tracks it, and its trackings.

import { get, part } from "../base/api.js";
import { $, el, plural, toast, when } from "../base/format.js";
import { badge, timeLeft } from "../parts/sidebar.js";
import { remove } from "../pages/submit.js";
import { setUpForm, showForm } from "./form.js";
import { setUpLabels, showLabels } from "./labels.js";
import { detectAgain, drawLook, goTo, setUpLook, showLook } from "./look.js";
import { setUpUpload, showFiles } from "./upload.js";

const POLL_MS = 2500;
const LISTED = 20;

let id = null;
let timer = null;
let hooks = {};

export function setUpFilm(given) {
  hooks = given;
  setUpLook();
  setUpForm({ onKind: detectAgain });
  setUpLabels({ onChange: drawLook, onGo: goTo });
  setUpUpload((film) => {
    if (film.id !== id) return;
    showLook(null); // what was seen may be of a file that was replaced
    show(film);
  });
  $("film-delete").addEventListener("click", async () => {
    if (await remove("films", id, $("film-name").textContent)) location.hash = "films";
  });
}

export async function showFilm(next) {
  id = next;
  clearTimeout(timer);
  $("film-part").hidden = true;
  if (!id) return showLook(null);
  try {
    const film = await get(`films/${part(id)}`);
    if (id !== next) return;
    $("film-part").hidden = false;
    show(film);
    await listTrackings();
  } catch (error) {
    if (id === next) hooks.onMissing(error, () => id === next && $("film-part").hidden && showFilm(next));
  }
}

function show(film) {
  document.title = `${film.name} · wingfit`;
  $("film-name").textContent = film.name;
  $("film-about").textContent = [plural(film.cameras.length, "camera"), when(film.created_at)].join(" · ");
  showFiles(film);
  const seen = film.cameras.every((one) => one.bytes !== null && !film.missing.includes(one.name));
  $("look-part").hidden = !seen;
  $("track-part").hidden = !film.ready;
  if (seen) {
    showLabels(film);
    showForm(film).catch((error) => toast(error.message));
  }
  showLook(seen ? film : null);
}

async function listTrackings() {
  clearTimeout(timer);
  const mine = id;
  if (document.hidden) {
    timer = setTimeout(listTrackings, POLL_MS);
    return;
  }
  try {
    const { items } = await get(`trackings?film_id=${part(mine)}&limit=${LISTED}`);
    if (id !== mine) return;
    const rows = el("ul", {}, ...items.map((one) => el("li", {}, el("a", { href: `#tracking=${part(one.id)}` }, one.name), " ", badge(one), timeLeft(one) ? ` ${timeLeft(one)}` : "", ` ${when(one.created_at)}`)));
    if (!items.length) rows.append(el("li", { className: "quiet" }, "None yet."));
    if ($("film-trackings").dataset.shown !== rows.innerHTML) $("film-trackings").replaceChildren(...rows.children);
    $("film-trackings").dataset.shown = rows.innerHTML;
  } catch (error) {
    if (!error.away) toast(error.message);
  }
  if (id === mine) timer = setTimeout(listTrackings, POLL_MS);
}
