"""What the manual adds to Sphinx: pages below other pages, titles as texts of links, and links to other files."""

from __future__ import annotations

import shutil
from pathlib import Path, PurePosixPath
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform
from sphinx.util.osutil import relative_uri

from docs.generate.effect_pages import ROOT

# Pages that the navigation shows below another page, which links to them in its text.
BELOW = {"docs/effects": "effects/*", "docs/README": "decisions/*"}
_FILES = "linked files"  # of a page, in the metadata that Sphinx keeps


class LinkedFiles(SphinxTransform):
    """Makes links to files that are no pages (reports, pictures, settings) open a copy of the file in the manual."""

    default_priority = 100

    def apply(self, **_: Any) -> None:
        """Replace what MyST made of such links: downloads of files beside the pages, unresolved names of others."""
        for node in list(self.document.findall(_is_link)):
            place = place_of(self.env.docname, node["reftarget"])
            if place is None:
                continue
            if (ROOT / place).is_file():
                self.env.metadata[self.env.docname].setdefault(_FILES, []).append(place)
                uri = relative_uri(f"{self.env.docname}.html", place.as_posix())
                link = nodes.reference("", "", refuri=uri, internal=True)
                link += node.children
                node.replace_self(link)
            else:  # a folder: there is nothing to open
                node.replace_self(node.children)


class TitledLinks(SphinxTransform):
    """Gives links to pages whose text is the name of their file (docs/x.md) the title of the page or section."""

    default_priority = 100

    def apply(self, **_: Any) -> None:
        """Mark such links as without a text of their own: MyST then takes the title."""
        for node in self.document.findall(addnodes.pending_xref):
            if node.get("refdomain") == "doc" and _is_file_name(node.astext(), node["reftarget"]):
                node["refexplicit"] = False


def _is_file_name(text: str, docname: str) -> bool:
    """Return whether ``text`` is the name of the file of the page ``docname``, with or without its folders."""
    return text.endswith(".md") and f"/{docname}.md".endswith(f"/{text.lstrip('./')}")


def _is_link(node: nodes.Node) -> bool:
    if isinstance(node, addnodes.pending_xref):
        return bool(node.get("reftype") == "myst" and node.get("refdomain") != "doc")  # "doc": known to be a page
    return isinstance(node, addnodes.download_reference)


def place_of(docname: str, target: str) -> PurePosixPath | None:
    """Return the path in the repository of the file or folder that the page ``docname`` names ``target``.

    None for pages, for what does not exist, and for generated pages, which are not in the repository.
    """
    name = target.partition("#")[0]
    path = ((ROOT / docname).parent / name).resolve()
    is_anchor = path.is_dir() and "/" not in name  # a heading of the page, called like a folder
    if not name or is_anchor or path.suffix == ".md" or not path.exists() or ROOT not in path.parents:
        return None
    return PurePosixPath(path.relative_to(ROOT).as_posix())


def copy_linked(app: Sphinx, error: Exception | None) -> None:
    """Copy the files that pages link to, to the same places of the manual."""
    places = {place for one in app.env.metadata.values() for place in one.get(_FILES, [])} if error is None else set()
    for place in places:
        copy = Path(app.outdir) / place
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / place, copy)


def with_pages_below(_: Sphinx, docname: str, source: list[str]) -> None:
    """Append to a page the list of the pages below it, for the navigation."""
    if docname in BELOW:
        source[0] += f"\n\n```{{toctree}}\n:hidden:\n:glob:\n\n{BELOW[docname]}\n```\n"


def with_levels(_app: Sphinx, _page: str, _template: str, context: dict[str, Any], _tree: Any) -> None:
    """Give the captions of the navigation, which Sphinx declares as headings, the level that ARIA requires."""
    tree = context.get("furo_navigation_tree")
    if tree:
        context["furo_navigation_tree"] = tree.replace('role="heading"', 'role="heading" aria-level="2"')


def setup(app: Sphinx) -> dict[str, bool]:
    """Add all this to the application of Sphinx, as it requires of an extension."""
    app.add_transform(LinkedFiles)
    app.add_transform(TitledLinks)
    app.connect("build-finished", copy_linked)
    app.connect("source-read", with_pages_below)
    app.connect("html-page-context", with_levels, priority=900)  # after the theme
    return {"parallel_read_safe": False, "parallel_write_safe": True}
