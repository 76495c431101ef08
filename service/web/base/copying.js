// A request as text to paste: a curl command, a command of wingfit, or a Python program.

import { $, el, toast } from "./format.js";

const quote = (text) => `'${text.replaceAll("'", "'\\''")}'`;

const DEFAULT_HOST = "127.0.0.1:8321"; // of the command line, over http

const server = () => new URL(".", document.baseURI).href.replace(/\/$/, "");

let keyInCurl = "";
export const useKeyInCurl = (required) => { keyInCurl = required ? ' -H "Authorization: Bearer $WINGFIT_API_KEY"' : ""; };

export function curl(path, body) {
  const url = new URL(`v1/${path}`, document.baseURI).href;
  return `curl -X POST ${quote(url)}${keyInCurl} -H 'Content-Type: application/json' -d ${quote(JSON.stringify(body))}`;
}

// A JSON value as a Python literal.
function literal(value) {
  if (value === null) return "None";
  if (typeof value === "boolean") return value ? "True" : "False";
  if (Array.isArray(value)) return `[${value.map(literal).join(", ")}]`;
  if (typeof value === "object") return `{${Object.entries(value).map(([name, one]) => `${JSON.stringify(name)}: ${literal(one)}`).join(", ")}}`;
  return JSON.stringify(value);
}

// The client takes the API key from the environment, as the command line does.
export function python({ dataset_id: dataset, ...spec }) {
  return [
    "from wingfit import Client", "",
    `with Client(${literal(server())}) as client:`,
    "    run = client.submit_run(",
    `        ${literal(dataset)},`,
    ...Object.entries(spec).map(([name, value]) => `        ${name}=${literal(value)},`),
    "    )",
    '    print(client.wait(run["id"])["state"])', "",
  ].join("\n");
}

// A program that diagnoses a dataset of series, and simulates the rig for it.
export const pythonWithRig = (dataset) => [
  "import wingfit", "from my_rig import rig", "",
  `with wingfit.Client(${literal(server())}) as client:`,
  `    job = client.submit_diagnosis(${literal(dataset)}, rig=wingfit.declaration(rig))  # or submit_run`,
  '    print(wingfit.drive(client, job["id"], rig)["state"])', "",
].join("\n");

// ``text``, a command of wingfit, with the address of this server if it is not the usual one.
export function command(text) {
  const url = server();
  const { protocol, host, pathname } = new URL(url);
  if (protocol === "http:" && host === DEFAULT_HOST && pathname === "/") return text;
  return `${text} --url ${/^[\w:/.-]+$/.test(url) ? url : quote(url)}`;
}

// An element that shows ``text`` with a button that copies it; ``label`` says what it is.
export const copyable = (text, label) => el("div", { className: "copyable" },
  el("pre", { tabIndex: 0, role: "group", ariaLabel: label }, el("code", {}, text)),
  el("button", { type: "button", ariaLabel: `Copy: ${label}`, onclick: () => copy(text) }, "Copy"));

export async function copy(text) {
  try {
    await navigator.clipboard.writeText(text);
    toast("Copied");
  } catch {
    // Pages on a private network without TLS may not write to the clipboard.
    $("copy-text").value = text;
    $("copy-dialog").showModal();
    $("copy-text").select();
  }
}
