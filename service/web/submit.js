// Starting a run and uploading a dataset; the server checks, and its words are shown where they belong.

import { ApiError, call, part, postJson } from "./api.js";
import { $, copy, curl, el, size, toast } from "./format.js";

const NUMBERS = ["population", "seed", "accuracy_mm"];

export function setUpSubmit({ onSubmitted, onUploaded }) {
  const form = $("submit-form");
  let sent = null;
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const button = form.querySelector("[type=submit]");
    if (button.disabled) return;
    const body = values(form);
    // The same input sent twice is one run: a new key only when something was changed.
    const text = JSON.stringify(body);
    if (sent?.text !== text) sent = { text, key: randomKey() };
    showErrors(form, null);
    button.disabled = true;
    try {
      const run = await postJson("runs", body, { "Idempotency-Key": sent.key });
      sent = null;
      $("submit-dialog").close();
      onSubmitted(run);
    } catch (error) {
      showErrors(form, error);
    } finally {
      button.disabled = false;
    }
  });
  $("submit-close").addEventListener("click", () => $("submit-dialog").close());
  $("submit-curl").addEventListener("click", () => copy(curl("runs", values(form))));
  $("pick-file").addEventListener("click", () => $("file").click());
  $("file").addEventListener("change", () => upload($("file").files[0], onUploaded));
}

export function openSubmit(datasets, datasetId) {
  if (!datasets.length) {
    toast("Upload a dataset first");
    return;
  }
  const form = $("submit-form");
  form.dataset_id.replaceChildren(...datasets.map((dataset) => new Option(dataset.name, dataset.id)));
  form.dataset_id.value = datasetId ?? datasets[0].id;
  showErrors(form, null);
  $("submit-dialog").showModal();
}

// crypto.randomUUID exists only in secure contexts, and a page on a private network is none.
const randomKey = () => [...crypto.getRandomValues(new Uint8Array(16))].map((b) => b.toString(16).padStart(2, "0")).join("");

function values(form) {
  const body = { dataset_id: form.dataset_id.value, division: form.division.value, mode: form.mode.value };
  // What is not a number goes to the server as it was typed: it knows what to say about it.
  for (const name of NUMBERS) if (form[name].value !== "") body[name] = Number(form[name].value);
  const name = form.elements.namedItem("name").value.trim();
  return name ? { ...body, name } : body;
}

function showErrors(form, error) {
  const box = $("submit-errors");
  box.hidden = !error;
  for (const field of form.elements) field.removeAttribute("aria-invalid");
  if (!error) return;
  const items = (error.errors ?? []).map((item) => {
    const field = item.where.split(".").at(-1);
    form.elements.namedItem(field)?.setAttribute?.("aria-invalid", "true");
    return el("li", {}, `${field}: ${item.message}${item.value === null ? "" : ` (it is ${JSON.stringify(item.value)})`}`);
  });
  box.replaceChildren(el("p", {}, error.message), ...(items.length ? [el("ul", {}, ...items)] : []));
}

async function upload(file, onUploaded) {
  if (!file) return;
  const state = $("upload-state");
  state.className = "quiet";
  state.textContent = `Uploading ${file.name}, ${size(file.size)}`;
  $("pick-file").disabled = true;
  try {
    const dataset = await send(file, (fraction) => {
      state.textContent = fraction < 1 ? `Uploading ${file.name}, ${Math.round(100 * fraction)} %` : `Checking ${file.name}`;
    });
    state.textContent = "";
    toast(`Uploaded ${dataset.name}`);
    onUploaded(dataset);
  } catch (error) {
    state.className = "error";
    state.replaceChildren(el("p", {}, error.message),
      ...error.errors.map((item) => el("p", {}, `${item.where}: ${item.message}`)));
  } finally {
    $("file").value = "";
    $("pick-file").disabled = false;
  }
}

// XMLHttpRequest, because fetch does not say how much has been sent.
function send(file, onFraction) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    const form = new FormData();
    form.append("file", file);
    request.open("POST", "v1/datasets");
    request.setRequestHeader("Idempotency-Key", randomKey());
    request.responseType = "json";
    request.upload.onprogress = (event) => event.lengthComputable && onFraction(event.loaded / event.total);
    request.onload = () => {
      const answer = request.response ?? {};
      if (request.status < 300) resolve(answer);
      else reject(new ApiError(answer.detail || `${request.status} ${request.statusText}`, { status: request.status, errors: answer.errors ?? [] }));
    };
    request.onerror = () => reject(new ApiError("The server does not answer, or refused the file because of its size."));
    request.send(form);
  });
}

export async function remove(kind, id, name) {
  if (!window.confirm(`Delete ${name}? This cannot be undone.`)) return false;
  try {
    await call("DELETE", `${kind}/${part(id)}`);
    return true;
  } catch (error) {
    toast(error.message);
    return false;
  }
}
