// A first dataset from tracks alone: the wing described by its tracks, or the positions without a wing.

import { ApiError, call } from "../base/api.js";
import { $, el, toast } from "../base/format.js";
import { capital } from "../base/labels.js";
import { send } from "../pages/submit.js";
import { inWords } from "./form.js";
import { chosenNames, chosenSources } from "./understood.js";
import { zip } from "./zip.js";

let hooks = {};

export function setUpStart(given) {
  hooks = given;
  $("import-describe").addEventListener("click", describe);
  $("import-series").addEventListener("click", storeSeries);
}

// Another file was chosen, or other axes: what was described does not belong to it.
export function showStart(tracks) {
  $("import-describe-part").hidden = tracks?.frame !== "wing";
  $("import-described").hidden = true;
  showErrors("import-describe-errors", null);
  showErrors("import-series-errors", null);
}

// Ask the server for the description of the ticked markers, under their new names.
async function described(axes) {
  const form = hooks.body();
  const sources = chosenSources();
  const names = chosenNames();
  if (!sources.length) throw new ApiError("No marker is ticked; tick those of the wing.");
  form.set("markers", sources.join(","));
  const frequency = $("import-recording").elements.namedItem("flap_frequency_hz").value.trim();
  if (axes && frequency) form.set("flap_frequency_hz", frequency);
  if (!axes) form.delete("axes");
  const found = await call("POST", "imports/description", { body: form });
  const renamed = new Map(sources.flatMap((old, k) => ["", "_x_m", "_y_m", "_z_m"].map((end) => [old + end, names[k] + end])));
  return { ...found, yaml: found.yaml.replace(/"([^"\\]*)"/g, (quoted, text) => `"${renamed.get(text) ?? text}"`) };
}

async function describe() {
  showErrors("import-describe-errors", null);
  $("import-describe").disabled = true;
  try {
    const found = await described(true);
    const recording = $("import-recording").elements;
    const dataset = $("import-dataset");
    const rows = found.facts.map(({ what, value, source }) => [capital(what), value, source]);
    if (!recording.namedItem("flap_frequency_hz").value.trim()) recording.namedItem("flap_frequency_hz").value = found.flap_frequency_hz.toPrecision(5);
    for (const [name, value] of Object.entries(found.conditions)) {
      if (!recording.namedItem(name).value) recording.namedItem(name).value = value;
    }
    if (!dataset.description.value.trim()) dataset.description.value = found.yaml;
    else toast("The description in step 5 is kept; empty it to have it described anew");
    if (!dataset.elements.namedItem("name").value.trim()) dataset.elements.namedItem("name").value = recording.namedItem("name").value;
    const { rig, phase_lag_deg: lag, pressure_mbar: mbar, temperature_c: celsius } = found.conditions;
    const conditions = [["Rig", rig.replace("_", " ")], ["Phase lag", `${lag} deg; there is no rear rod`], ["Air", `${mbar} mbar, ${celsius} °C`]];
    const shown = [...rows.filter(([what]) => what !== "Air"), ...conditions.map((pair) => [...pair, "assumed, where the field was empty"])];
    $("import-described").querySelector("tbody").replaceChildren(...shown.map((cells) => el("tr", {}, ...cells.map((text) => el("td", { className: "prose" }, text)))));
    $("import-described").hidden = false;
  } catch (error) {
    showErrors("import-describe-errors", error);
  } finally {
    $("import-describe").disabled = false;
  }
}

// The positions of the ticked markers as series, which need neither axes nor a wing.
async function storeSeries() {
  showErrors("import-series-errors", null);
  $("import-series").disabled = true;
  try {
    const [found, csv] = [await described(false), await hooks.table()];
    const name = $("import-recording").elements.namedItem("name").value.trim() || "positions";
    const yaml = [`format_version: 1`, `name: ${JSON.stringify(name)}`, `description: "Positions of markers, in m; no wing is described."`,
      found.yaml.trimEnd(), "recordings:", `  - {name: ${JSON.stringify(name)}, settings: {}}`, ""].join("\n");
    const blob = await zip({ "dataset.yaml": yaml, [`recordings/${name}.csv`]: columns(csv, yaml) });
    hooks.onStored(await send(new File([blob], "positions.zip"), () => {}));
  } catch (error) {
    showErrors("import-series-errors", error);
  } finally {
    $("import-series").disabled = false;
  }
}

// The table with the columns that are channels: a coordinate that never changes is none.
function columns(csv, yaml) {
  const rows = csv.trimEnd().split("\n").map((line) => line.split(","));
  const keep = rows[0].map((name, k) => k).filter((k) => k === 0 || yaml.includes(`{name: "${rows[0][k]}"`));
  return [...rows.map((row) => keep.map((k) => row[k]).join(",")), ""].join("\n");
}

function showErrors(id, error) {
  const box = $(id);
  box.hidden = !error;
  if (!error) return box.replaceChildren();
  const items = (error.errors ?? []).map((item) => el("li", {}, inWords(`${item.where}: ${item.message}`)));
  box.replaceChildren(el("p", {}, error.message), ...(items.length ? [el("ul", {}, ...items)] : []));
}
