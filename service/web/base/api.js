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

let onRefused = () => {};

// ``then`` is called when the server refuses a request for want of a valid key.
export function setUpRefused(then) {
  onRefused = then;
}

export const refused = (status) => status === 401 && onRefused();

// Fill ``node`` with a fragment of this page, an HTML file beside its scripts, which has nothing of a user in it.
export async function fill(node, file) {
  const answer = await fetch(file).catch(() => { throw unreachable(); });
  if (!answer.ok) throw new ApiError("The page could not be loaded; reload it.", { status: answer.status });
  node.innerHTML = await answer.text();
}

let missed = false;

// Whether a page could not fetch what it shows since the last call, because the server did not answer.
export function takeMissed() {
  const before = missed;
  missed = false;
  return before;
}

const unreachable = () => new ApiError(navigator.onLine ? "The server does not answer. If it is yours, start it with 'wingfit serve'."
  : "This device has no network connection; try again when it is back.");

export const isFinal = (job) => FINAL.has(job.state);

// ``polled``: the page asks again by itself.
export async function call(method, path, { body, headers = {}, as = "json", polled = false, signal } = {}) {
  let response;
  try {
    response = await fetch(`v1/${path}`, { method, body, headers, signal });
  } catch {
    missed ||= method === "GET" && !polled;
    throw unreachable();
  }
  if (response.ok) return response.status === 204 ? null : response[as]();
  let problem = {};
  try {
    problem = await response.json();
  } catch { /* no problem document: the status line is shown */ }
  if (path !== "session") refused(response.status); // that of the form itself
  const message = problem.detail || problem.title || `${response.status} ${response.statusText}`;
  throw new ApiError(message, { status: response.status, errors: problem.errors || [], questions: problem.questions || [] });
}

export const get = (path) => call("GET", path);

export const poll = (path) => call("GET", path, { polled: true });

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
// Browsers allow six connections to a server: a tab that is not seen gives its own up, so that the others go on.
export function follow(path, step, { onStep, onState, onAway }) {
  let source = null;
  let timer = null;
  let closed = false;
  const open = () => {
    clearTimeout(timer);
    source?.close();
    if (closed || document.hidden) return;
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
      if (source.readyState !== EventSource.CLOSED) return onAway(true);
      timer = setTimeout(open, 3000); // refused: polling says why
    };
  };
  const seen = () => {
    if (document.hidden) source?.close();
    else if (!source || source.readyState === EventSource.CLOSED) open();
  };
  const close = () => {
    closed = true;
    clearTimeout(timer);
    source?.close();
    document.removeEventListener("visibilitychange", seen);
  };
  document.addEventListener("visibilitychange", seen);
  open();
  return close;
}
