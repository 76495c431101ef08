// Calls of the REST API. Every failure is an ApiError with the message of the server.

const FINAL = new Set(["SUCCEEDED", "FAILED", "CANCELLED"]);

export class ApiError extends Error {
  constructor(message, { status = null, errors = [], questions = [] } = {}) {
    super(message);
    this.status = status;
    this.errors = errors;
    this.questions = questions;
  }

  // The message, followed by those about single fields.
  get text() {
    return [this.message, ...this.errors.map((item) => item.message)].join(". ");
  }

  // Whether the server could not be reached, as opposed to a refused request.
  get away() {
    return this.status === null || this.status === 502 || this.status === 503 || this.status === 504;
  }
}

// Fill ``node`` with a fragment of this page, an HTML file beside its scripts, which has nothing of a user in it.
export async function fill(node, file) {
  const answer = await fetch(file).catch(() => null);
  if (!answer?.ok) throw new ApiError("The page could not be loaded; reload it.");
  node.innerHTML = await answer.text();
}

export const isFinal = (job) => FINAL.has(job.state);

export async function call(method, path, { body, headers = {}, as = "json", signal } = {}) {
  let response;
  try {
    response = await fetch(`v1/${path}`, { method, body, headers, signal });
  } catch {
    throw new ApiError("The server does not answer. Start it with 'wingfit serve'.");
  }
  if (response.ok) return response.status === 204 ? null : response[as]();
  let problem = {};
  try {
    problem = await response.json();
  } catch { /* no problem document: the status line is shown */ }
  const message = problem.detail || problem.title || `${response.status} ${response.statusText}`;
  throw new ApiError(message, { status: response.status, errors: problem.errors || [], questions: problem.questions || [] });
}

export const get = (path) => call("GET", path);

export const getText = (path) => call("GET", path, { as: "text" });

// ``signal`` ends a request that is no longer wanted.
export const postJson = (path, value, headers = {}, signal = undefined) =>
  call("POST", path, { body: JSON.stringify(value), headers: { "Content-Type": "application/json", ...headers }, signal });

export const part = encodeURIComponent;

export async function history(id) {
  const items = [];
  for (let after = 0; ;) {
    const page = await get(`runs/${part(id)}/history?limit=1000&after=${after}`);
    items.push(...page.items);
    if (!page.items.length || page.next_cursor === null) return items;
    after = page.items.at(-1).sequence;
  }
}

// Follow the events of the job at `path`; `step` is the name of its progress events. The browser reconnects with the last event id; if it gives up, we reconnect.
export function follow(path, step, { onStep, onState, onAway }) {
  let source = null;
  let timer = null;
  let closed = false;
  const open = () => {
    source = new EventSource(`v1/${path}/events`);
    source.addEventListener(step, (event) => onStep(JSON.parse(event.data)));
    source.addEventListener("state", (event) => {
      const job = JSON.parse(event.data);
      if (isFinal(job)) close();
      onState(job);
    });
    source.onopen = () => onAway(false);
    source.onerror = () => {
      if (closed) return;
      onAway(true);
      if (source.readyState === EventSource.CLOSED) timer = setTimeout(open, 3000);
    };
  };
  const close = () => {
    closed = true;
    clearTimeout(timer);
    source.close();
  };
  open();
  return close;
}
