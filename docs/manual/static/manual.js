"use strict";
// A browser does not let a page that was opened as a file read other files, so results have no excerpts there.
if (window.location.protocol === "file:" && typeof DOCUMENTATION_OPTIONS !== "undefined") {
  DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
}

// What the theme does not give: names of the two columns, and wide code and tables that the keyboard can scroll.
document.addEventListener("DOMContentLoaded", () => {
  document.querySelector("aside.sidebar-drawer")?.setAttribute("aria-label", "Pages of the manual");
  document.querySelector("aside.toc-drawer")?.setAttribute("aria-label", "On this page");
  for (const wide of document.querySelectorAll("article pre, article .table-wrapper")) wide.tabIndex = 0;
});
