// Correlations of estimates: tables whose shades show the strength, and sentences that name the strong ones.

import { correlation, el, plural } from "./format.js";

export const STRONG = 0.9;

// Head and rows of ``table``: the correlations ``values`` [F][F] of ``names``; a table can be read by a screen reader.
export function fillCorrelations(table, names, values) {
  table.tHead.replaceChildren(el("tr", {}, el("td"), ...names.map((name) => el("th", { scope: "col" }, name))));
  table.tBodies[0].replaceChildren(...values.map((row, i) => el("tr", {}, el("th", { scope: "row" }, names[i]), ...row.map(shaded))));
}

// The pairs correlated beyond STRONG, strongest first.
export const strongPairs = (names, values) => names.flatMap((name, i) => names.slice(i + 1).map((other, j) => ({ name, other, value: values[i][i + 1 + j] })))
  .filter((pair) => Math.abs(pair.value) > STRONG).sort((a, b) => Math.abs(b.value) - Math.abs(a.value));

function shaded(value) {
  const cell = el("td", {}, correlation(value));
  if (value !== null) {
    const colour = value < 0 ? "var(--series-2)" : "var(--accent)";
    cell.style.background = `color-mix(in srgb, ${colour} ${Math.round(45 * Math.abs(value))}%, transparent)`;
  }
  return cell;
}

// Fill ``node`` with the ``found`` correlations of the genes of a run, one table for each group estimated together.
export function showGeneCorrelations(node, found) {
  const groups = (found ?? []).filter(({ genes }) => genes.length > 1);
  node.hidden = !groups.length;
  node.replaceChildren(...groups.map(({ genes, values }, k) => {
    const strong = strongPairs(genes, values);
    const of = groups.length > 1 ? ` of ${plural(genes.length, "gene")} estimated together` : "";
    const words = strong.length ? `${plural(strong.length, "pair")} beyond ${STRONG}: ${strong.slice(0, 3).map((pair) => `${pair.name} and ${pair.other}`).join(", ")}${strong.length > 3 ? ", …" : ""}`
      : `none beyond ${STRONG}`;
    const table = el("table", { className: "heat" }, el("thead"), el("tbody"));
    fillCorrelations(table, genes, values);
    const label = `Correlations${of}, group ${k + 1}`;
    return el("details", { className: "more" }, el("summary", {}, `Correlations${of}: ${words}`),
      el("p", { className: "quiet" }, "The recordings determine a combination of two strongly correlated genes better than each of them. A dash: the error of the gene is not known."),
      el("div", { className: "scroll", tabIndex: 0, role: "group", ariaLabel: label }, table));
  }));
}
