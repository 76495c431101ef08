// Sign-in: the key is entered once and stored in a cookie that scripts cannot read.

import { call, get, postJson } from "../base/api.js";
import { useKeyInCurl } from "../base/copying.js";
import { $, toast } from "../base/format.js";
import { showErrors } from "../base/form_errors.js";

export const isRefused = (error) => error.status === 401;

export function askForKey() {
  if (!$("key-dialog").open) $("key-dialog").showModal();
}

// Return whether the server accepts requests; if it requires a key, show the sign-in form, which reloads the page.
// ``onSignedIn``: the user of the page has entered a key again, after the first one expired or was revoked.
export async function setUpAccess({ onSignedIn }) {
  const form = $("key-form");
  $("key-dialog").addEventListener("cancel", (event) => event.preventDefault()); // the page shows nothing without a key
  $("sign-out").addEventListener("click", () => call("DELETE", "session").then(() => location.reload(), (error) => toast(error.message)));
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    showErrors(form, $("key-errors"), null);
    try {
      const { owner } = await postJson("session", { key: form.key.value.trim() });
      if (!owner || owner !== $("owner").textContent) return location.reload();
      form.key.value = "";
      $("key-dialog").close(); // the same user goes on, with what is on the page
      onSignedIn();
    } catch (error) {
      showErrors(form, $("key-errors"), error);
    }
  });
  try {
    const session = await get("session");
    useKeyInCurl(session.keys_required);
    $("sign-out").hidden = session.owner === null;
    $("owner").textContent = session.owner ?? "";
    if (!session.keys_required || session.owner !== null) return true;
    askForKey();
    return false;
  } catch (error) {
    return true; // polling reports what is wrong
  }
}
