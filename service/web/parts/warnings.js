// Likely mistakes that the checks of an upload found in a dataset: what, where, and how to correct them.

import { copyable } from "../base/copying.js";
import { $, el, plural } from "../base/format.js";

const FIX = "wingfit datasets check FOLDER --fix NEW_FOLDER";
const FACTS = [["where", "Place"], ["value", "Value"], ["expected", "Expected"], ["cause", "Likely cause"], ["change", "Change"]];

const count = ({ warnings }) => plural(warnings.length, "likely mistake");

// A message that a dataset was ``done``, and that it has warnings.
export const stored = (done, dataset) => `${done} ${dataset.name}${dataset.warnings?.length ? `: it has ${count(dataset)}` : ""}`;

// What a list shows beside the name of a dataset with warnings; nothing for one without.
export const warningBadge = (dataset) => (dataset.warnings?.length
  ? [" ", el("span", { className: "badge bad", title: dataset.warnings.map((one) => `${one.where}: ${one.value}`).join("\n") }, count(dataset))] : []);

export function showWarnings(dataset) {
  const { warnings } = dataset;
  $("warnings-title").textContent = `${count(dataset)} in this dataset`;
  $("warnings-part").hidden = !warnings.length;
  $("warnings").replaceChildren(
    el("p", {}, "The dataset was stored all the same. Compare it with the experiment before you calibrate."),
    el("ul", { className: "plain" }, ...warnings.map(card)),
    el("p", {}, "Change the folder by hand, or let this command write a corrected copy, and upload that as a new dataset:"),
    copyable(FIX, "command that writes a corrected copy"));
}

const card = (warning) => el("li", {},
  el("strong", {}, warning.kind[0].toUpperCase() + warning.kind.slice(1)),
  el("dl", { className: "facts" }, ...FACTS.flatMap(([name, title]) =>
    [el("dt", {}, title), el("dd", {}, name === "change" ? el("code", {}, warning[name]) : warning[name])])));
