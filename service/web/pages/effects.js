// The library of effects (#effects, #effects=NAME): signatures, genes, sources.

import { get } from "../base/api.js";
import { $, el, significant, toast } from "../base/format.js";
import { capital, spoken } from "../base/labels.js";

const PARTS = { span: "spans", chord: "mean chords", mass: "masses of the wing" };

let effects = null;

export async function showEffects(name) {
  $("effects-page").hidden = name === null;
  if (name === null) return;
  document.title = "Effects · wingfit";
  try {
    if (!effects) {
      effects = (await get("effects")).effects;
      draw();
    }
  } catch (error) {
    toast(error.message);
    return;
  }
  const wanted = name && document.getElementById(`effect-${name}`);
  if (name && !wanted) toast(`There is no effect ${name}`);
  if (!wanted) return;
  wanted.open = true;
  wanted.scrollIntoView({ block: "start" });
}

function draw() {
  const families = [...new Set(effects.map((effect) => effect.family))];
  const titles = new Map(effects.map((effect) => [effect.name, effect.title]));
  $("effects-list").replaceChildren(...families.map((family) => el("section", { ariaLabel: capital(family) },
    el("h3", {}, capital(family)), ...effects.filter((effect) => effect.family === family).map((effect) => card(effect, titles)))));
}

function card(effect, titles) {
  const fact = (term, ...value) => [el("dt", {}, term), el("dd", {}, ...value)];
  const links = effect.confused_with.flatMap((name, i) => [i ? ", " : "", el("a", { href: `#effects=${name}` }, titles.get(name) ?? spoken(name))]);
  const node = el("details", { className: "effect" },
    el("summary", {}, el("strong", {}, effect.title), " ", el("span", { className: "quiet" }, effect.applies_to.map((rig) => `${rig}s`).join(" and "))),
    el("dl", { className: "facts" }, ...fact("Signature", capital(effect.signature)), ...fact("Source", effect.source),
      ...fact("Acts on", `${effect.port}; ${{ any: "its power may have either sign", conservative: "conserves energy", dissipative: "dissipates energy" }[effect.power]}`),
      ...(effect.memory ? fact("Memory", effect.memory) : []), ...(links.length ? fact("Confused with", ...links) : []), ...fact("Name in requests", el("code", {}, effect.name))),
    el("div", { className: "scroll", tabIndex: 0, role: "group", ariaLabel: `Genes of ${effect.title}` }, genes(effect)));
  node.id = `effect-${effect.name}`;
  return node;
}

function genes(effect) {
  const unit = ({ relative_to: of, unit: plain }) => (of ? PARTS[of] : plain === "1" ? "" : plain);
  const number = (value) => el("td", { className: "n" }, significant(value));
  return el("table", {}, el("thead", {}, el("tr", {}, ...["Gene", "Lowest", "Typical", "Highest", "Unit", "Meaning"].map((head, i) =>
    el("th", { scope: "col", className: i > 0 && i < 4 ? "n" : "" }, head)))),
  el("tbody", {}, ...effect.parameters.map((one) => el("tr", {}, el("td", {}, el("code", {}, one.name)), number(one.lower), number(one.typical),
    number(one.upper), el("td", {}, unit(one)), el("td", { className: "prose" }, one.description)))));
}
