// Labels of settings, and differences between runs on tracked markers and on forces.

import { forceUnit, mm, significant } from "./format.js";

export const isForces = (thing) => thing?.kind === "forces";

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

export const modelOf = (run) => (isForces(run)
  ? SHORT[run.spec.preset] ?? spoken(run.spec.preset)
  : `${run.spec.division} bodies`);

// The misfit of a run: a number and its unit.
export function misfit(run) {
  if (!isForces(run)) return { value: mm(run.best_mm), unit: "mm" };
  const best = newtons(run.best_mn);
  const { unit, show } = forceUnit([best]);
  return { value: show(best), unit };
}

export const newtons = (mn) => (mn === null || mn === undefined ? null : mn / 1e3);

// The settings of a run as a request, without those that its kind of dataset or its method does not use.
export function request(run) {
  const idle = [...(isForces(run) ? WING_ONLY : VEHICLE_ONLY), ...(IDLE[run.spec.method] ?? [])];
  return Object.fromEntries(Object.entries(run.spec).filter(([name]) => !idle.includes(name)));
}

export function setup(run) {
  const { spec } = run;
  const method = METHODS[spec.method] ?? spec.method ?? "genetic";
  const search = spec.method === "gauss_newton" ? null : `population ${spec.population}, seed ${spec.seed}`;
  const how = `${spec.mode}, ${method}${spec.finish && search ? " finished by Gauss-Newton" : ""}`;
  const coarse = spec.search_division ? `searched with division ${spec.search_division}` : null;
  return [modelOf(run), withEffects(spec), ...(isForces(run) ? forceSetup(spec) : []), how, search, coarse,
    isForces(run) ? null : `solved to ${spec.accuracy_mm} mm`].filter(Boolean);
}

// Runs of earlier versions have no effects.
export const withEffects = (spec) => (spec.effects?.length ? `with ${spec.effects.map(spoken).join(", ")}` : null);

export function forceSetup(spec) {
  const cut = spec.low_pass_hz;
  return [
    spec.without.length ? `without ${spec.without.map(spoken).join(", ")}` : null,
    `fitted to ${spec.axes.join(" and ")}`,
    cut === 0 ? "no low-pass" : `low-pass at ${cut === null ? "3.2 × flap frequency" : `${significant(cut)} Hz`}`,
  ];
}
