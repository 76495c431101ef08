// What was understood of a file: facts and who stated them, gaps, remarks, and a table of the markers.

import { $, DASH, el, fixed, plural, rounded } from "../base/format.js";
import { capital } from "../base/labels.js";
import { inWords } from "./form.js";

export function setUpUnderstood(onDownload) {
  $("import-download").addEventListener("click", onDownload);
  $("import-all").addEventListener("click", () => useAll(true));
  $("import-none").addEventListener("click", () => useAll(false));
  $("import-markers").addEventListener("change", redrawUse);
}

const rows = () => [...$("import-markers").tBodies[0].rows];
const tick = (row) => row.querySelector("[type=checkbox]");

function useAll(on) {
  for (const row of rows()) tick(row).checked = on;
  redrawUse();
}

function redrawUse() {
  const used = rows().filter((row) => tick(row).checked);
  for (const row of rows()) row.classList.toggle("off", !tick(row).checked);
  $("import-download").disabled = !used.length;
}

// What is known before all questions are answered: the ranges of the numbers help to choose a unit.
export function showKnown(found) {
  const { contents, title } = found ?? {};
  const parts = [title ? `Format: ${title}` : null, contents ? `${plural(contents.labels.length, "marker")}, ${contents.frames.toLocaleString("en")} frames` : null];
  if (contents?.low && !found.tracks) {
    parts.push(`the numbers in it are ${[..."xyz"].map((axis, k) => `${axis} ${rounded(contents.low[k])} to ${rounded(contents.high[k])}`).join(", ")}`);
  }
  const asked = found && !found.questions.length ? " It states everything that is needed but its axes." : "";
  $("import-known").textContent = parts.some(Boolean) ? `${parts.filter(Boolean).join("; ")}.${asked}` : "";
}

export function showTracks({ title, tracks }) {
  $("import-summary").textContent = [title, plural(tracks.markers.length, "marker"), `${tracks.frames.toLocaleString("en")} frames`,
    `${rounded(tracks.duration_s, 4)} s`, `${rounded(tracks.rate_hz, 4)} frames per second`].join(", ");
  const facts = tracks.statements.map(({ fact, value, by, where }) => [capital(fact), value, by === "user" ? "you" : `the file: ${where}`]);
  if (tracks.frame === "file") facts.push(["Axes", "of the file; how they lie in the wing is not stated", "nobody"]);
  $("import-facts").tBodies[0].replaceChildren(...facts.map((cells) => el("tr", {}, ...cells.map((text) => el("td", { className: "prose" }, text)))));
  const causes = Object.entries(tracks.gaps).filter(([, count]) => count);
  const total = causes.reduce((sum, [, count]) => sum + count, 0);
  const positions = tracks.frames * tracks.markers.length;
  $("import-gaps").textContent = `Missing positions: ${total.toLocaleString("en")} of ${positions.toLocaleString("en")}${causes.length ? ` (${causes.map(([cause, count]) => `${count.toLocaleString("en")} ${CAUSES[cause]}`).join(", ")})` : ""}.`;
  const remarks = tracks.remarks.filter((one) => !one.startsWith("the axes are those of the file"));
  $("import-remarks").hidden = !remarks.length;
  $("import-remarks").replaceChildren(...remarks.map((one) => el("li", {}, `${capital(inWords(one))}.`)));
  showMarkers(tracks);
}

const CAUSES = { empty: "empty", nan: "not a number", zeros: "exactly zero", residual: "marked invalid", partial: "partly there" };

// Choices of names and use stay while the markers are the same.
function showMarkers({ markers }) {
  const before = new Map(rows().map((row) => [row.dataset.name, { used: tick(row).checked, name: row.querySelector("[type=text]").value }]));
  const same = markers.every((one) => before.has(one.name)) && before.size === markers.length;
  $("import-markers").tBodies[0].replaceChildren(...markers.map((one) => {
    const known = same ? before.get(one.name) : { used: true, name: one.name };
    const range = (k) => el("td", { className: "n" }, `${fixed(1e3 * one.low_m[k], 1)} to ${fixed(1e3 * one.high_m[k], 1)}`);
    const row = el("tr", {},
      el("td", {}, el("input", { type: "checkbox", checked: known.used, ariaLabel: `Use ${one.name}` })),
      el("td", {}, el("input", { type: "text", value: known.name, ariaLabel: `Name of ${one.name}`, maxLength: 64 })),
      el("td", {}, one.label), el("td", { className: "n" }, `${fixed(100 * one.seen, one.seen > 0.999 && one.seen < 1 ? 2 : 0)} %`), range(0), range(1), range(2),
      el("td", { className: "n" }, one.largest_jump_m === null ? DASH : fixed(1e3 * one.largest_jump_m, 2)));
    row.dataset.name = one.name;
    return row;
  }));
  redrawUse();
}

// The table ``csv`` of the server with the markers that are ticked, under their new names.
export function chosenMarkers(csv, { markers }) {
  const chosen = rows().map((row, k) => ({ k, used: tick(row).checked, name: row.querySelector("[type=text]").value.trim() })).filter((one) => one.used);
  if (!chosen.length) throw new Error("No marker is ticked; tick those that the table is to have.");
  const names = chosen.map((one) => one.name);
  const odd = names.find((name) => !/^[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9_-])?$/.test(name));
  if (odd !== undefined) throw new Error(`“${odd}” is no name of a marker; use letters, digits, ., _ and -, the first a letter or digit.`);
  const twice = names.find((name, k) => names.indexOf(name) !== k);
  if (twice) throw new Error(`Two markers are called ${twice}; give each its own name.`);
  if (chosen.length === markers.length && chosen.every((one) => one.name === markers[one.k].name)) return csv;
  const columns = chosen.flatMap(({ k }) => [3 * k + 1, 3 * k + 2, 3 * k + 3]);
  const lines = csv.trimEnd().split("\n").slice(1).map((line) => {
    const cells = line.split(",");
    return [cells[0], ...columns.map((at) => cells[at])].join(",");
  });
  return [["time_s", ...names.flatMap((name) => [..."xyz"].map((axis) => `${name}_${axis}_m`))].join(","), ...lines, ""].join("\n");
}

export const chosenSources = () => rows().filter((row) => tick(row).checked).map((row) => row.dataset.name);
export const chosenNames = () => rows().filter((row) => tick(row).checked).map((row) => row.querySelector("[type=text]").value.trim());
