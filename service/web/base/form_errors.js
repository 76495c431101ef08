// Errors of a form, shown at the fields that they name; and remarks on a result.

import { el } from "./format.js";

// "body.axes.0" names the field axes.
const fieldOf = (where) => where.split(".").filter((name) => !/^\d+$/.test(name)).at(-1);

export function showErrors(form, box, error) {
  box.hidden = !error;
  for (const field of form.elements) field.removeAttribute("aria-invalid");
  if (!error) return box.replaceChildren();
  const items = (error.errors ?? []).map((item) => {
    const field = fieldOf(item.where);
    form.elements.namedItem(field)?.setAttribute?.("aria-invalid", "true");
    const about = field === "body" ? "" : `${field}: `; // errors of the whole request name no field
    return el("li", {}, `${about}${item.message}${item.value === null ? "" : ` (it is ${JSON.stringify(item.value)})`}`);
  });
  box.replaceChildren(el("p", {}, error.message), ...(items.length ? [el("ul", {}, ...items)] : []));
}

const SHOWN = 3; // remarks; the others unfold

// A remark that begins with one of ``names``, those of genes, keeps its first letter.
export function showRemarks(list, remarks, names = []) {
  list.hidden = !remarks.length;
  const first = (remark) => (names.includes(remark.match(/^[^ ,:]*/)[0]) ? remark[0] : remark[0].toUpperCase());
  const items = remarks.map((remark) => el("li", {}, `${first(remark)}${remark.slice(1)}.`));
  const rest = items.splice(SHOWN);
  if (rest.length) items.push(el("li", {}, el("details", {}, el("summary", {}, `${rest.length} more`), el("ul", {}, ...rest))));
  list.replaceChildren(...items);
}
