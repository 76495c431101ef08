// One tracking (#tracking=ID): its progress, and then its result.

import { call, follow, get, isFinal, part } from "../base/api.js";
import { $, el, fixed, keyNumber, rounded, toast, when } from "../base/format.js";
import { showRemarks } from "../base/form_errors.js";
import { badge, setBar, timeLeft } from "../parts/sidebar.js";
import { cancel, remove } from "../pages/submit.js";
import { importFile } from "../importing/page.js";
import { hidePictures, setUpPictures, showPictures } from "./pictures.js";
import { drawFound } from "./found.js";
import { setUpFilmedDataset, showFilmedDataset } from "./dataset.js";

const STAGES = { detecting: "detecting markers", instants: "matching frames", rays: "intersecting rays", following: "identifying and following markers" };

let tracking = null;
let result = null;
let fetched = false;
let stopFollowing = () => {};
let hooks = {};
let wanted = null;

export function setUpTracking(given) {
  hooks = given;
  setUpPictures();
  setUpFilmedDataset();
  $("tracking-actions").addEventListener("click", (event) => {
    const action = event.target.dataset?.action;
    if (action) act(action);
  });
  $("tracking-dataset").addEventListener("click", makeDataset);
}

export async function showTracking(id) {
  stopFollowing();
  stopFollowing = () => {};
  [tracking, result, fetched, wanted] = [null, null, false, id];
  $("tracking-part").hidden = true;
  $("tracking-result").hidden = true;
  hidePictures();
  if (!id) return;
  try {
    const found = await get(`trackings/${part(id)}`);
    if (wanted !== id) return;
    tracking = found;
  } catch (error) {
    if (wanted === id) hooks.onMissing(error, () => wanted === id && !tracking && showTracking(id));
    return;
  }
  $("tracking-part").hidden = false;
  update();
  if (!isFinal(tracking)) listen();
}

function listen() {
  stopFollowing = follow(`trackings/${part(tracking.id)}`, "step", {
    onStep(step) {
      if (step.sequence <= tracking.steps) return;
      const { stage, progress, eta_seconds } = step;
      tracking = { ...tracking, stage, progress, eta_seconds, steps: step.sequence };
      update();
    },
    onState(state) {
      tracking = state;
      update();
    },
    onAway: hooks.onAway,
  });
}

function update() {
  const path = `v1/trackings/${part(tracking.id)}`;
  const done = tracking.state === "SUCCEEDED";
  document.title = `${tracking.name} · wingfit`;
  $("tracking-name").replaceChildren(tracking.name, " ", badge(tracking));
  $("tracking-about").textContent = about(tracking);
  $("tracking-film").href = `#film=${part(tracking.film_id)}`;
  $("tracking-error").hidden = !tracking.error;
  $("tracking-error").textContent = tracking.error ?? "";
  setBar($("tracking-bar"), tracking);
  $("tracking-bar").hidden = done;
  $("tracking-progress").textContent = done ? "" : [`${Math.round(100 * tracking.progress)} %`, timeLeft(tracking),
    tracking.state === "RUNNING" ? STAGES[tracking.stage] ?? tracking.stage : null].filter(Boolean).join(" · ");
  $("tracking-report").hidden = !done;
  $("tracking-exports").hidden = !done;
  $("tracking-report").href = `${path}/report.html`;
  $("tracking-csv").href = `${path}/tracks.csv`;
  $("tracking-npz").href = `${path}/covariance.npz`;
  for (const button of $("tracking-actions").querySelectorAll("[data-action]")) {
    button.hidden = isFinal(tracking) !== (button.dataset.action === "delete");
    button.disabled = Boolean(tracking.pending_action);
  }
  if (done && !fetched) fetchResult();
}

function about({ spec, dataset_id: wing, created_at: created }) {
  const { kind, light, first_frame: first, last_frame: last, clocks_within_ms: within } = spec;
  return [kind === "dot" ? "dots" : "chequers", light === "strobe" ? "strobe" : "continuous light", within ? `clocks within ${within} ms` : null,
    first || last !== null ? `frames ${first} to ${last === null ? "the last" : last - 1}` : null, wing ? "markers of a wing" : null, spec.labels?.length ? "labelled by hand" : null, when(created)]
    .filter(Boolean).join(" · ");
}

async function fetchResult() {
  const { id } = tracking;
  fetched = true;
  try {
    const found = await get(`trackings/${part(id)}/result`);
    if (tracking?.id !== id) return;
    result = found;
    await showResult();
  } catch (error) {
    if (tracking?.id === id) fetched = false;
    toast(error.message);
  }
}

const small = (value) => (value !== null && value < 0.001 ? "< 0.001" : rounded(value, 2));

async function showResult() {
  const names = Object.keys(result.markers);
  $("tracking-result").hidden = false;
  showFilmedDataset(tracking).catch((error) => toast(error.message));
  $("tracking-numbers").replaceChildren(
    keyNumber("Instants", result.instants.toLocaleString("en")), keyNumber("Duration", rounded(result.seconds), "s"),
    keyNumber("Markers found, median", fixed(result.markers_found_median, Number.isInteger(result.markers_found_median) ? 0 : 1), `of ${names.length}`, true),
    keyNumber("Error of a pixel beside that of its detection", small(result.pixel_error_px), "px"));
  showRemarks($("tracking-remarks"), result.remarks);
  const number = (text) => el("td", { className: "n" }, text);
  $("tracked-markers").tBodies[0].replaceChildren(...names.map((name) => {
    const { found_percent: found, standard_deviation_mm: deviation, rejected } = result.markers[name];
    return el("tr", {}, el("td", {}, name), number(fixed(found, 1)), number(small(deviation)), number(String(rejected)));
  }));
  $("tracked-cameras").tBodies[0].replaceChildren(...Object.entries(result.cameras).map(([name, one]) => el("tr", {}, el("td", {}, name),
    number(small(one.residual_px)), el("td", {}, one.bad_frames.length ? one.bad_frames.join(", ") : "none"))));
  await Promise.all([redrawTracking(), pictures(tracking.id)]);
}

async function pictures(id) {
  const film = await get(`films/${part(tracking.film_id)}`).catch(() => null); // it may have been deleted since
  if (tracking?.id === id) showPictures(film, result.shown, tracking.spec.light === "strobe");
}

// Draw the charts in the present theme.
export async function redrawTracking() {
  if (result) await drawFound($("found-plot"), result).catch((error) => toast(error.message));
}

async function act(action) {
  if (action === "delete") {
    if (await remove("trackings", tracking.id, tracking.name)) location.hash = "films";
    return;
  }
  if (action === "cancel") await cancel("trackings", tracking.id, tracking.name);
}

// The tracks become a file of the import page, which asks for what they do not state.
async function makeDataset() {
  const button = $("tracking-dataset");
  button.disabled = true;
  try {
    const blob = await call("GET", `trackings/${part(tracking.id)}/tracks.csv`, { as: "blob" });
    const stem = tracking.name.replace(/[^A-Za-z0-9._-]+/g, "_").replace(/^[._-]+|[._-]+$/g, "") || "tracks";
    importFile(new File([blob], `${stem}.csv`, { type: "text/csv" }));
  } catch (error) {
    toast(error.message);
  } finally {
    button.disabled = false;
  }
}
