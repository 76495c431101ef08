// Who is calling: where the server asks for a key, it is given here once and kept in a cookie that no script can read.

import { call, get, postJson } from "../base/api.js";
import { askKeyInCurl } from "../base/copying.js";
import { $ } from "../base/format.js";
import { showErrors } from "../base/form_errors.js";

export const isRefused = (error) => error.status === 401;

export function askForKey() {
  if (!$("key-dialog").open) $("key-dialog").showModal();
}

// Whether anything can be asked of the server; where not, a key is asked for, with which the page begins again.
export async function setUpAccess() {
  const form = $("key-form");
  $("key-dialog").addEventListener("cancel", (event) => event.preventDefault()); // without a key there is nothing behind it
  $("sign-out").addEventListener("click", async () => {
    await call("DELETE", "session");
    location.reload();
  });
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    showErrors(form, $("key-errors"), null);
    try {
      await postJson("session", { key: form.key.value.trim() });
      location.reload();
    } catch (error) {
      showErrors(form, $("key-errors"), error);
    }
  });
  try {
    const session = await get("session");
    askKeyInCurl(session.keys_required);
    $("sign-out").hidden = session.owner === null;
    $("owner").textContent = session.owner ?? "";
    if (!session.keys_required || session.owner !== null) return true;
    askForKey();
    return false;
  } catch (error) {
    if (!error.away) throw error;
    return true; // the page says elsewhere that the server is away
  }
}
