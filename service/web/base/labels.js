// Labels of settings, and differences between runs on tracked markers, on forces, and on series of a rig of the user's own.

import { el, forceUnit, mm, rounded, significant } from "./format.js";

export const isForces = (thing) => thing?.kind === "forces";
export const isSeries = (thing) => thing?.kind === "series";

export const OF_RANGE = "% of range";

// What the recordings of a dataset hold.
export const contents = (dataset) => ({ tracks: "markers", forces: "forces", series: `rig ${dataset.rig?.name}` })[dataset.kind];

export const METHODS = { genetic: "genetic", cma_es: "CMA-ES", gauss_newton: "Gauss-Newton", auto: "auto" };
export const MODES = {
  staged: "staged, vacuum first", joint: "joint, all recordings together", local: "local, each recording by itself",
};
export const PRESETS = { proposed: "Proposed, with clap-and-peel", berman_wang: "Berman and Wang", dickinson: "Dickinson" };
const SHORT = { proposed: "proposed model", berman_wang: "Berman-Wang model", dickinson: "Dickinson model" };

// In the order of the tables; "left out": the global model fitted without the recording.
export const SOURCES = {
  local: "Local", joint: "Joint", global: "Global", leave_one_out: "Left out", average: "Average", nominal: "Nominal",
};
export const QUANTITIES = { lift: "Lift", drag: "Drag", x: "Force along x", z: "Force along z" };

const WING_ONLY = ["division", "search_division", "bounds_factor", "accuracy_mm"];
const VEHICLE_ONLY = ["preset", "without", "axes", "low_pass_hz", "peel_width_beats"];
// By method, settings that it does not use.
const IDLE = { gauss_newton: ["population", "stall", "tolerance", "seed", "finish"], auto: ["finish"] };

export const spoken = (name) => name.replaceAll("_", " ");

export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

// Options of a choice of recordings.
export const recordingOptions = ({ recordings }) =>
  recordings.map(({ name, held_out: heldOut }) => new Option(`${name}${heldOut ? " (held out)" : ""}`, name));

export function modelOf(run) {
  if (isSeries(run)) return run.rig;
  return isForces(run) ? SHORT[run.spec.preset] ?? spoken(run.spec.preset) : `${run.spec.division} bodies`;
}

// How the model of a job fits: "good 1.1×", with the larger one of its misfits as multiples of the noise; null if not known.
export function fitBadge(job) {
  const { fit_badge: fit = null, residual_over_noise: fitted = null, held_out_over_noise: heldOut = null } = job;
  if (fit === null) return null;
  const worst = Math.max(fitted ?? 0, heldOut ?? 0);
  const title = `Residual ${rounded(fitted, 2)} times the noise${heldOut === null ? "" : `, held out ${rounded(heldOut, 2)} times`}`;
  return el("span", { className: `badge fit-${fit}`, title }, `${fit} ${rounded(worst, 2)}×`);
}

export const modelInWords = (job) => (isSeries(job) ? `rig ${job.rig}` : modelOf(job));

// The misfit of a run: a number and its unit.
export function misfit(run) {
  if (isSeries(run)) return { value: rounded(run.best_percent), unit: OF_RANGE };
  if (!isForces(run)) return { value: mm(run.best_mm), unit: "mm" };
  const best = newtons(run.best_mn);
  const { unit, show } = forceUnit([best]);
  return { value: show(best), unit };
}

// A misfit of the result of a run on series, relative to what the result says.
export const relativeMisfit = ({ relative_to: relativeTo }, value) => (relativeTo === "noise"
  ? { value: rounded(value), unit: "× noise" }
  : { value: rounded(value === null ? null : 100 * value), unit: OF_RANGE });

const ADEQUATE = 1.3; // times the noise, as on the server (calibration/result.py)

// What the fit of a finished job means, in a sentence.
export function fitSentence(job) {
  if (!job.fit_badge) return "The noise of the recordings is not known, so the residual cannot be judged: record at least two beats, or state the noise.";
  const [fitted, held] = [job.residual_over_noise, job.held_out_over_noise];
  const both = `The residual is ${rounded(fitted, 2)} times the noise on the fitted recordings`
    + (held === null ? "; none was held out, so no prediction is tested." : `, and ${rounded(held, 2)} times on those held out.`);
  if (job.fit_badge === "good") return `${both} Noise explains it.`;
  if (held !== null && fitted <= ADEQUATE) return `${both} The model fits, and does not predict: physics is missing, or the genes absorbed noise.`;
  return `${both} ${job.fit_badge === "doubtful" ? "Physics may be missing" : "Physics is missing, or the input is wrong"}: diagnose it.`;
}

export const newtons = (mn) => (mn === null || mn === undefined ? null : mn / 1e3);

const FOREIGN = { tracks: VEHICLE_ONLY, forces: WING_ONLY, series: [...WING_ONLY, ...VEHICLE_ONLY] };

// The settings of a run as a request, without those that its kind of dataset or its method does not use.
export function request(run) {
  const idle = [...FOREIGN[run.kind], ...(IDLE[run.spec.method] ?? [])];
  const settings = Object.entries(run.spec).filter(([name]) => !idle.includes(name));
  return { ...(isSeries(run) ? { rig: run.rig } : {}), ...Object.fromEntries(settings) };
}

export function setup(run) {
  const { spec } = run;
  const method = METHODS[spec.method] ?? spec.method ?? "genetic";
  const search = spec.method === "gauss_newton" ? null : `population ${spec.population}, seed ${spec.seed}`;
  const how = `${spec.mode}, ${method}${spec.finish && search ? " finished by Gauss-Newton" : ""}`;
  const wing = run.kind === "tracks"
    ? [spec.search_division ? `searched with division ${spec.search_division}` : null, `solved to ${spec.accuracy_mm} mm`] : [];
  return [modelInWords(run), withEffects(run), ...(isForces(run) ? forceSetup(spec) : []), how, search, ...wing].filter(Boolean);
}

// Runs of earlier versions have no effects. Those of series are named by the user's own rig.
export function withEffects(job) {
  const { effects } = job.spec;
  return effects?.length ? `with ${(isSeries(job) ? effects : effects.map(spoken)).join(", ")}` : null;
}

export function forceSetup(spec) {
  const cut = spec.low_pass_hz;
  return [
    spec.without.length ? `without ${spec.without.map(spoken).join(", ")}` : null,
    spec.axes.length ? `fitted to ${spec.axes.join(" and ")}` : null,
    cut === 0 ? "no low-pass" : `low-pass at ${cut === null ? "3.2 × flap frequency" : `${significant(cut)} Hz`}`,
  ].filter(Boolean);
}
