"""Cost and accuracy of the simulator and of other engines: ``python -m benchmarks.simulator [--json] [--quick]``.

Costs are processor times of one thread for one beat and one individual (the simulator computes several at once, in
"lanes", all of which are used), with the fewest steps that keep all markers within 0.1 mm of the converged periodic
motion. The other engines run in processes of their own (``python -m benchmarks.peers``) and are measured in the same
way, each against its own converged run. ``--quick`` omits the other engines, the search and the two largest wings. The
whole takes about ten minutes on two cores.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from benchmarks import calibration
from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show
from benchmarks.physics import flops, random_genomes
from benchmarks.physics.convergence import (
    Subject,
    beats_to_periodic,
    by_default,
    energy_error,
    fewest_steps,
    largest_distance,
    ms_per_beat,
    reference,
)
from wingfit.calibration.search import CalibrationSpec
from wingfit.sim.kernels import LANES
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.workers import make_evaluator

TOLERANCE = 1e-4  # m
CONDITIONS = {"vacuum": vacuum(10.0, 0.05, 3.0), "air": tunnel(0.05, 3.0, 6.0)}
DIVISIONS = {4: "4", 11: "11", 24: "6x4", 48: "12x4", 96: "24x4"}
GROWING = (24, 48, 96)  # bodies, with four along every chord, for the growth of the cost
QUICK = (4, 11, 24)
ENGINES = ("scipy", "exudyn")
ENERGY_BODIES = 24
LIGHT = 0.2  # fraction of the nominal damping: the lower bound of the damping genes
WORKERS = 2
GENOMES, SEED = 1000, 1
_SILENCE = 3.0  # multiple of its time limit after which a peer process is killed


class Progress:
    """Shows the number of the present stage, of ``stages``, and its remaining time on standard error."""

    def __init__(self, stages: int) -> None:
        self.stages, self.stage, self.label = stages, 0, ""
        self.began = self.stage_began = time.monotonic()

    @contextmanager
    def during(self, label: str) -> Iterator[None]:
        """Context manager for one stage of the benchmark, called ``label``."""
        self.stage, self.label, self.stage_began = self.stage + 1, label, time.monotonic()
        self._say("")
        yield
        self._say(f", {time.monotonic() - self.stage_began:.0f} s", last=True)

    def __call__(self, done: int, of: int) -> None:
        """Show that ``done`` of ``of`` parts of the stage are done, and the remaining time."""
        left = (time.monotonic() - self.stage_began) / done * (of - done)
        self._say(f", {done}/{of}, about {left:.0f} s left")

    def _say(self, rest: str, *, last: bool = False) -> None:
        show(f"[{self.stage}/{self.stages}, {time.monotonic() - self.began:.0f} s] {self.label}{rest}", last=last)


def case(bodies: int, medium: str, operations: int) -> dict[str, Any]:
    """Measure cost and accuracy of the simulator with ``bodies`` bodies in ``medium``: one row of the table.

    ``operations``: floating-point operations of one step of LANES individuals, which are simulated at once. Fraction of
    the peak rate and results of other engines are still None in the returned row.
    """
    subject = Subject(DIVISIONS[bodies], CONDITIONS[medium])
    converged = reference(subject, TOLERANCE)
    steps, error = fewest_steps(subject, converged, TOLERANCE)
    cost = ms_per_beat(subject, steps, converged.start)
    usual = by_default(subject)
    rate = steps * operations / LANES / (cost * 1e-3) / 1e9
    return {
        "bodies": bodies,
        "medium": medium,
        "ms_per_beat": cost,
        "error_mm": 1e3 * error,
        "gflops": rate,
        "fraction_of_peak": None,
        "times_faster_than_scipy": None,
        "times_faster_than_engine": None,
        "engine": None,
        "beats_to_periodic": beats_to_periodic(subject, steps, Numerics().window, TOLERANCE),
        "beats_to_periodic_plain": beats_to_periodic(subject, steps, 0, TOLERANCE),
        "steps": steps,
        "operations_per_step": operations / LANES,
        "reference_change_mm": 1e3 * converged.change,
        "default_steps": len(usual.beat.tracks),
        "default_beats": usual.beat.beats,
        "default_error_mm": 1e3 * largest_distance(usual.beat.tracks, converged.tracks),
        "default_estimated_error_mm": 1e3 * usual.beat.error,
        "default_ms_per_individual": usual.ms,
    }


@dataclass(frozen=True)
class Peer:
    """One case to measure with another engine: its name, the number of bodies and the medium."""

    engine: str
    bodies: int
    medium: str


def run_peer(peer: Peer, seconds: float) -> dict[str, Any]:
    """Measure the case ``peer`` by ``benchmarks.peers`` in a process of its own, and return the result.

    ``seconds``: time limit. Without a result, ``cpu_ms_per_beat`` is None and ``note`` gives the reason.
    """
    command = [
        sys.executable, "-m", "benchmarks.peers", "--division", DIVISIONS[peer.bodies], "--medium", peer.medium,
        "--engine", peer.engine, "--tolerance-mm", str(1e3 * TOLERANCE), "--seconds", str(seconds), "--json",
    ]  # fmt: skip
    single = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}
    try:
        ended = subprocess.run(  # noqa: S603 (our own module)
            command, env=os.environ | single, capture_output=True, text=True, timeout=_SILENCE * seconds, check=True
        )
        found: dict[str, Any] = json.loads(ended.stdout.splitlines()[-1])[0]
    except subprocess.TimeoutExpired:
        return {"cpu_ms_per_beat": None, "note": f"ended after {_SILENCE * seconds:g} s without a result"}
    except subprocess.CalledProcessError as failed:
        return {
            "cpu_ms_per_beat": None,
            "note": (failed.stderr.strip().splitlines() or ["failed without a message"])[-1],
        }
    return found


def compare(cases: list[dict[str, Any]], seconds: float, progress: Progress) -> None:
    """Measure all ``cases`` with the other engines and add the results to them.

    Large cases come first, WORKERS at a time, on one thread each. ``seconds``: time limit of each.
    """
    peers = [Peer(engine, row["bodies"], row["medium"]) for row in reversed(cases) for engine in ENGINES]
    with ThreadPoolExecutor(WORKERS) as pool:
        for done, (peer, found) in enumerate(
            zip(peers, pool.map(lambda peer: run_peer(peer, seconds), peers), strict=True), 1
        ):
            row = next(row for row in cases if (row["bodies"], row["medium"]) == (peer.bodies, peer.medium))
            add_peer(row, peer.engine, found)
            progress(done, len(peers))


def add_peer(row: dict[str, Any], engine: str, found: dict[str, Any]) -> None:
    """Add the result ``found`` of another ``engine`` (of :func:`run_peer`) to the ``row`` of the table."""
    cost = found["cpu_ms_per_beat"]
    ratio = None if cost is None else cost / row["ms_per_beat"]
    row[engine] = {name: found.get(name) for name in ("cpu_ms_per_beat", "error_mm", "method", "settings", "note")} | {
        "version": installed(engine)
    }
    if engine == "scipy":
        row["times_faster_than_scipy"] = ratio
    else:
        row["times_faster_than_engine"], row["engine"] = ratio, f"{engine} {installed(engine)}"


def installed(package: str) -> str:
    """Return the version of the installed ``package``, or "not installed"."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def cost_exponents(cases: list[dict[str, Any]]) -> dict[str, float]:
    """Return, by medium, the exponent p of the cost of a beat, which is proportional to bodies^p.

    It is fitted to the cases with four bodies along the chord.
    """
    slopes = {}
    for medium in CONDITIONS:
        rows = [row for row in cases if row["medium"] == medium and row["bodies"] in GROWING]
        if len(rows) > 1:
            bodies, cost = (np.log([row[name] for row in rows]) for name in ("bodies", "ms_per_beat"))
            slopes[medium] = float(np.polyfit(bodies, cost, 1)[0])
    return slopes


def search_seconds() -> float:
    """Return the duration (s) of the genetic search of van der Grinten's thesis.

    24 bodies, population 50, until the best has not improved for 10 generations, one recording in vacuum and one in the
    tunnel.
    """
    evaluator = make_evaluator("processes", WORKERS)
    try:
        spec = CalibrationSpec(division="24", seed=SEED)
        return calibration.run(spec, calibration.thesis_campaign(), evaluator, "search").seconds
    finally:
        evaluator.close()


def energy_errors(cases: list[dict[str, Any]]) -> dict[str, float]:
    """Return the relative energy error over 20 beats, by medium, of ``cases`` with ENERGY_BODIES bodies.

    The number of steps is that which the simulator uses by default.
    """
    rows = {row["medium"]: row for row in cases if row["bodies"] == ENERGY_BODIES}
    return {
        medium: energy_error(Subject(DIVISIONS[ENERGY_BODIES], CONDITIONS[medium]), row["default_steps"])
        for medium, row in rows.items()
    }


def light_damping() -> dict[str, int | None]:
    """Return the numbers of beats until periodic in vacuum with LIGHT damping, with and without acceleration."""
    subject = Subject(DIVISIONS[ENERGY_BODIES], CONDITIONS["vacuum"], LIGHT)
    steps = len(by_default(subject).beat.tracks)
    windows = {"beats_to_periodic": Numerics().window, "beats_to_periodic_plain": 0}
    return {name: beats_to_periodic(subject, steps, window, TOLERANCE) for name, window in windows.items()}


def costs(sizes: tuple[int, ...], progress: Progress) -> tuple[list[dict[str, Any]], dict[str, float]]:
    """Measure all numbers of bodies ``sizes`` in each medium.

    Returns the rows of :func:`case`, and figures common to all rows: the peak rate, and the largest relative difference
    of a step's result in the counting code from that in the compiled code.
    """
    peak, cases, differences = flops.peak_gflops(), [], []
    for bodies in sizes:
        counted = flops.count_step(DIVISIONS[bodies])
        differences.append(counted.difference)
        for medium in CONDITIONS:
            cases.append(case(bodies, medium, counted.operations))
            progress(len(cases), len(sizes) * len(CONDITIONS))
    peak = max(peak, flops.peak_gflops())  # repeated in case another process used the core
    for row in cases:
        row["fraction_of_peak"] = row["gflops"] / peak
    return cases, {"peak_gflops": peak, "counted_differs_from_compiled": max(differences)}


def outcomes_of_random_genomes(every: int, progress: Progress) -> dict[str, Any]:
    """Simulate random gene values and summarise the outcomes.

    Only every ``every``-th genome and condition is used.
    """
    genomes = random_genomes.draw(FlexibleWing(robird_wing()).genes, GENOMES // every, SEED)
    todo = random_genomes.tasks(genomes, random_genomes.CAMPAIGN[::every])
    return random_genomes.summary(todo, random_genomes.run(todo, WORKERS, progress))


def measure(*, quick: bool, peer_seconds: float) -> dict[str, Any]:
    """Measure and return all figures of the benchmark.

    ``quick``: as the option --quick; ``peer_seconds``: time limit of each case with another engine, s.
    """
    progress, search = Progress(3 if quick else 5), None
    with progress.during("cost of a beat"):
        cases, core = costs(QUICK if quick else tuple(DIVISIONS), progress)
    with progress.during("energy ledger, light damping"):
        energy, light = energy_errors(cases), light_damping()
    with progress.during("random genomes"):
        box = outcomes_of_random_genomes(9 if quick else 1, progress)
    if not quick:
        with progress.during("other engines"):
            compare(cases, peer_seconds, progress)
        with progress.during("search"):
            search = search_seconds()
    slopes = cost_exponents(cases)
    return {
        "cases": cases,
        "cost_exponent": max(slopes.values(), default=None),
        "cost_exponent_by_medium": slopes,
        "finished_percent": box.pop("finished_percent"),
        "random_genomes": box,
        "search_24_seconds": search,
        "energy_error": max(energy.values(), default=None),
        "energy_error_by_medium": energy,
        "light_damping": light,
        **core,
        "tolerance_mm": 1e3 * TOLERANCE,
        "quick": quick,
        "cpu": cpu(),
        "commit": commit(),
    }


def table(figures: dict[str, Any]) -> str:
    """Return the ``figures`` as a text table."""
    columns = [
        "bodies", "medium", "steps", "ms_per_beat", "error_mm", "gflops", "fraction_of_peak", "times_faster_than_scipy",
        "times_faster_than_engine", "beats_to_periodic", "beats_to_periodic_plain",
    ]  # fmt: skip
    lines = [" ".join(columns)]
    for row in figures["cases"]:
        cells = ("-" if row[name] is None else row[name] for name in columns)
        shown = [f"{cell:.3g}" if isinstance(cell, float) else str(cell) for cell in cells]
        lines.append(" ".join(f"{text:>{len(name)}}" for text, name in zip(shown, columns, strict=True)))
    rest = {name: value for name, value in figures.items() if name not in ("cases", "random_genomes")}
    box = {name: value for name, value in figures["random_genomes"].items() if not name.endswith("_cases")}
    return "\n".join([*lines, *(f"{name}: {value}" for name, value in (rest | box).items())])


def main() -> None:
    """Parse the command line, measure, and print the figures."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simulator", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print only the JSON object")
    parser.add_argument("--quick", action="store_true", help="under two minutes: no other engine, no search")
    parser.add_argument("--peer-seconds", type=float, default=90.0, help="time allowed to each engine and case")
    arguments = parser.parse_args()
    figures = measure(quick=arguments.quick, peer_seconds=arguments.peer_seconds)
    if not arguments.json:
        print(table(figures))
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
