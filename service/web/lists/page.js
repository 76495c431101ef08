// The part of the page with the start page, the tables and the upload of datasets.

import { ApiError } from "../base/api.js";
import { $ } from "../base/format.js";

export async function buildLists() {
  const answer = await fetch("lists/page.html").catch(() => null);
  if (!answer?.ok) throw new ApiError("The page could not be loaded; reload it.");
  $("lists").innerHTML = await answer.text(); // a file of this page, without anything of a user
  $("empty").append($("home"));
  $("home-below").append($("upload"));
}

// Datasets are uploaded where they are listed: on the start page (null) and above their table.
export function placeUpload(page) {
  const place = page === "datasets" ? $("listing-upload") : page === null ? $("home-below") : null;
  if (place && $("upload").parentElement !== place) place.append($("upload"));
}
