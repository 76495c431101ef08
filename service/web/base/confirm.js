// The question before something is deleted or cancelled.

import { el } from "./format.js";

// Ask ``title``, explained by ``text``; ``action`` names the button that confirms. A promise of true or false.
export function confirmed(title, text, action) {
  const dialog = el("dialog", { id: "confirm-dialog" },
    el("form", { method: "dialog" }, el("h2", { id: "confirm-title" }, title), el("p", {}, text),
      el("div", { className: "actions" },
        el("button", { type: "submit", value: "no", id: "confirm-no", autofocus: true }, "Back"),
        el("button", { type: "submit", value: "yes", id: "confirm-yes", className: "primary" }, action))));
  dialog.setAttribute("aria-labelledby", "confirm-title");
  document.body.append(dialog);
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    });
  });
}
