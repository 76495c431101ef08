// Files that the page makes itself.

import { el } from "./format.js";

const KEPT_MS = 10_000; // until the browser has read it

// Let the user save ``blob`` under ``name``.
export function save(blob, name) {
  const link = el("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), KEPT_MS);
}
