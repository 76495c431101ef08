"""Derivatives of the computed motion are those of a converged simulation, and are refused where there are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from wingfit.calibration.estimates.linearised import free_genes, linearise, unit_at, values_at
from wingfit.calibration.evaluator import units
from wingfit.calibration.problem import Problem, base_genome
from wingfit.inference.differences import TANGENT_STEP, differences
from wingfit.records import Condition
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.solver import sensitivity
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.simulate import NO_DERIVATIVE
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.workers.in_process import InProcessEvaluator

Array = npt.NDArray[np.float64]
WING = robird_wing()
CONDITIONS = [vacuum(10.0, 0.05, 3.0), tunnel(0.12, 4.0, 6.0)]
EXACT = Numerics(periodic=1e-11, max_beats=100)


def moved(model: FlexibleWing, genome: Array) -> Array:
    """``genome`` and, for each gene, the genome with that gene changed by TANGENT_STEP of its range."""
    genes = list(model.genes)
    unit = unit_at(genes, genome)
    return values_at(genes, np.vstack([unit, unit + TANGENT_STEP * np.eye(len(unit))]))


def genome_of(model: FlexibleWing, *effects: str) -> Array:
    values = {name: value for effect in effects for name, value in EFFECTS[effect].typical(WING).items()}
    return np.array(base_genome(model, values).values)


def slopes(model: FlexibleWing, genome: Array, condition: Condition, step: float, sides: int = 2) -> Array:
    """Derivatives [n, M, 3, G] of the tracks with respect to the genes, by differences of this step."""

    def simulate(units: Array) -> tuple[list[Array], list[str | None]]:
        beats = model.beats(values_at(list(model.genes), units), blank_recording(WING, condition))
        return [np.array([beat.tracks for beat in beats])], [beat.reason for beat in beats]

    unit = unit_at(list(model.genes), genome)
    found = differences(simulate, unit, np.arange(len(unit)), step=step, sides=sides)
    assert found.reasons == ()
    return found.slopes[0]


def by_differences(model: FlexibleWing, genome: Array, condition: Condition, steps: int) -> Array:
    """Derivatives by central differences of converged motions, extrapolated from two sizes of the differences."""
    exact = replace(model, numerics=replace(EXACT, steps=steps))
    return (4 * slopes(exact, genome, condition, 5e-4) - slopes(exact, genome, condition, 1e-3)) / 3


@pytest.mark.parametrize("condition", CONDITIONS, ids=["vacuum", "tunnel"])
@pytest.mark.parametrize(
    "effects",
    [(), ("added_mass", "tether"), ("cable",), ("viscoelastic",)],
    ids=["plain", "point", "rotation", "memory"],
)
def test_they_are_those_of_a_converged_motion(effects: tuple[str, ...], condition: Condition) -> None:
    model = FlexibleWing(WING, "4", effects=effects)
    genome = genome_of(model, *effects)
    found = slopes(model.tangent(genome), genome, condition, TANGENT_STEP, sides=1)
    expected = by_differences(model, genome, condition, len(found))
    size = np.abs(expected).max(axis=(0, 1, 2))
    error = np.abs(found - expected).max(axis=(0, 1, 2))
    assert (error <= 1e-4 * size + 1e-6).all(), dict(zip([g.name for g in model.genes], error / size, strict=True))
    strong = size > 0.1 * size.max()
    assert (error[strong] <= 3e-5 * size[strong]).all()


def test_a_step_a_thousand_times_larger_shows_the_same_derivative() -> None:
    """The step is no compromise between errors: a smaller or larger one changes the derivative by its own size only."""
    model = FlexibleWing(WING, "4")
    genome = genome_of(model)
    steps = (1e-6, 1e-5, 1e-4)
    first, *others = (slopes(model.tangent(genome), genome, CONDITIONS[1], step, sides=1) for step in steps)
    for step, found in zip(steps[1:], others, strict=True):
        assert np.abs(found - first).max() <= (10 * step + 1e-5) * np.abs(first).max()


def test_an_effect_that_is_off_has_none() -> None:
    model = FlexibleWing(WING, "4", effects=("added_mass",))
    genome = genome_of(model)
    beats = model.tangent(genome).beats(moved(model, genome), blank_recording(WING, CONDITIONS[1]))
    off = [gene.name for gene, beat in zip(model.genes, beats[1:], strict=True) if beat.reason]
    assert off == ["added_mass.k"]
    assert beats[-1].reason == "an effect that is off has no derivative"


def test_one_that_has_not_settled_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    model = FlexibleWing(WING, "4")
    genome = genome_of(model)
    monkeypatch.setattr(sensitivity, "MAX_BEATS", 1)
    beats = model.tangent(genome).beats(moved(model, genome), blank_recording(WING, CONDITIONS[0]))
    assert beats[0].reason is None
    assert {beat.reason for beat in beats[1:]} >= {NO_DERIVATIVE}
    assert all(np.isnan(beat.tracks).all() for beat in beats if beat.reason)


def test_without_a_periodic_motion_there_is_none() -> None:
    """Neither the first nor its neighbours have a beat, and the reason is that of the simulation."""
    model = FlexibleWing(WING, "4", numerics=Numerics(max_beats=2, periodic=1e-9), effects=("viscoelastic",))
    genome = genome_of(model, "viscoelastic")
    beats = model.tangent(genome).beats(moved(model, genome), blank_recording(WING, CONDITIONS[0]))
    assert all(beat.reason and "not periodic" in beat.reason for beat in beats)


def problem_of(effect: str, free: tuple[str, ...], *, on: bool) -> Problem:
    model = FlexibleWing(WING, "4", effects=(effect,))
    values = EFFECTS[effect].typical(WING) if on else {}
    recording = blank_recording(WING, CONDITIONS[1], frames=40)
    seen = model.observe(np.array([base_genome(model).values]), recording)
    return Problem(model, (replace(recording, values=seen.channels[0]),), free, base_genome(model, values))


@pytest.mark.parametrize("on", [True, False], ids=["on", "off"])
@pytest.mark.parametrize("effect", ["added_mass", "backlash"])
def test_genes_without_one_are_differenced(effect: str, on: bool) -> None:
    """Linearised, an effect that is off or has play gets the finite differences that it had before."""
    size = f"{effect}.{EFFECTS[effect].size[0].name}"
    problem = problem_of(effect, ("E_r", size), on=on)
    genes = free_genes(problem)
    unit = unit_at(genes, np.array([problem.base[gene.name] for gene in genes]))
    found = linearise(problem, InProcessEvaluator(), unit)

    def simulate(rows: Array) -> tuple[list[Array], tuple[str | None, ...]]:
        seen = problem.model.observe(problem.genomes(values_at(genes, rows)), problem.recordings[0])
        return [seen.channels], seen.reasons

    expected = differences(simulate, unit, np.arange(2)).slopes[0]
    assert found.known.all()
    assert found.reasons == ()
    assert np.isfinite(found.fitness)
    scale = np.abs(expected).max(axis=(0, 1))
    assert (np.abs(found.sensitivities[0] - expected).max(axis=(0, 1)) <= 0.1 * scale).all()


def test_neighbours_stay_together() -> None:
    problem = problem_of("added_mass", ("E_r",), on=True)
    assert isinstance(problem.model, FlexibleWing)
    together = replace(problem, model=problem.model.tangent(np.array(problem.base.values)))
    assert len(units(problem, 20)) == 3
    assert len(units(together, 20)) == 1
