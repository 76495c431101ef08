// The name and the notes of a dataset, run or diagnosis: shown on its page, changed in a dialog.

import { ApiError, call, get, part } from "../base/api.js";
import { showErrors } from "../base/form_errors.js";
import { el } from "../base/format.js";

const differ = (one, other) => one.name !== other.name || one.notes !== other.notes;

// Let the user change ``item`` of ``kind`` ("runs", "diagnoses", "datasets"); a promise of the changed item, or of null.
export function edit(kind, item) {
  const errors = el("div", { className: "error", role: "alert", hidden: true });
  const form = el("form", { noValidate: true },
    el("h2", { id: "edit-title" }, "Name and notes"),
    el("label", {}, "Name ", el("input", { name: "name", type: "text", maxLength: 200, value: item.name, autocomplete: "off" })),
    el("label", {}, "Notes ", el("textarea", { name: "notes", rows: 5, maxLength: 10000, value: item.notes })),
    errors,
    el("div", { className: "actions" }, el("button", { type: "submit", className: "primary" }, "Save"),
      el("button", { type: "button", onclick: () => dialog.close() }, "Back")));
  const dialog = el("dialog", { id: "edit-dialog" }, form);
  dialog.setAttribute("aria-labelledby", "edit-title");
  document.body.append(dialog);
  dialog.showModal();
  let changed = null;
  let before = item;
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const field = (name) => form.elements.namedItem(name).value;
    const body = { name: field("name").trim(), notes: field("notes").trim() };
    try {
      const now = await get(`${kind}/${part(item.id)}`);
      if (differ(now, before) && differ(now, body)) {
        before = now;
        throw new ApiError(`Changed meanwhile, in another window or by another user: the name is “${now.name}”${now.notes ? `, the notes are “${now.notes}”` : ", without notes"}. Save again to replace this.`);
      }
      changed = await call("PATCH", `${kind}/${part(item.id)}`, { body: JSON.stringify(body), headers: { "Content-Type": "application/json" } });
      dialog.close();
    } catch (error) {
      showErrors(form, errors, error);
    }
  });
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(changed);
    });
  });
}

// Show the notes of ``item`` below the ``heading`` of its page, with a button that changes name and notes.
export function showNotes(heading, kind, item, onChanged) {
  const head = heading.parentElement;
  const old = head.querySelector(".notes");
  const mark = JSON.stringify([item.id, item.name, item.notes]);
  if (old?.dataset.mark === mark) return; // the button keeps its focus
  const button = el("button", { type: "button", className: "edit", onclick: async () => {
    const changed = await edit(kind, item);
    if (changed) onChanged(changed);
  } }, "Edit name and notes");
  const box = el("div", { className: "notes" }, item.notes ? el("p", {}, item.notes) : null, button);
  box.dataset.mark = mark;
  const focused = old?.contains(document.activeElement);
  if (old) old.replaceWith(box);
  else head.append(box);
  if (focused) button.focus();
}
