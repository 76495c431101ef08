"""How well effects of the library imitate physics that is not in it, and how much a right effect leaves.

``python -m benchmarks.imitation --json`` records a DelFly-like vehicle with one or two effects of random size on the
simulated balance, and diagnoses it: with the whole library (*alone*), with the second effect removed from the suspects
(*beside*), or with the only one removed (*omitted*), which stands for physics outside the library. Most of these
omissions are smooth over the beat. The thresholds `Policy.most_left` and `Policy.imitation` were set on 80 trials of an
earlier form of this benchmark, with other draws. The last line is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

import wingfit
from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show, show_count
from wingfit import DiagnosisSpec
from wingfit.diagnosis.finding import NAMING, Finding
from wingfit.records import Dataset, Recording
from wingfit.records.array_types import Array
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs.balance import DRAG, EXAMPLE, TRIALS, blank_recording, delfly, record

KINDS = ("alone", "beside", "omitted")
SEED, NUMBER = 3, 120
COEFFICIENTS = {"C_l": 1.3, "C_r": 1.44, "C_F": 1.58}  # the same in all conditions
HELD_OUT = ("test-3", "test-7")
FIRST, SECOND, ONLY = (2.0, 3.0, 5.0), (0.7, 1.5, 3.0), (2.0, 3.0, 5.0, 8.0)  # noises: RMS changes of the forces
ABSORBED = 1.6  # RMS change over misfit: the rest is absorbed by the nominal genes, typically
NOISE = 2.2e-3  # N
SCALINGS = 3  # of the size, until the change is as intended: many are not linear in it
FEW_SAMPLES = 64  # of a beat, for these
ELEMENTS, INSTANTS = 80, 800  # of the truth; a diagnosis has half of both
UNSEEN = {"strobe_rate", "scale_error"}  # not visible, or absorbed by the coefficients


@dataclass(frozen=True)
class Plan:
    """One trial: its kind, the effects that are hidden with their sizes in noises, and those that are no suspects."""

    number: int
    kind: str
    hidden: tuple[tuple[str, float], ...]
    removed: tuple[str, ...]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.imitation", description=__doc__)
    parser.add_argument("--json", action="store_true", help="end with one line that holds everything as JSON")
    parser.add_argument("--seed", type=int, default=SEED, help="of everything that is drawn")
    parser.add_argument("--n", type=int, default=NUMBER, help="number of trials")
    parser.add_argument("--jobs", type=int, default=2, help="processes at once")
    options = parser.parse_args()
    found = measured(options.seed, options.n, options.jobs)
    for name, value in found.items():
        print(f"{name}: {value}")
    if options.json:
        print(json.dumps(found))
    sys.exit(0)


def measured(seed: int, count: int, jobs: int) -> dict[str, Any]:
    """Run ``count`` trials in ``jobs`` processes; return shares of right and wrong verdicts by kind."""
    plans, began, rows = [planned(seed, number) for number in range(count)], time.monotonic(), []
    show("recording and diagnosing")
    with ProcessPoolExecutor(jobs) as pool:
        for row in pool.map(partial(outcome, seed), plans):
            rows.append(row)
            show_count("trials", len(rows), count, began)
    by_kind = {kind: _summary([row for row in rows if row["kind"] == kind]) for kind in KINDS}
    return {"trials": count, **by_kind, "seed": seed, "commit": commit(), "cpu": cpu()}


def planned(seed: int, number: int) -> Plan:
    """Return the plan of one trial."""
    rng = np.random.default_rng([seed, number, 1])
    first, second = (str(name) for name in rng.choice(hideable(), 2, replace=False))
    kind = KINDS[number % len(KINDS)]
    if kind == "beside":
        return Plan(number, kind, ((first, rng.choice(FIRST)), (second, rng.choice(SECOND))), (second,))
    return Plan(number, kind, ((first, rng.choice(ONLY)),), (first,) if kind == "omitted" else ())


def hideable() -> list[str]:
    """Return the names of the effects that are hidden: physics and faults that are amounts, not choices."""
    terms = BladeElementWing(delfly()).terms
    fit = [name for name, one in EFFECTS.items() if one.applies_to(delfly()) and one.fits(terms)]
    choices = {name for name in fit if any(p.positions for p in EFFECTS[name].size)}
    return sorted(set(fit) - choices - UNSEEN)


def outcome(seed: int, plan: Plan) -> dict[str, Any]:
    """Record and diagnose one trial; return its verdict, and how much of the misfit the best single effect leaves."""
    terms = BladeElementWing(delfly()).terms
    suspects = tuple(
        name for name, one in EFFECTS.items()
        if one.applies_to(delfly()) and one.fits(terms) and name not in plan.removed
    )  # fmt: skip
    found = wingfit.diagnose(recorded(seed, plan), DiagnosisSpec(suspects=suspects))
    return {"kind": plan.kind, "hidden": [name for name, _ in plan.hidden], **_judged(found, plan)}


def _judged(found: Finding, plan: Plan) -> dict[str, Any]:
    true = {name for name, _ in plan.hidden} - set(plan.removed)
    alike = {other for name in plan.removed for other in EFFECTS[name].confused_with}
    named = set(found.named) if found.verdict in NAMING else set()
    singles = [one for one in found.hypotheses if len(one.effects) == 1 and one.refitted]
    best = max(singles, key=lambda one: one.explained, default=None)
    return {
        "verdict": found.verdict,
        "named": sorted(named),
        "right": bool(named) and named <= true,
        "wrong": bool(named - true - alike),
        "similar": bool(named - true) and not named - true - alike,
        "best": best.effects[0] if best else "",
        "left_percent": 100.0 * (1.0 - best.explained) if best else 100.0,
    }


def _summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    def percent(which: list[bool]) -> float:
        return round(100.0 * sum(which) / max(len(which), 1), 1)

    true = [row["left_percent"] for row in rows if row["right"]]
    false = [row["left_percent"] for row in rows if row["best"] and row["best"] not in row["hidden"]]
    return {
        "n": len(rows),
        "right_percent": percent([row["right"] for row in rows]),
        "wrong_percent": percent([row["wrong"] for row in rows]),
        "similar_percent": percent([row["similar"] for row in rows]),
        "ambiguous_percent": percent([row["verdict"] == "ambiguous" for row in rows]),
        "unnamed_percent": percent([row["verdict"] == "unnamed" for row in rows]),
        "adequate_percent": percent([row["verdict"] == "adequate" for row in rows]),
        "right_leave_90_percent": round(float(np.quantile(true, 0.9)), 1) if true else None,
        "imitations_leave_10_percent": round(float(np.quantile(false, 0.1)), 1) if false else None,
        "wrong_names": [[row["hidden"], row["named"]] for row in rows if row["wrong"]],
    }


# -- recordings ------------------------------------------------------------------------------------------------


def recorded(seed: int, plan: Plan) -> Dataset:
    """Record the eight tests of the DelFly with the hidden effects of ``plan``."""
    values = dict[str, float]()
    for k, (name, noises) in enumerate(plan.hidden):
        values |= _sized(EFFECTS[name], noises, np.random.default_rng([seed, plan.number, 2, k]))
    model = BladeElementWing(
        delfly(), elements=ELEMENTS, instants=INSTANTS, effects=tuple(name for name, _ in plan.hidden)
    )
    recordings = []
    for k, trial in enumerate(TRIALS):
        trial = replace(trial, coefficients=COEFFICIENTS)
        beat = model.beat([_genome(model, values)], blank_recording(trial.condition))[0]
        rng = np.random.default_rng([seed, plan.number, 3, k])
        recordings.append(_with_faults(model, values, record(np.asarray(beat), trial, EXAMPLE, rng)))
    return Dataset(f"imitation-{plan.number}", delfly(), tuple(recordings), HELD_OUT, "one or two effects are hidden")


def _with_faults(model: BladeElementWing, values: dict[str, float], recording: Recording) -> Recording:
    """Add what the faults of the measurement among the effects of ``model`` change in ``recording``."""
    faults = {f"{one.name}.{p.name}": 0.0 for one in model.chosen if one.observe for p in one.size}
    if not faults:
        return recording
    with_, without = model.observe([_genome(model, values), _genome(model, values | faults)], recording).channels
    return replace(recording, values=recording.values + with_ - without)


def _sized(effect: Effect, noises: float, rng: np.random.Generator) -> dict[str, float]:
    """Return random values of the effect's genes with which the forces change by about ``noises`` noises (RMS)."""
    vehicle = delfly()
    typical, sizes = effect.typical(vehicle), {f"{effect.name}.{p.name}" for p in effect.size}
    sign, values, factor = float(rng.choice([-1.0, 1.0])), dict[str, float](), 1.0
    draw = {gene.name: float(rng.uniform(0.7, 1.3)) for gene in effect.genes(vehicle)}
    for _ in range(SCALINGS):
        for gene in effect.genes(vehicle):
            part = factor * (sign if gene.lower < 0.0 else 1.0) if gene.name in sizes else 1.0
            values[gene.name] = float(np.clip(typical[gene.name] * draw[gene.name] * part, gene.lower, gene.upper))
        factor *= float(np.clip(ABSORBED * noises * NOISE / max(_change(effect, values), 1e-9), 0.05, 20.0))
    return values


def _change(effect: Effect, values: dict[str, float]) -> float:
    """Return the RMS change of the forces (N) by an effect with ``values`` over all tests."""
    model, found = BladeElementWing(delfly(), effects=(effect.name,)), list[float]()
    for trial in TRIALS:
        blank = blank_recording(trial.condition, samples=FEW_SAMPLES)
        on, off = model.observe([_genome(model, values), _genome(model, {})], blank).channels
        found.append(float(np.mean((on - off) ** 2)))
    return float(np.sqrt(np.mean(found)))


def _genome(model: BladeElementWing, values: dict[str, float]) -> Array:
    known = {gene.name: gene.nominal for gene in model.genes} | DRAG | COEFFICIENTS | values
    return np.array([known[gene.name] for gene in model.genes])


if __name__ == "__main__":
    main()
