// A request as text to paste: a curl command, or a Python program.

import { $, toast } from "./format.js";

const quote = (text) => `'${text.replaceAll("'", "'\\''")}'`;

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
  const server = new URL(".", document.baseURI).href.replace(/\/$/, "");
  return [
    "from wingfit import Client", "",
    `with Client(${literal(server)}) as client:`,
    "    run = client.submit_run(",
    `        ${literal(dataset)},`,
    ...Object.entries(spec).map(([name, value]) => `        ${name}=${literal(value)},`),
    "    )",
    '    print(client.wait(run["id"])["state"])', "",
  ].join("\n");
}

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
