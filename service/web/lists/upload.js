// Datasets are uploaded: files that are dropped or chosen, and folders, which become zip archives here.

import { get } from "../base/api.js";
import { $, el, size, toast } from "../base/format.js";
import { zip } from "../importing/zip.js";
import { send } from "../pages/submit.js";
import { stored } from "../parts/warnings.js";

const DESCRIPTION = "dataset.yaml";
const OF_DATASET = /\.(ya?ml|csv)$/i;
const OF_TRACKS = /\.(csv|tsv|txt|c3d|trc|h5|hdf5|slp)$/i; // read by the page Import, and never a dataset

class TracksError extends Error {
  constructor() {
    super("a file of one recording, not a dataset.");
  }
}

let queue = []; // {name, file or files, item}
let sending = false;
let hooks = {};

export function setUpUpload(given) {
  hooks = given;
  const drop = $("upload");
  for (const [button, input] of [["pick-file", "file"], ["pick-folder", "folder"]]) $(button).addEventListener("click", () => $(input).click());
  $("file").addEventListener("change", () => {
    add([...$("file").files].map((file) => ({ name: file.name, file })));
    $("file").value = ""; // so that the same file, changed, can be chosen again
  });
  $("folder").addEventListener("change", () => {
    const files = [...$("folder").files].map((file) => ({ path: file.webkitRelativePath, file }));
    $("folder").value = "";
    if (files.length) add([{ name: files[0].path.split("/")[0], files }]);
  });
  const over = (on) => (event) => {
    event.preventDefault();
    drop.classList.toggle("over", on);
  };
  for (const [name, on] of [["dragenter", true], ["dragover", true], ["dragleave", false]]) drop.addEventListener(name, over(on));
  drop.addEventListener("drop", async (event) => {
    over(false)(event);
    // The items are only there during the event.
    const dropped = [...event.dataTransfer.items].map((item) => ({ entry: item.webkitGetAsEntry?.(), file: item.getAsFile() }));
    add(await Promise.all(dropped.filter((one) => one.entry || one.file).map(async ({ entry, file }) => (entry?.isDirectory
      ? { name: entry.name, files: await filesIn(entry).catch(() => null) } : { name: file.name, file }))));
  });
  // A file dropped beside a box would be opened by the browser, in place of the page.
  for (const name of ["dragover", "drop"]) window.addEventListener(name, (event) => {
    if (event.defaultPrevented || !event.dataTransfer?.types.includes("Files")) return;
    event.preventDefault();
    event.dataTransfer.dropEffect = "none";
    if (name === "drop") toast("Drop files into the box with the dashed line");
  });
  window.addEventListener("beforeunload", (event) => { if (sending) event.preventDefault(); });
}

// All files of a dropped folder: {path, file}.
async function filesIn(entry) {
  if (entry.isFile) return [{ path: entry.fullPath, file: await new Promise((resolve, reject) => { entry.file(resolve, reject); }) }];
  const reader = entry.createReader();
  const found = [];
  for (;;) { // the reader returns a part of the entries at a time
    const some = await new Promise((resolve, reject) => { reader.readEntries(resolve, reject); });
    if (!some.length) return found;
    for (const one of some) found.push(...await filesIn(one));
  }
}

function add(sources) {
  const fresh = sources.map((source) => ({ ...source, item: el("div"), alone: sources.length === 1 }));
  for (const one of fresh) show(one, `${one.name} waits`);
  $("upload-state").append(...fresh.map((one) => one.item));
  queue.push(...fresh);
  if (!sending) next();
}

function show(one, text, fraction = null) {
  const bar = fraction === null ? null : el("div", { className: "bar" }, el("span"));
  if (bar) bar.firstElementChild.style.width = `${100 * fraction}%`;
  one.item.className = "quiet";
  one.item.replaceChildren(el("span", {}, text), ...(bar ? [bar] : []));
}

// What to do with a file of one recording.
const remedies = () => [" Of marker tracks: ", el("a", { href: "#import" }, "import it"), ". Of forces of a balance: ", el("code", {}, "wingfit import-forces"),
  ". A recording in the form of wingfit: choose the folder with its dataset.yaml."];

// An error stays until it is dismissed.
function refuse(one, error) {
  one.item.className = "error";
  one.item.setAttribute("role", "alert");
  const errors = error.errors ?? [];
  one.item.replaceChildren(el("span", {}, el("strong", {}, one.name), `: ${error.message}`, ...(error instanceof TracksError ? remedies() : [])),
    el("button", { type: "button", ariaLabel: `Dismiss the message about ${one.name}`, onclick: () => {
      one.item.remove();
      $("pick-file").focus();
    } }, "Dismiss"),
    ...(errors.length ? [el("ul", {}, ...errors.map((item) => el("li", {}, el("strong", {}, item.where), `: ${item.message}${item.value === null ? "" : ` (it is ${JSON.stringify(item.value)})`}`)))] : []));
}

async function next() {
  const one = queue.shift();
  sending = Boolean(one);
  if (!one) return;
  try {
    show(one, `Reading ${one.name}`);
    if (one.file && OF_TRACKS.test(one.name)) throw new TracksError();
    const file = one.file ?? await archive(one);
    const dataset = await send(file, (fraction) => show(one, fraction < 1 ? `Uploading ${one.name}, ${size(file.size)}, ${Math.round(100 * fraction)} %` : `Checking ${one.name}`, fraction));
    const twin = await same(dataset);
    toast(`${stored("Uploaded", dataset)}${twin ? `. The same file is stored already, as ${twin.name}` : ""}`);
    if (one.alone) one.item.remove();
    else one.item.replaceChildren(el("span", {}, `${one.name}: `, el("a", { href: `#dataset=${encodeURIComponent(dataset.id)}` }, stored("stored as", dataset))));
    hooks.onUploaded(dataset, one.alone);
  } catch (error) {
    refuse(one, error);
  }
  next();
}

// An earlier dataset of the same bytes, if it has kept its name.
async function same({ id, name, sha256 }) {
  const text = name.replace(/, \d+$/, "");
  const found = await get(`datasets?limit=100&q=${encodeURIComponent(text)}`).catch(() => ({ items: [] }));
  return found.items.find((one) => one.sha256 === sha256 && one.id !== id);
}

// A zip archive of a folder that has dataset.yaml, perhaps in a folder of its own.
async function archive({ name, files }) {
  if (!files) throw new Error("the folder cannot be read; check its permissions, or choose it again");
  const parts = ({ path }) => path.split("/").filter(Boolean);
  const [root] = files.filter((one) => parts(one).at(-1) === DESCRIPTION).map((one) => parts(one).slice(0, -1)).sort((a, b) => a.length - b.length);
  if (!root) throw new Error(`the folder has no ${DESCRIPTION}; choose the folder in which it lies, or import the files of a tracking system`);
  const inside = files.filter((one) => root.every((folder, k) => parts(one)[k] === folder) && OF_DATASET.test(one.path) && !parts(one).some((folder) => folder.startsWith(".")));
  const texts = await Promise.all(inside.map(async (one) => [parts(one).slice(root.length).join("/"), await one.file.text()]));
  return new File([await zip(Object.fromEntries(texts))], `${name}.zip`, { type: "application/zip" });
}
