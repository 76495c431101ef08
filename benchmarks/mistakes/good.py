"""Good datasets from the plants of the concealed trials, which share no code with the checks.

Markers are measured by hand, tracks have coloured noise and gaps, coefficients are drawn far from the estimates, and
two of three datasets hide physics that no nominal model contains.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.concealed.benches.bench import record_all
from benchmarks.concealed.benches.choose import bench_of
from benchmarks.concealed.trials import (
    BARE,
    BEYOND,
    BIRD,
    ELEVEN,
    EQUAL,
    FINER,
    INSECT,
    PAIR,
    VEHICLE,
    Build,
    Trial,
    conditions,
)
from wingfit.records import Dataset, Recording

WINGS = (EQUAL, FINER, BIRD, INSECT, BEYOND, BIRD, INSECT, ELEVEN)
VEHICLES = (VEHICLE, PAIR, BARE, PAIR)
HIDDEN_WING = (
    "", "hinge_offset", "", "added_mass", "stroke_amplitude", "", "hinge_tilt", "drive_harmonics",
    "leading_edge_vortex", "", "phase_lag_error", "lumped_mass", "damage", "band", "brake", "backlash", "stop",
)  # fmt: skip
HIDDEN_VEHICLE = (
    "", "clap_and_peel", "induced_inflow", "", "circulation_lag", "stroke_amplitude", "", "tail_in_wake",
    "inertial_camber", "stroke_bias", "", "wing_pitch_zero", "body_drag", "stop_knock", "airspeed_error",
)  # fmt: skip
ATTEMPTS = 6


@dataclass(frozen=True)
class Good:
    """A good dataset: its ``name``, the ``hidden`` effect ("" if none), and the dataset."""

    name: str
    hidden: str
    dataset: Dataset


def wings(count: int, seed: int) -> Iterator[Good]:
    """Yield ``count`` datasets of wings; the same ``seed`` gives the same datasets."""
    for k in range(count):
        yield _made(f"wing-{k:02d}", WINGS[k % len(WINGS)], HIDDEN_WING[k % len(HIDDEN_WING)], [seed, 1, k], k % 5 == 4)


def vehicles(count: int, seed: int) -> Iterator[Good]:
    """Yield ``count`` datasets of vehicles; the same ``seed`` gives the same datasets."""
    for k in range(count):
        build, hidden = VEHICLES[k % len(VEHICLES)], HIDDEN_VEHICLE[k % len(HIDDEN_VEHICLE)]
        yield _made(f"vehicle-{k:02d}", build, hidden, [seed, 2, k], k % 5 == 4)


def _made(name: str, build: Build, hidden: str, seed: list[int], poor: bool) -> Good:
    """Return one dataset; another draw is taken where the plant has no periodic motion."""
    bench, reasons = bench_of(build), list[str]()
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([*seed, attempt])
        trial = Trial(name, "null", build, (), 0.0, poor, 0)
        planned = conditions(trial, rng)
        # A wing takes half a second a recording: four of seven, in the chamber and in the tunnel.
        kept = planned if poor or build.rig == "vehicle" else [planned[i] for i in (0, 1, 3, 6)]
        drawn = {hidden: bench.laws[hidden].draw(rng)} if hidden in bench.laws else {}
        try:
            made = list(record_all(bench, [one for one, _ in kept], bench.genome(rng), drawn, int(rng.integers(2**31))))
        except (RuntimeError, ArithmeticError, ValueError) as error:
            reasons.append(str(error))
            continue
        recordings, held_out = _named(made), tuple(f"run-{n + 1}" for n, (_, held) in enumerate(kept) if held)
        rig = bench.described(rng)
        return Good(name, hidden if drawn else "", Dataset(name, rig, recordings, held_out))
    raise RuntimeError(f"{name} cannot be recorded: {'; '.join(reasons)}")


def _named(made: list[Recording]) -> tuple[Recording, ...]:
    """Name the recordings by numbers: a check must not read the condition from a name."""
    return tuple(replace(one, name=f"run-{n + 1}") for n, one in enumerate(made))
