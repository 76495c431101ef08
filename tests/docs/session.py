"""A folder, a server and a shell in which the blocks of a page run one after the other."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

from tests.docs.comparison import difference
from tests.docs.pages import ROOT, Block, commands

SERVED = "http://127.0.0.1:8321"
IDS = {"ds": "DATASET_ID", "run": "RUN_ID", "dx": "DIAGNOSIS_ID"}
END = "--- end of the output of a command ---"
# A search of a wing takes minutes. Options given twice count as given last, so this one makes a small one.
SMALL_SEARCH = "--division 4 --population 4 --max-generations 1 --recording vac-0010mbar-lag0-2.0hz --mode joint"
TIMEOUT_S = 900.0  # for what hangs: beside the other tests, half a minute takes ten times as long


class Session:
    """What the blocks of one page share: files, and the ids that commands have printed."""

    def __init__(self, folder: Path, url: str) -> None:
        self.folder = folder
        self.url = url
        self.ids: dict[str, str] = {}
        self.output = ""
        self.steps = ""
        self.skipped: list[str] = []
        (folder / "examples").symlink_to(ROOT / "examples")
        (folder / ".venv").symlink_to(sys.prefix)

    def run(self, block: Block) -> list[str]:
        """Run one block; what went wrong, or differs from what the page shows."""
        if block.file:
            path = self.folder / block.file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")
            return []
        match block.language:
            case "python":
                return self._printed(block, [sys.executable, "-c", self._with_ids(block.text)])
            case "text":
                wrong = difference(block.text, self.output)
                return [f"{block.place}: {wrong}"] if wrong else []
            case "sh" | "console":
                return self._shell(block)
            case "formula":
                return []
        return [
            f"{block.place}: nothing is done with {block.language!r}; say what in the info string (tests/docs/pages.py)"
        ]

    def _shell(self, block: Block) -> list[str]:
        failures = []
        for command, shown in commands(block):
            if command.startswith("wingfit serve"):  # it is running already
                continue
            if command.startswith("curl") and shutil.which("curl") is None:
                self.skipped.append(f"{block.place}: {command}")
                continue
            if "DATASET_ID" in command and "DATASET_ID" not in self.ids:
                self._printed(block, ["bash", "-c", "wingfit datasets upload examples/robird"])
                command = re.sub(r"(runs submit \S+)(.*)", rf"\1\2 {SMALL_SEARCH}", _uncommented(command))
            failures += self._printed(block, ["bash", "-ec", "set -o pipefail\n" + self._with_ids(command)])
            seen = self.output + (self.steps if "\nnext: " in f"\n{shown}" else "")
            if shown and (wrong := difference(shown, seen)):
                failures.append(f"{block.place}: $ {command}\n{wrong}")
        return failures

    def _printed(self, block: Block, command: list[str]) -> list[str]:
        path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        env = os.environ | {"PATH": path, "PYTHONPATH": str(ROOT), "WINGFIT_URL": self.url, "COLUMNS": "200"}
        done = subprocess.run(
            command, cwd=self.folder, env=env, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
        )
        # A terminal shows results and, below them, the next step; other messages differ from run to run.
        steps = [line for line in done.stderr.splitlines(keepends=True) if line.startswith("next: ")]
        self.output = done.stdout.replace(self.url, SERVED)
        self.steps = "".join(steps).replace(self.url, SERVED)
        for kind, name in IDS.items():
            if found := re.findall(rf"\b{kind}_[0-9a-f]{{16}}\b", self.output):
                self.ids[name] = found[0]
        if done.returncode == 0:
            return []
        return [f"{block.place}: {shlex.join(command)} ended with {done.returncode}\n{done.stderr[-2000:]}"]

    def _with_ids(self, text: str) -> str:
        text = text.replace(SERVED, self.url)
        for name, value in self.ids.items():
            text = text.replace(name, value)
        return text


def _uncommented(command: str) -> str:
    return re.sub(r"\s+#.*", "", command)
