// Boxes to tick in the forms of runs and diagnoses.

import { el } from "./format.js";

// A labelled box; ``name`` groups boxes that are read together.
export const tick = (value, text, checked, title = "", name = "") =>
  el("label", { className: "tick", title }, el("input", { type: "checkbox", name, value, checked, defaultChecked: checked }), ` ${text}`);

// Boxes for effects, by family; those in ``chosen`` are ticked.
export function effectFamilies(effects, chosen = [], name = "") {
  const families = [...new Set(effects.map((effect) => effect.family))];
  return families.map((family) => el("div", { className: "family" }, el("p", { className: "quiet" }, family),
    ...effects.filter((effect) => effect.family === family)
      .map((effect) => tick(effect.name, effect.title, chosen.includes(effect.name), effect.signature, name))));
}
