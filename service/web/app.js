// Entry point: side column, state of the server, and the page that the address after # names.

import { askForKey, isRefused, setUpAccess } from "./parts/access.js";
import { get, isFinal, poll as ask, postJson, setUpRefused, takeMissed } from "./base/api.js";
import { redrawComparison, setUpCompare, showComparison } from "./pages/compare.js";
import { redrawDataset, refreshDataset, selectDataset, setUpDataset, simulate } from "./pages/dataset.js";
import { openDiagnoseForm, setUpDiagnoseForm } from "./diagnosing/form.js";
import { redrawDiagnosis, renameDiagnosis, selectDiagnosis, setUpDiagnosis } from "./pages/diagnosis.js";
import { showEffects } from "./pages/effects.js";
import { FILM_PAGES, redrawFilms, setUpFilms, showFilms } from "./films/page.js";
import { $, plural, toast } from "./base/format.js";
import { setUpImport, showImport } from "./importing/page.js";
import { isSeries } from "./base/labels.js";
import { buildLists, placeUpload } from "./lists/page.js";
import { drawHome, newest } from "./lists/home.js";
import { refreshListing, setUpListing, showListing } from "./lists/table.js";
import { setUpUpload } from "./lists/upload.js";
import { drawActive } from "./parts/sidebar.js";
import { stored } from "./parts/warnings.js";
import { redraw, renameRun, selectRun, setUpRun } from "./pages/run.js";
import { openSubmit, randomKey, remove, setUpSubmit } from "./pages/submit.js";

const POLL_MS = 2500;
const MOST_ACTIVE = 20;
const MOST_CHOICES = 200;
const AGAIN_MS = 3000;
const LISTINGS = ["runs", "diagnoses", "datasets"];
const LISTS = ["effects", "import", "films", ...LISTINGS]; // pages that need no id
const PAGES = ["run", "diagnosis", "dataset", "compare", "film", "tracking", ...LISTS];
const SECTIONS = { run: "runs", compare: "runs", diagnosis: "diagnoses", dataset: "datasets", import: "datasets", film: "films", tracking: "films" }; // menu entry of each page
const KINDS = { run: "runs", diagnosis: "diagnoses", dataset: "datasets", film: "films", tracking: "trackings" }; // pages of one thing
const BROAD = ["compare", "import", ...FILM_PAGES, ...LISTINGS]; // without the lists of the sidebar

let active = { runs: [], diagnoses: [], trackings: [] };
let atHome = null; // the newest findings, runs and datasets
let polling = null;

const parameters = () => new URLSearchParams(location.hash.slice(1));
const current = (page) => parameters().get(page);
const pageOf = (params) => PAGES.find((name) => params.get(name) || (params.has(name) && LISTS.includes(name))) ?? null; // those of one job or dataset need its id
const isHome = () => pageOf(parameters()) === null || !$("empty").hidden;

// Series need a simulation: their page has the ways to give one.
const starting = {
  onRun: (dataset) => (isSeries(dataset) ? simulate(dataset.id) : newRun(dataset)),
  onDiagnose: (dataset) => (isSeries(dataset) ? simulate(dataset.id) : openDiagnoseForm(dataset)),
};

// The form of a run, with the datasets among which can be chosen.
async function newRun(dataset) {
  try {
    openSubmit((await get(`datasets?limit=${MOST_CHOICES}`)).items, dataset);
  } catch (error) {
    toast(error.message);
  }
}

function drawLists() {
  drawActive(active, (page, id) => current(page) === id);
  if (atHome) drawHome(atHome, { ...starting, onDelete: async (dataset) => (await remove("datasets", dataset.id, dataset.name)) && poll() });
}

// What could not be fetched meanwhile is fetched when the server is back; pages with forms keep what was typed.
function setAway(away) {
  if (!away && takeMissed() && !["import", ...FILM_PAGES].includes(pageOf(parameters()))) route();
  $("away").hidden = !away;
  $("away").textContent = away ? "The server does not answer. The page may be out of date; it continues when the server is back." : "";
}

function showHealth(health) {
  const state = { starting: health.detail ?? "evaluator starting", degraded: `degraded: ${health.detail ?? "evaluator not available"}` }[health.status];
  const count = health.runs_active + health.diagnoses_active + health.trackings_active;
  const active = count ? `${plural(count, "job")} active` : "idle";
  $("health").textContent = [state ?? active, health.workers ? plural(health.workers, "worker") : null, `version ${health.version}`]
    .filter(Boolean).join(" · ");
}

async function poll() {
  clearTimeout(polling);
  try {
    const [health, fresh] = await Promise.all([ask("health"), isHome() ? newest() : atHome]);
    atHome = fresh;
    active = Object.fromEntries(await Promise.all(Object.keys(active).map(async (kind) => [kind, health[`${kind}_active`] === 0 ? [] : (await ask(`${kind}?active=true&limit=${MOST_ACTIVE}`)).items])));
    setAway(false);
    showHealth(health);
    drawLists();
    await Promise.all([refreshListing(active), missed()]);
  } catch (error) {
    if (isRefused(error)) setAway(false);
    else if (error.away) setAway(true);
    else toast(error.message);
  }
  clearTimeout(polling);
  if (!document.hidden) polling = setTimeout(poll, POLL_MS);
}

async function route() {
  drawLists();
  const params = parameters();
  const page = pageOf(params);
  const value = (name) => (page === name ? params.get(name) : null);
  $("empty").hidden = page !== null;
  document.body.classList.toggle("home", page === null);
  document.body.classList.toggle("broad", BROAD.includes(page));
  placeUpload(page);
  if (!page) nothing("Newest results");
  for (const link of document.querySelectorAll(".menu a")) {
    if (link.hash === `#${SECTIONS[page] ?? page}`) link.setAttribute("aria-current", "page");
    else link.removeAttribute("aria-current");
  }
  await Promise.all([
    selectRun(value("run")), selectDiagnosis(value("diagnosis")), selectDataset(value("dataset")), showEffects(value("effects")),
    showComparison(value("compare"), { onMissing }), showListing(LISTINGS.includes(page) ? page : null, params), showImport(page === "import"),
    showFilms(FILM_PAGES.includes(page) ? page : null, params.get(page)),
  ]);
}

function nothing(why) {
  document.title = "wingfit";
  $("empty-title").textContent = why;
}

// The job, dataset or film shown may have been renamed or deleted in another window, or by another user.
async function missed() {
  const page = pageOf(parameters());
  if (!KINDS[page]) return;
  const id = current(page);
  const known = active[KINDS[page]]?.find((one) => one.id === id);
  try {
    const now = known ?? await ask(`${KINDS[page]}/${encodeURIComponent(id)}`);
    if (current(page) === id) ({ run: renameRun, diagnosis: renameDiagnosis, dataset: (one) => refreshDataset(one, active) })[page]?.(now);
  } catch (error) {
    if (error.status === 404 && $("empty").hidden && current(page) === id) route();
  }
}

// Try again while the server does not answer; an unknown id is final.
function onMissing(error, again) {
  $("empty").hidden = false;
  nothing(error.message);
  toast(error.message);
  if (error.away) setTimeout(() => { $("empty").hidden = Boolean(location.hash); again(); }, AGAIN_MS);
}

function go(id, kind = "run") {
  location.hash = id ? `${kind}=${encodeURIComponent(id)}` : "";
}

// A run of series has its simulation, and no settings to choose.
async function diagnoseRun(run, dataset) {
  if (!isSeries(run)) {
    openDiagnoseForm(dataset, run);
    return;
  }
  try {
    onDiagnosisSubmitted(await postJson("diagnoses", { run_id: run.id }, { "Idempotency-Key": randomKey() }));
  } catch (error) {
    toast(error.text);
  }
}

function onDiagnosisSubmitted(diagnosis) {
  go(diagnosis.id, "diagnosis");
  poll();
}

function onDeleted() {
  go(null);
  poll();
}

// A page passes a changed job to the side column.
const onChange = (kind) => (job) => {
  active = { ...active, [kind]: active[kind].map((other) => (other.id === job.id ? job : other)).filter((other) => !isFinal(other)) };
  drawLists();
};

function redrawAll() {
  redraw();
  redrawDataset();
  redrawComparison();
  redrawFilms();
  redrawDiagnosis();
}

const common = (page) => ({ currentId: () => current(page), onAway: setAway, onDeleted, onMissing });
setUpRun({ ...common("run"), onChange: onChange("runs"), onDiagnose: diagnoseRun });
setUpDiagnosis({ ...common("diagnosis"), onChange: onChange("diagnoses") });
setUpDataset({
  ...common("dataset"), ...starting,
  onStarted(kind, job) {
    go(job.id, kind === "runs" ? "run" : "diagnosis");
    poll();
  },
});
setUpImport({
  onStored(dataset) {
    toast(stored("Stored", dataset));
    go(dataset.id, "dataset");
    poll();
  },
});
setUpFilms({ onAway: setAway, onMissing });
setUpDiagnoseForm({ onSubmitted: onDiagnosisSubmitted });
setUpCompare();
setUpSubmit({
  onSubmitted(run) {
    go(run.id);
    poll();
  },
});
$("skip").addEventListener("click", (event) => {
  event.preventDefault(); // the address must keep naming the page
  $("detail").focus();
});
$("new-run").addEventListener("click", () => newRun());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redrawAll);

// Likely mistakes are looked at before anything is started; of several datasets none is.
function onUploaded(dataset, alone) {
  if (alone && dataset.warnings?.length) go(dataset.id, "dataset");
  else if (alone) starting.onRun(dataset);
  if (current("datasets") !== null) route();
  poll();
}

async function build() {
  try {
    await buildLists();
  } catch (error) {
    toast(error.message);
    await new Promise((resolve) => { setTimeout(resolve, AGAIN_MS); });
    return build();
  }
  setUpListing({ onRun: () => newRun() });
  setUpUpload({ onUploaded });
  $("home-run").addEventListener("click", () => newRun());
}

setUpRefused(askForKey);
const built = build();
function onSignedIn() {
  route();
  poll();
}

if (await setUpAccess({ onSignedIn })) {
  await built;
  window.addEventListener("hashchange", () => {
    // A question about one page is not to be answered on another.
    for (const dialog of document.querySelectorAll("dialog[open]:not(#key-dialog)")) dialog.close();
    route();
    if (isHome()) poll();
  });
  document.addEventListener("visibilitychange", () => document.hidden || poll());
  window.addEventListener("online", poll);
  route();
  poll();
}
