"""Cost of each effect, and the change it makes before and after a refit: ``python -m benchmarks.effects [--json]``.

An effect is an optional piece of physics that can be added to the model. It is measured on the Robird's wing of 11
bodies over the small campaign (ten conditions) and on the DelFly over its eight tests, without noise. The effect is
simulated at its typical size and the nominal genes are refitted; the residual is the part of the effect that can be
detected at all. Residuals of two effects are compared by the angle between them, after projecting out what the nominal
genes can change. About twelve minutes on two cores; ``--quick`` uses three conditions, ``--only a,b`` some of the
effects.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag

from benchmarks.common.machine import commit, cpu
from benchmarks.common.progress import show_count
from benchmarks.physics.effect_rigs import RIGS, AnyModel, Rig, rig_of
from wingfit.calibration.estimates.linearised import free_genes, linearise, residuals_of, unit_at, values_at
from wingfit.calibration.problem import Problem, base_genome
from wingfit.records import Recording
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.registry import EFFECTS
from wingfit.workers.in_process import InProcessEvaluator

Array = npt.NDArray[np.float64]

REPEATS = 4
SPREAD = 0.1  # relative spread of the genes in a batch whose cost is measured
SEEN = 1e-3  # mm or mN: smaller changes are within the simulation's error
ITERATIONS = 12
GAIN = 0.98  # iterations end when the sum of squares is above this fraction of the one before
LENGTHS = np.array(
    [1.0, 0.7, 0.5, 0.35, 0.2, 0.1, 1.3, 1.6]
)  # step lengths that are tried together, in one group of lanes


@dataclass(frozen=True)
class Moved:
    """Change that an effect makes to the recordings of a rig.

    ``size``: RMS change; ``left``: RMS residual after the nominal genes are fitted to the changed recordings, both mm
    or mN; ``columns`` [D, S]: change of all D recorded values by each of the effect's S size genes alone, m or N.
    """

    size: float
    left: float
    columns: Array


def batch(rig: Rig, model: AnyModel, effect: Effect | None, seed: int = 1, count: int = 16) -> Array:
    """Return ``count`` genomes [count, G] near the nominal one, each with a different motion.

    The genes of ``effect`` have their typical values; ``seed``: of the random numbers.
    """
    values = np.array([gene.nominal for gene in model.genes])
    wobble = np.random.default_rng([seed, 1]).uniform(-1.0, 1.0, (count, len(values)))
    genomes = values * (1.0 + SPREAD * wobble)
    typical = effect.typical(rig.description) if effect else {}
    for k, gene in enumerate(model.genes):
        genomes[:, k] = np.clip(genomes[:, k], gene.lower, gene.upper)
        if gene.name in typical:
            genomes[:, k] = typical[gene.name]
    return genomes


def cost_ratio(rig: Rig, effect: Effect) -> float:
    """Return the processor time of a batch of simulations with the effect divided by that without.

    Median over REPEATS alternating repetitions with new genomes.
    """
    without = rig.stands_for(effect)
    models = [(rig.by_default(one, without), one) for one in (None, effect)]
    records = rig.timed()
    spent: list[list[float]] = [[], []]
    for repeat in range(REPEATS + 1):  # the first repeat is not counted
        for times, (model, one) in zip(spent, models, strict=True):
            genomes = batch(rig, model, one, repeat)
            began = time.process_time()
            for recording in records:
                model.observe(genomes, recording)
            times.append(time.process_time() - began)
    ratios = np.array(spent[1][1:]) / np.array(spent[0][1:])
    return float(np.median(ratios))


def displacement(rig: Rig, effect: Effect, values: dict[str, float], recordings: tuple[Recording, ...]) -> Array:
    """Return the change [D] (m or N) of all recorded values by the effect, one recording after the other.

    ``values``: values of the effect's genes by name. ValueError if a simulation fails.
    """
    model = rig.model(effect)
    genome = base_genome(model, values)
    changed = []
    for recording in recordings:
        seen = model.observe(np.array([genome.values]), recording)
        if seen.reasons[0] is not None:
            raise ValueError(f"{effect.name} at its typical size under {recording.name}: {seen.reasons[0]}")
        changed.append((seen.channels[0] - recording.values).ravel())
    return np.concatenate(changed)


def moved(rig: Rig, effect: Effect) -> Moved:
    """Compute the change by ``effect`` at its typical size.

    The result includes the residual after a refit of the nominal genes, and the change by each of the effect's size
    genes.
    """
    recordings, typical = rig.recordings(rig.stands_for(effect)), effect.typical(rig.description)
    whole = displacement(rig, effect, typical, recordings)
    size = rig.unit * rig.rms(whole)
    left = rig.unit * refitted(rig, effect, recordings, whole)
    columns = []
    for parameter in effect.size:
        others = {f"{effect.name}.{p.name}": 0.0 for p in effect.size if p is not parameter}
        columns.append(displacement(rig, effect, typical | others, recordings))
    return Moved(size, left, np.stack(columns, axis=1))


def refitted(rig: Rig, effect: Effect, recordings: tuple[Recording, ...], whole: Array) -> float:
    """Return the RMS residual (m or N) after the nominal genes are fitted to changed recordings.

    ``whole`` [D]: the change, which is added to all values of ``recordings``.
    """
    model = rig.model(None, without=rig.stands_for(effect))
    slopes, total, samples = sensitivities(rig, rig.stands_for(effect)), 0.0, 0
    for part, slope in zip(rig.parts(rig.changed(recordings, whole)), slopes, strict=True):
        problem = Problem(model, part, model.searched, base_genome(model), rig.axes)
        squares, count = _fit(problem, slope)
        total, samples = total + squares, samples + count
    return float(np.sqrt(total / samples))


def _fit(problem: Problem, slope: Array) -> tuple[float, int]:
    """Fit the nominal genes by least squares with a constant Jacobian, trying several step lengths at once.

    ``slope``: Jacobian of :func:`sensitivities`. Returns the sum of squares (m^2 or N^2) and the number of samples.
    """
    genes, evaluator = free_genes(problem), InProcessEvaluator()
    unit, best, inverse = (
        unit_at(genes, np.array([gene.nominal for gene in genes]))[None],
        np.inf,
        np.linalg.pinv(slope),
    )
    for _ in range(ITERATIONS):
        answer = evaluator.evaluate(problem, values_at(genes, unit), residuals=True)
        k = int(np.argmin(answer.fitness))
        if answer.fitness[k] > GAIN * best:
            best = min(best, float(answer.fitness[k]))
            break
        best = float(answer.fitness[k])
        left = np.concatenate([np.nan_to_num(one[k]).ravel() for one in residuals_of(answer)])
        unit = np.clip(unit[k] - LENGTHS[:, None] * (inverse @ left), 0.0, 1.0)
    return best, sum(one.samples for one in answer.per_recording)


@cache
def sensitivities(rig: Rig, without: str) -> list[Array]:
    """Return the Jacobian [D, F] of the D recorded values by the F nominal genes in unit coordinates.

    There is one for each group of recordings that share a genome. ``without``: term that the model omits, or "".
    """
    found = []
    for part in rig.parts(rig.recordings(without)):
        model = rig.model(None, without=without)
        problem = Problem(model, part, model.searched, base_genome(model), rig.axes)
        genes = free_genes(problem)
        linear = linearise(problem, InProcessEvaluator(), unit_at(genes, np.array([gene.nominal for gene in genes])))
        found.append(np.nan_to_num(np.concatenate([s.reshape(-1, s.shape[-1]) for s in linear.sensitivities])))
    return found


@cache
def nominal_directions(rig: Rig, without: str) -> Array:
    """Return an orthonormal basis [D, R] of the changes of all recorded values that the nominal genes can make.

    The changes are linearised; R is their rank. ``without``: term that the model omits, or "".
    """
    basis, spread, _ = np.linalg.svd(block_diag(*sensitivities(rig, without)), full_matrices=False)
    return np.asarray(basis[:, spread > 1e-6 * spread[0]])


def angle(a: Array, b: Array) -> float:
    """Return the smallest angle (degrees) between two subspaces, given by orthonormal bases [D, any number] each."""
    return float(np.degrees(np.arccos(np.clip(np.linalg.norm(a.T @ b, 2), 0.0, 1.0))))


def freed(rig: Rig, one: Moved, known: Array) -> Array:
    """Return an orthonormal basis [D, R] of an effect's changes without those that the nominal genes can make.

    ``one``: the changes; ``known``: basis of :func:`nominal_directions`. R is the number of the effect's size genes
    less those whose remaining change is below SEEN, which are omitted.
    """
    free = one.columns - known @ (known.T @ one.columns)
    seen = [rig.unit * rig.rms(column) > SEEN for column in free.T]
    return np.asarray(np.linalg.svd(free[:, seen], full_matrices=False)[0])


def nearest(rig: Rig, name: str, found: dict[str, Moved]) -> tuple[str | None, float | None]:
    """Find the effect with the most similar residual: return its name and the angle (degrees) to it.

    ``name``: effect to compare; ``found``: changes by all effects, by name. (None, None) if there is no residual above
    SEEN to compare.
    """
    known = nominal_directions(rig, rig.stands_for(EFFECTS[name]))
    own = freed(rig, found[name], known)
    others = {other: freed(rig, one, known) for other, one in found.items() if other != name}
    angles = {other: angle(own, basis) for other, basis in others.items() if basis.size and own.size}
    if not angles:
        return None, None
    best = min(angles, key=lambda other: angles[other])
    return best, angles[best]


def _task(kind: str, name: str, quick: bool) -> Moved:
    return moved(rig_of(kind, quick), EFFECTS[name])


def measure(names: Iterable[str], *, quick: bool = False, costs: bool = True) -> dict[str, Any]:
    """Measure the effects ``names``; return the rows of the table and the conditions of the measurement.

    Progress goes to standard error. ``costs``: whether to measure processor times too.
    """
    names, began = list(names), time.monotonic()
    tasks = [(k, n) for k in RIGS for n in names if EFFECTS[n].applies_to(rig_of(k, quick).description)]
    ratios: dict[tuple[str, str], float | None] = dict.fromkeys(tasks)
    total = len(tasks) * (2 if costs else 1)
    for done, (kind, name) in enumerate(tasks if costs else [], 1):  # one at a time, because costs are measured
        ratios[kind, name] = cost_ratio(rig_of(kind, quick), EFFECTS[name])
        show_count(f"cost of {name} on the {kind}", done, total, began)
    found: dict[str, dict[str, Moved]] = {kind: {} for kind in RIGS}
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        under_way = {pool.submit(_task, kind, name, quick): (kind, name) for kind, name in tasks}
        for done, future in enumerate(as_completed(under_way), total - len(tasks) + 1):
            kind, name = under_way[future]
            found[kind][name] = future.result()
            show_count(f"{name} on the {kind}", done, total, began)
    rows = [row(name, found, ratios, quick=quick) for name in names]
    return {"effects": rows, "quick": quick, "commit": commit(), "cpu": cpu(), "seconds": time.monotonic() - began}


def row(
    name: str, found: dict[str, dict[str, Moved]], ratios: dict[tuple[str, str], float | None], *, quick: bool
) -> dict[str, Any]:
    """Return one row of the table for effect ``name``: changes of tracks in mm, and of forces in mN.

    ``found``: changes by kind of rig and name of the effect; ``ratios``: relative costs by (kind, name).
    """
    line: dict[str, Any] = {"name": name, "family": EFFECTS[name].family}
    for kind, prefix, unit in (("wing", "", "mm"), ("vehicle", "vehicle_", "mn")):
        one = found[kind].get(name)
        like, degrees = nearest(rig_of(kind, quick), name, found[kind]) if one else (None, None)
        line |= {
            f"{prefix}cost_ratio": ratios.get((kind, name)),
            f"rms_{unit}": one.size if one else None,
            f"rms_{unit}_after_refit": one.left if one else None,
            f"{prefix}nearest": like,
            f"{prefix}angle_deg": degrees,
        }
    return line


def table(answer: dict[str, Any]) -> str:
    """Return the rows of :func:`measure` in markdown, as in docs/effects.md."""

    def cell(value: float | None, digits: int = 2) -> str:
        return "" if value is None else f"{value:.{digits}f}"

    lines = [
        "| effect | family | cost | moves, mm | after refit, mm | nearest | angle, deg | cost (vehicle) | moves, mN | "
        "after refit, mN | nearest (vehicle) | angle, deg |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for one in answer["effects"]:
        cells = [f"[{one['name']}](effects/{one['name']}.md)", one["family"]]
        for prefix, unit in (("", "mm"), ("vehicle_", "mn")):
            cells += [cell(one[f"{prefix}cost_ratio"]), cell(one[f"rms_{unit}"], 3)]
            cells += [cell(one[f"rms_{unit}_after_refit"], 3), one[f"{prefix}nearest"] or ""]
            cells.append(cell(one[f"{prefix}angle_deg"], 0))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Parse the command line, measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    parser.add_argument("--quick", action="store_true", help="three conditions of each rig")
    parser.add_argument("--only", default="", help="names of effects, separated by commas (default: all)")
    parser.add_argument("--no-costs", action="store_true", help="do not measure costs")
    arguments = parser.parse_args()
    names = [name for name in arguments.only.split(",") if name] or list(EFFECTS)
    for name in names:
        if name not in EFFECTS:
            parser.error(f"unknown effect {name!r}; there are {', '.join(EFFECTS)}")
    answer = measure(names, quick=arguments.quick, costs=not arguments.no_costs)
    print(table(answer))
    if arguments.json:
        print(json.dumps(answer))


if __name__ == "__main__":
    main()
