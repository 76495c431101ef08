// The form that makes a dataset of tracked films: their tracks are aligned to a described wing on the server.

import { ApiError, get, part, postJson } from "../base/api.js";
import { $, el, rounded } from "../base/format.js";
import { randomKey } from "../pages/submit.js";

const MOST = 200;
const FIELDS = [ // name, heading, width in characters, what an empty field means
  ["flap_frequency_hz", "Flap frequency, Hz", 6, null], ["phase_lag_deg", "Phase lag, deg", 5, null], ["pressure_mbar", "Pressure, mbar", 6, null],
  ["temperature_c", "Temperature, °C", 5, null], ["airspeed_m_s", "Airspeed, m/s", 5, 0], ["angle_of_attack_deg", "Angle of attack, deg", 5, 0]];

let shown = null; // id of the tracking whose page it is
let file = null; // the text of a description that was opened
let sent = null;

export function setUpFilmedDataset() {
  const form = $("filmed-dataset");
  form.addEventListener("submit", store);
  form.wing.addEventListener("change", () => { if (form.wing.value === "file") $("filmed-wing-file").click(); });
  $("filmed-wing-file").addEventListener("change", opened);
  $("filmed-recordings").querySelector("thead").replaceChildren(el("tr", {},
    ...["Use", "Recording", "Rig", ...FIELDS.map(([, heading]) => heading), "Held out"].map((heading) => el("th", { scope: "col" }, heading))));
}

// Show the form for ``tracking``, with the other tracked films that may be recordings of the same dataset.
export async function showFilmedDataset(tracking) {
  if (shown === tracking.id) return;
  shown = tracking.id;
  const form = $("filmed-dataset");
  form.reset();
  file = null;
  $("filmed-result").hidden = true;
  showFaults(null);
  const [{ items: tracked }, { items: datasets }] = await Promise.all([get(`trackings?state=SUCCEEDED&limit=${MOST}`), get(`datasets?kind=tracks&limit=${MOST}`)]);
  if (shown !== tracking.id) return;
  form.wing.replaceChildren(new Option("choose", ""), new Option("a file: dataset.yaml…", "file"), ...datasets.map((one) => new Option(one.name, one.id)));
  if (datasets.some((one) => one.id === tracking.dataset_id)) form.wing.value = tracking.dataset_id;
  const others = tracked.filter((one) => one.id !== tracking.id && one.film_id !== tracking.film_id);
  $("filmed-recordings").tBodies[0].replaceChildren(...[tracking, ...others].map((one, index) => row(one, index === 0)));
}

const nameOf = (title) => title.replace(/[^A-Za-z0-9._-]+/g, "_").replace(/^[._-]+|[._-]+$/g, "") || "recording";

function row({ id, name }, used) {
  const input = (field, heading, size, otherwise) => el("td", {}, el("input", {
    name: field, size, inputMode: "decimal", autocomplete: "off", ariaLabel: `${heading} of ${name}`, placeholder: otherwise === null ? "" : String(otherwise) }));
  const line = el("tr", {},
    el("td", {}, el("input", { type: "checkbox", name: "used", checked: used, ariaLabel: `Use ${name}` })),
    el("td", {}, el("input", { name: "recording", size: 14, value: nameOf(name), maxLength: 100, autocomplete: "off", ariaLabel: `Name of the recording of ${name}` })),
    el("td", {}, el("select", { name: "rig", ariaLabel: `Rig of ${name}` }, new Option("vacuum chamber", "vacuum_chamber"), new Option("wind tunnel", "wind_tunnel"))),
    ...FIELDS.map((one) => input(...one)),
    el("td", {}, el("input", { type: "checkbox", name: "held_out", ariaLabel: `Hold out ${name}` })));
  line.dataset.tracking = id;
  return line;
}

async function opened() {
  const form = $("filmed-dataset");
  const [chosen] = $("filmed-wing-file").files;
  $("filmed-wing-file").value = ""; // so that the same file, changed, can be chosen again
  if (!chosen) return;
  file = await chosen.text();
  const option = [...form.wing.options].find((one) => one.value === "file");
  option.textContent = chosen.name;
}

// Text that is no number is sent as it is: the server says what is wrong with it.
const number = (text) => (text && Number.isFinite(Number(text)) ? Number(text) : text);

function recording(line) {
  const value = (name) => line.querySelector(`[name=${name}]`).value.trim();
  const conditions = FIELDS.filter(([name, , , otherwise]) => value(name) || otherwise === null).map(([name]) => [name, number(value(name))]);
  return { tracking_id: line.dataset.tracking, name: value("recording"), rig: value("rig"), held_out: line.querySelector("[name=held_out]").checked, ...Object.fromEntries(conditions) };
}

const usedLines = () => [...$("filmed-recordings").tBodies[0].rows].filter((line) => line.querySelector("[name=used]").checked);

function body(form) {
  const recordings = usedLines().map(recording);
  if (!recordings.length) throw new ApiError("No film is used; tick those that belong to the dataset.");
  for (const one of recordings) {
    const [, heading] = FIELDS.find(([name]) => one[name] === "") ?? [];
    if (heading) throw new ApiError(`${heading} of ${one.name} is empty; state it.`);
  }
  const wing = form.wing.value;
  if (!wing || (wing === "file" && file === null)) throw new ApiError("The wing is not described; choose a dataset that describes it, or open its dataset.yaml.");
  const value = { name: form.elements.namedItem("name").value.trim(), recordings, ...(wing === "file" ? { description: file } : { dataset_id: wing }) };
  if (!value.name) throw new ApiError("The dataset has no name; give it one.");
  for (const name of ["side", "up"]) if (form.elements.namedItem(name).value) value[name] = form.elements.namedItem(name).value;
  if (form.ignore_names.checked) value.ignore_names = true;
  return value;
}

async function store(event) {
  event.preventDefault();
  const form = $("filmed-dataset");
  const button = form.querySelector("[type=submit]");
  if (button.disabled) return;
  showFaults(null);
  $("filmed-result").hidden = true;
  button.disabled = true;
  try {
    const value = body(form);
    const text = JSON.stringify(value);
    if (sent?.text !== text) sent = { text, key: randomKey() }; // the same input sent twice is one dataset
    $("filmed-state").textContent = `Aligning ${value.recordings.length === 1 ? "one film" : `${value.recordings.length} films`}; about 3 s each`;
    const made = await postJson("trackings/dataset", value, { "Idempotency-Key": sent.key });
    sent = null;
    showResult(made);
  } catch (error) {
    showFaults(error);
  } finally {
    $("filmed-state").textContent = "";
    button.disabled = false;
  }
}

// "body.recordings.1.pressure_mbar" is of the second film that is used.
function place(where) {
  const [, index, field] = where.match(/^body\.recordings\.(\d+)\.?(.*)$/) ?? [];
  const name = index === undefined ? null : usedLines()[index]?.querySelector("[name=recording]").value;
  return [name ?? where.replace(/^body\.?/, ""), field].filter(Boolean).join(", ");
}

function showFaults(error) {
  const box = $("filmed-errors");
  box.hidden = !error;
  if (!error) return box.replaceChildren();
  const items = (error.errors ?? []).map((one) => el("li", {}, `${place(one.where)}: ${one.message}`));
  box.replaceChildren(el("p", {}, error.message), ...(items.length ? [el("ul", {}, ...items)] : []));
}

function showResult({ dataset, alignments }) {
  const cell = (value) => el("td", { className: "n" }, value);
  $("filmed-result").hidden = false;
  $("filmed-open").href = `#dataset=${part(dataset.id)}`;
  $("filmed-open").textContent = `Open ${dataset.name}`;
  $("filmed-aligned").tBodies[0].replaceChildren(...alignments.map((one) => el("tr", {}, el("td", {}, one.recording), el("td", {}, one.side),
    cell(rounded(one.residual_mm)), cell(rounded(one.rest_scatter_mm)), cell(rounded(one.flap_frequency_hz, 6)), cell(String(one.markers.length)),
    el("td", { className: "prose" }, [...one.dropped.map(({ track, reason }) => `${track} is not used: ${reason}`), ...one.remarks].join("; ") || "none"))));
  $("filmed-open").focus();
}
