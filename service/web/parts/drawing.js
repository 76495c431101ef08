// The described wing of a dataset as a drawing; its colours are those of the page (style.css).

import { getText, part } from "../base/api.js";
import { $, toast } from "../base/format.js";

const NOTES = {
  tracks: "Seen from above, to scale: outline, flapping axis, rods and markers. Filled markers show the start of a beat.",
  forces: "One wing of the vehicle, seen from above, to scale, with its flapping axis.",
};

let shown = null; // id of the dataset whose drawing is shown or on its way

export async function showDrawing(dataset) {
  if (shown === dataset.id) return;
  shown = dataset.id;
  $("drawing").replaceChildren();
  $("drawing-note").textContent = NOTES[dataset.kind];
  $("drawing-file").href = `v1/datasets/${part(dataset.id)}/drawing`;
  try {
    const text = await getText(`datasets/${part(dataset.id)}/drawing`);
    if (shown !== dataset.id) return;
    // An XML document that is parsed here runs no scripts, as an image would run none.
    const drawing = new DOMParser().parseFromString(text, "image/svg+xml").documentElement;
    $("drawing").replaceChildren(document.importNode(drawing, true));
  } catch (error) {
    if (shown !== dataset.id) return;
    shown = null;
    toast(error.message);
  }
}
