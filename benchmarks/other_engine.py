"""Diagnoses of a wing whose motion another engine computed.

``python -m benchmarks.other_engine --json`` simulates the wing in Exudyn (``benchmarks/peers``): rigid bodies in
Tait-Bryan angles, Exudyn's own laws of springs and dampers, its own integrator, and a wing with four or eight strips.
It changes something that the model does not know of, films the periodic motion with simulated cameras, and diagnoses
the recordings as a user would, with all suspects and a model of four strips. A third of the trials hide nothing, but
the laws of the springs differ from those of the model. Needs the extra ``peers``. The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

import wingfit
from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show, show_count
from benchmarks.peers.exudyn_engine import SAMPLES, Law, Settings, load_exudyn, simulate
from benchmarks.peers.wing import PeerWing, peer_wing
from wingfit import CalibrationSpec, DiagnosisSpec
from wingfit.diagnosis.finding import NAMING, Finding
from wingfit.diagnosis.policy import POLICY
from wingfit.records import Condition, Dataset
from wingfit.records.array_types import Array
from wingfit.sim.virtual_rigs.campaign import SMALL, Tracking, film, robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

SEED, NUMBER = 11, 24
DIVISIONS = ("4", "8x1")  # of the true wing; the model has "4"
LAWS: tuple[Law, ...] = tuple(law for law in get_args(Law) if law != "energy")  # that is the model's own
ATTEMPTS = 4  # draws of a wing that Exudyn can integrate
SPREAD = 1.6  # the true genes are up to this factor above or below the estimates
TRACKING = Tracking(noise=(3e-4, 3e-4, 4e-4), beats=3)
CONDITIONS = tuple(one for k, one in enumerate(SMALL) if k not in (4, 9))  # two are held out
BEATS, RAMP, STEPS = 14, 4, 480  # simulated from rest; of which the start-up; steps of each
SURE = 0.95
OF_LAW = {"cubic_stiffness"}  # names that are true of every trial: the laws of the springs are not those of the model
VISIBLE = math.sqrt(1.0 + POLICY.negligible**2)  # least strength: what leaves less beyond the noise counts as nothing

Change = Callable[[PeerWing, float], PeerWing]


@dataclass(frozen=True)
class Hidden:
    """Something to hide: names that are right for it, the change of the wing, and the range of its size."""

    right: tuple[str, ...]
    change: Change
    low: float
    high: float


def _heavier(wing: PeerWing, size: float) -> PeerWing:
    mass = wing.mass.copy()
    mass[wing.strip[-2]] += size
    return wing._replace(mass=mass)


def _softer(wing: PeerWing, size: float) -> PeerWing:
    stiffness = wing.stiffness.copy()
    stiffness[len(stiffness) // 2] *= size
    return wing._replace(stiffness=stiffness)


def _damped(wing: PeerWing, size: float) -> PeerWing:
    damping = wing.damping.copy()
    damping[len(damping) // 2] *= size
    return wing._replace(damping=damping)


def _lifted(wing: PeerWing, size: float) -> PeerWing:
    return wing._replace(wind=wing.wind + np.array([0.0, 0.0, size]) * np.linalg.norm(wing.wind))


# Nothing of the library describes a joint with a strong damper or an upwash; a soft joint is almost a local damage.
HIDDEN: Mapping[str, Hidden] = {
    "nothing": Hidden((), lambda wing, _: wing, 0.0, 0.0),
    "lag of the rear rod": Hidden(
        ("phase_lag_error",),
        lambda wing, size: wing._replace(lag=wing.lag + np.array([0.0, math.radians(size)])),
        2.0,
        6.0,
    ),
    "stroke amplitude": Hidden(
        ("stroke_amplitude",), lambda wing, size: wing._replace(harmonics=(1.0 + size) * wing.harmonics), 0.02, 0.08
    ),
    "mean flap angle": Hidden(
        ("stroke_bias",), lambda wing, size: wing._replace(mean=wing.mean + math.radians(size)), 1.0, 4.0
    ),
    "mass at the tip": Hidden(("lumped_mass",), _heavier, 0.006, 0.015),
    "airspeed": Hidden(("airspeed_error",), lambda wing, size: wing._replace(wind=(1.0 + size) * wing.wind), 0.25, 0.5),
    "place of the rig": Hidden(
        ("camera_shift",), lambda wing, size: wing._replace(hinge=wing.hinge + np.array([0.0, size, 0.0])), 0.003, 0.008
    ),
    "scale of the tracks": Hidden(("scale_error",), lambda wing, _: wing, 0.005, 0.015),
    "soft joint": Hidden(("damage",), _softer, 0.05, 0.2),
    "damped joint": Hidden((), _damped, 20.0, 60.0),
    "upwash": Hidden((), _lifted, 0.06, 0.12),
}


@dataclass(frozen=True)
class Trial:
    """What is hidden and how large; the true wing's division and law of springs; the seed of all that is drawn."""

    hidden: str
    size: float
    division: str
    law: Law
    seed: tuple[int, int]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.other_engine", description=__doc__)
    parser.add_argument("--json", action="store_true", help="end with one line that holds everything as JSON")
    parser.add_argument("--seed", type=int, default=SEED, help="of everything that is drawn")
    parser.add_argument("--n", type=int, default=NUMBER, help="number of trials")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    options = parser.parse_args()
    try:
        load_exudyn()
    except ImportError as missing:
        sys.exit(str(missing))
    found = measured(options.seed, options.n, options.jobs)
    if options.json:
        print(json.dumps(found))


def measured(seed: int, count: int, jobs: int) -> dict[str, Any]:
    """Run ``count`` trials in ``jobs`` processes; print each, and return shares of right and wrong ones in per cent."""
    trials, began, rows = [planned(seed, number) for number in range(count)], time.monotonic(), []
    show("simulating and diagnosing")
    with ProcessPoolExecutor(jobs) as pool:
        for row in pool.map(outcome, trials):
            rows.append(row)
            print(" ".join(f"{name}={value}" for name, value in row.items()), flush=True)
            show_count("trials", len(rows), count, began)
    return {**summary(rows), "seed": seed, "by_trial": rows, "commit": commit(), "cpu": cpu()}


def planned(seed: int, number: int) -> Trial:
    """Return one trial: every third hides nothing, the others one thing of HIDDEN in turn."""
    rng = np.random.default_rng([seed, number, 1])
    names = [name for name in HIDDEN if name != "nothing"]
    hidden = "nothing" if number % 3 == 0 else names[(number - 1 - number // 3) % len(names)]
    size = rng.uniform(HIDDEN[hidden].low, HIDDEN[hidden].high)
    return Trial(hidden, float(size), str(rng.choice(DIVISIONS)), LAWS[int(rng.integers(len(LAWS)))], (seed, number))


def recorded(trial: Trial) -> Dataset:
    """Return the dataset of a trial, drawn again up to ATTEMPTS times where Exudyn's integrator does not converge."""
    for attempt in range(ATTEMPTS - 1):
        try:
            return _drawn(trial, attempt)
        except load_exudyn().SolverError:
            continue
    return _drawn(trial, ATTEMPTS - 1)


def _drawn(trial: Trial, attempt: int) -> Dataset:
    """Return eight recordings, two of them held out."""
    rng = np.random.default_rng([*trial.seed, 2, *([attempt] if attempt else [])])
    model = FlexibleWing(robird_wing(), trial.division)
    genome = np.array([gene.nominal * SPREAD ** rng.uniform(-1.0, 1.0) for gene in model.genes])
    recordings, held_out = [], []
    for condition, hold in CONDITIONS:
        tracks = _beat(trial, model, genome, condition)
        recordings.append(film(model.wing, condition, tracks, TRACKING, rng))
        held_out += [recordings[-1].name] if hold else []
    return Dataset("another engine", model.wing, tuple(recordings), tuple(held_out))


def _beat(trial: Trial, model: FlexibleWing, genome: Array, condition: Condition) -> Array:
    wing = peer_wing(model.structure, model.genes, genome, condition, ramp_beats=RAMP)
    changed = HIDDEN[trial.hidden].change(wing, trial.size)
    tracks = simulate(changed, Settings(STEPS, trial.law), beats=BEATS).tracks[-SAMPLES:]
    return (1.0 + trial.size) * tracks if trial.hidden == "scale of the tracks" else tracks


def outcome(trial: Trial) -> dict[str, Any]:
    """Record and diagnose one trial."""
    found = wingfit.diagnose(recorded(trial), DiagnosisSpec(calibration=CalibrationSpec(division="4")))
    return {"hidden": trial.hidden, "size": round(trial.size, 4), "strips": trial.division, "law": trial.law} | judged(
        found, HIDDEN[trial.hidden].right
    )


def judged(found: Finding, right: tuple[str, ...]) -> dict[str, Any]:
    """Return the verdict, whether it is right or wrong, and whether the right hypothesis is listed first.

    ``right``: names of what is hidden; none: nothing, or nothing that the library has.
    """
    named = found.named if found.verdict in NAMING else ()
    first = next((one.effects for one in found.hypotheses if one.effects), ())
    return {
        "verdict": found.verdict,
        "named": list(found.named),
        "probability": round(found.probabilities[found.verdict], 3),
        "strength": round(found.strength, 2),
        "right": bool(right) and set(named) - OF_LAW == set(right),
        "wrong": bool(set(named) - set(right) - OF_LAW),
        "first": bool(right) and set(first) == set(right),
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return numbers of trials, and shares in per cent, of the outcomes ``rows``."""

    def percent(which: list[bool]) -> float | None:
        return round(100.0 * sum(which) / len(which), 1) if which else None

    nothing = [row for row in rows if row["hidden"] == "nothing"]
    hidden = [row for row in rows if row["hidden"] != "nothing" and row["strength"] >= VISIBLE]
    listed = [row for row in hidden if HIDDEN[row["hidden"]].right]
    unlisted = [row for row in hidden if not HIDDEN[row["hidden"]].right]
    sure = [row for row in rows if row["probability"] >= SURE]
    return {
        "trials": len(rows),
        "nothing_hidden": {
            "n": len(nothing),
            "adequate_percent": percent(_are(nothing, "adequate")),
            "law_of_springs_named": sum(bool(row["named"]) and not row["wrong"] for row in nothing),
        },
        "too_weak": {"n": len(rows) - len(nothing) - len(hidden)},
        "listed": {
            "n": len(listed),
            "first_percent": percent([row["first"] for row in listed]),
            "right_percent": percent([row["right"] for row in listed]),
            "adequate_percent": percent(_are(listed, "adequate")),
        },
        "unlisted": {
            "n": len(unlisted),
            "unnamed_percent": percent(_are(unlisted, "unnamed")),
            "adequate_percent": percent(_are(unlisted, "adequate")),
        },
        "wrong_percent": percent([row["wrong"] for row in rows]),
        "said_95": {"n": len(sure), "right_percent": percent([_holds(row) for row in sure])},
    }


def _are(rows: list[dict[str, Any]], verdict: str) -> list[bool]:
    return [row["verdict"] == verdict for row in rows]


def _holds(row: dict[str, Any]) -> bool:
    """Whether what a finding says is true: nothing to be seen is missing, this is, or something unlisted."""
    if row["verdict"] == "adequate":
        return bool(row["hidden"] == "nothing" or row["strength"] < VISIBLE)
    if row["verdict"] == "unnamed":
        return bool(row["hidden"] != "nothing")
    right = HIDDEN[row["hidden"]].right
    return bool(set(right) & set(row["named"])) if row["verdict"] == "ambiguous" else not row["wrong"]


if __name__ == "__main__":
    main()
