// The part of the page with the start page, the tables and the upload of datasets.

import { fill } from "../base/api.js";
import { $ } from "../base/format.js";

export async function buildLists() {
  await fill($("lists"), "lists/page.html");
  $("empty").append($("home"));
  $("home-below").append($("upload"));
}

// Datasets are uploaded where they are listed: on the start page (null) and above their table.
export function placeUpload(page) {
  const place = page === "datasets" ? $("listing-upload") : page === null ? $("home-below") : null;
  if (place && $("upload").parentElement !== place) place.append($("upload"));
}
