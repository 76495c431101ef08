"""Build the manual: ``python -m docs.manual [--out FOLDER]``, without a network.

Sphinx reads a copy of README.md, CHANGELOG.md and docs/, beside which the references of commands, of Python and of the
REST API are generated. A warning, such as one of a broken link, fails the build.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

from sphinx.application import Sphinx

from docs.generate.effect_pages import ROOT
from docs.manual import commands, python, rest

MANUAL = Path(__file__).parent
OUT = ROOT / "build" / "manual"
NOT_COPIED = shutil.ignore_patterns("__pycache__", "generate", "schemas")


def staged(folder: Path) -> Path:
    """Write everything that Sphinx reads to the new ``folder``, and return it."""
    shutil.copytree(ROOT / "docs", folder / "docs", ignore=NOT_COPIED)
    for name in ("README.md", "CHANGELOG.md"):
        shutil.copy2(ROOT / name, folder / name)
    shutil.copy2(MANUAL / "index.rst", folder / "index.rst")
    reference = folder / "reference"
    pages = {"commands.md": commands.page(), "rest.md": rest.page(), "glossary.md": glossary(), **python.pages()}
    for name, text in pages.items():
        path = reference / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder


def glossary() -> str:
    """Return the glossary of README.md as a page of its own."""
    _, _, rest_of_it = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n## Glossary\n")
    table, _, _ = rest_of_it.partition("\n## ")
    return "# Glossary\n" + table.replace("](docs/", "](../docs/")


def build(out: Path) -> int:
    """Build the manual in the folder ``out``, replacing what is there; return 0, or 1 if there was a warning."""
    shutil.rmtree(out, ignore_errors=True)
    with tempfile.TemporaryDirectory(prefix="wingfit-manual-") as scratch:
        source = staged(Path(scratch) / "source")
        app = Sphinx(
            source,
            MANUAL,
            out,
            Path(scratch) / "doctrees",
            "html",
            status=None,
            warningiserror=True,
            freshenv=True,
        )
        app.build(force_all=True)
    return int(app.statuscode)


def main() -> None:
    """Build the manual, and print the path of its first page."""
    parser = argparse.ArgumentParser(prog="python -m docs.manual", description=__doc__)
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the manual; what is there is replaced")
    out = parser.parse_args().out
    status = build(out)
    if status == 0:
        print(out / "index.html")
    sys.exit(status)


if __name__ == "__main__":
    main()
