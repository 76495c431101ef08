"""Times of the tool itself: what it adds to a simulation, and how long a newcomer waits for the first finding."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from wingfit import Gene, Rig, Run, SeriesDataset, Suspect, diagnose
from wingfit.records import Channel, Series
from wingfit.records.array_types import Array

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = Path("examples") / "pendulum"
SECTION = "Bring your own"
RECORDINGS, SAMPLES, NOISE = 4, 200, 0.01  # of the decay that is diagnosed; noise in m
LONGEST = 1800.0  # s, of one command


class Stopwatch:
    """A decay in closed form as a simulation; it counts its calls and the seconds in them."""

    def __init__(self) -> None:
        self.calls, self.seconds = 0, 0.0

    def __call__(self, genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        """Return the position (m) [T] at the times of ``run``."""
        began = time.perf_counter()
        decay = genes["start"] * np.exp(-(genes["damping"] + genes["aging.size"] * run.times) * run.times)
        position = decay * np.cos(genes["rate"] * run.times)
        self.seconds += time.perf_counter() - began
        self.calls += 1
        return {"position": position}


def overhead_ms_per_call() -> float:
    """Return the milliseconds that a diagnosis adds to each call of the user's ``simulate``.

    This is the wall time of one whole diagnosis in this process, less the time within ``simulate``, divided by the
    number of calls. So it holds everything that the tool does: noise, faults, fits, evidence and validation. The rig is
    a decay in closed form, recorded four times with 200 samples; one recording is held out, and an effect is missing in
    the model, so that suspects are tested and fitted. The median of three diagnoses is returned.
    """
    simulate = Stopwatch()
    rig, dataset = _decay(simulate)
    found = []
    for _ in range(3):
        simulate.calls, simulate.seconds = 0, 0.0
        began = time.perf_counter()
        diagnose(dataset, rig=rig)
        found.append((time.perf_counter() - began - simulate.seconds) / simulate.calls)
    return round(1e3 * float(np.median(found)), 3)


def _decay(simulate: Stopwatch) -> tuple[Rig, SeriesDataset]:
    """Return the decay as a rig, and recordings of it with noise."""
    rig = Rig(
        name="decay",
        genes=(Gene("damping", "1/s", 0.3, 0.03, 3.0, "log"), Gene("rate", "rad/s", 6.0, 2.0, 18.0, "log")),
        recording_genes=(Gene("start", "m", 1.0, -3.0, 3.0),),
        channels={"position": "m"},
        suspects=(Suspect("aging", genes=(Gene("aging.size", "1/s^2", 0.0, -0.1, 0.1),)),),
        simulate=simulate,
    )
    times, channel = np.linspace(0.0, 4.0, SAMPLES), Channel("position", "m", NOISE)
    random, recordings = np.random.default_rng(1), []
    for k in range(RECORDINGS):
        genes = {"damping": 0.33, "rate": 6.3, "start": 0.5 + 0.3 * k, "aging.size": 0.02}
        clean = simulate(genes, Run(f"run-{k}", times, {}, {}, times))["position"]
        values = (clean + NOISE * random.standard_normal(SAMPLES))[:, None]
        recordings.append(Series(f"run-{k}", times, (channel,), values, estimates={"start": genes["start"]}))
    return rig, SeriesDataset("decay", "decay", tuple(recordings), (channel,), held_out=("run-2",))


def first_finding_minutes() -> float:
    """Return the minutes from the folder of CSV files of ``examples/pendulum`` to a finished HTML report.

    They are the wall time of the commands of the README's section "Bring your own", one after the other, each in a new
    process: start of Python, imports, the check of the rig, the diagnosis, and the report. The time to read and to type
    is not included. Raises RuntimeError if a command fails, or if the report does not hold the verdict.
    """
    commands = list(readme_commands((ROOT / "README.md").read_text(encoding="utf-8")))
    with tempfile.TemporaryDirectory() as scratch:
        shutil.copytree(ROOT / EXAMPLE, Path(scratch) / EXAMPLE)
        began = time.perf_counter()
        for arguments in commands:
            _wingfit(arguments, Path(scratch))
        elapsed = time.perf_counter() - began
        reports = list(Path(scratch).glob("*.html"))
        if not reports or "dry friction" not in reports[0].read_text(encoding="utf-8"):
            raise RuntimeError(f"the commands of README, {SECTION!r}, made no report that names dry friction")
    return round(elapsed / 60.0, 2)


def readme_commands(text: str) -> Iterator[list[str]]:
    """Yield the arguments of each ``$ wingfit`` command in the section "Bring your own" of the README's ``text``."""
    section = text.split(f"## {SECTION}\n")[1].split("\n## ")[0]
    for line in re.findall(r"^\$ wingfit (.*)$", section, re.MULTILINE):
        yield shlex.split(line)


def _wingfit(arguments: list[str], folder: Path) -> None:
    command = [sys.executable, "-c", "from wingfit.cli.main import main; main()", *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=LONGEST, check=False)  # noqa: S603
    if done.returncode:
        raise RuntimeError(f"wingfit {shlex.join(arguments)} ended with {done.returncode}: {done.stderr[-1000:]}")
