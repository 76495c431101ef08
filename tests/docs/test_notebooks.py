"""The notebooks of examples/notebooks run from the first cell to the last, and show what their text says.

They are run by a real kernel, as their readers run them, so that figures and shell commands are tested too.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

from tests.docs.pages import ROOT

NOTEBOOKS = ROOT / "examples" / "notebooks"
SECONDS = 300
FIGURE = "application/vnd.plotly.v1+json"
# Number of figures, and words that the output has: what the text around the cells promises.
SHOWN = {
    "calibrate.ipynb": (2, ["mN before", "test-8 C_F: 0.6", "true 0.670"]),
    "diagnose.ipynb": (4, ["clap_and_peel", "The model is missing clap and peel", "held-out recordings"]),
    "from_files.ipynb": (2, ["add it: --unit mm", "described from its tracks", "likely mistakes: 0"]),
    "plan.ipynb": (3, ["record ", "resolves "]),
    "your_rig.ipynb": (3, ["named ('dry_friction.pivot',)"]),
}


def read(name: str) -> Any:
    return nbformat.read(NOTEBOOKS / name, as_version=4)


def test_every_notebook_is_run_and_listed() -> None:
    assert {path.name for path in NOTEBOOKS.glob("*.ipynb")} == set(SHOWN)
    page = (ROOT / "docs" / "plots.md").read_text(encoding="utf-8")
    assert all(f"(../examples/notebooks/{name})" in page for name in SHOWN)


@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_is_stored_without_outputs(name: str) -> None:
    for cell in read(name).cells:
        assert not cell.get("outputs")
        assert cell.get("execution_count") is None


@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_runs_and_shows_what_its_text_says(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for key, first in (("PATH", str(Path(sys.executable).parent)), ("PYTHONPATH", str(ROOT))):
        monkeypatch.setenv(key, os.pathsep.join([first, os.environ.get(key, "")]))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    notebook = read(name)
    NotebookClient(notebook, timeout=SECONDS, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [one for cell in notebook.cells for one in cell.get("outputs", [])]
    figures, words = SHOWN[name]
    assert sum(FIGURE in one.get("data", {}) for one in outputs) == figures
    printed = "".join(one.get("text", "") for one in outputs)
    assert [word for word in words if word not in printed] == []
