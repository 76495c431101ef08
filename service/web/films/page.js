// The pages of films (#films, #film=ID, #tracking=ID): films are uploaded, looked at and tracked.

import { fill } from "../base/api.js";
import { $, toast } from "../base/format.js";
import { setUpFilm, showFilm } from "./film.js";
import { setUpList, showList } from "./list.js";
import { redrawTracking, setUpTracking, showTracking } from "./tracking.js";
import { add } from "./upload.js";

export const FILM_PAGES = ["films", "film", "tracking"];

let ready = null;
let hooks = {};
let built = false;

export function setUpFilms(given) {
  hooks = given;
}

// Show ``page``, one of FILM_PAGES, of the film or tracking ``id``; null hides them.
export async function showFilms(page, id) {
  $("films-page").hidden = !page;
  if (!page && !built) return;
  ready ??= build();
  try {
    await ready;
  } catch (error) {
    ready = null;
    toast(error.message);
    return;
  }
  await Promise.all([showList(page === "films"), showFilm(page === "film" ? id : null), showTracking(page === "tracking" ? id : null)]);
}

async function build() {
  await fill($("films-page"), "films/page.html");
  setUpFilm(hooks);
  setUpTracking(hooks);
  setUpList({
    onCreated(film, calibration) {
      location.hash = `film=${encodeURIComponent(film.id)}`;
      if (calibration) add("cameras", calibration, film);
    },
  });
  built = true;
}

export const redrawFilms = () => built && redrawTracking();
