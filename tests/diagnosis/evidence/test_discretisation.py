"""The choice of a discretisation: how far it goes on, and which part of its error remains."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from wingfit.calibration.problem import base_genome
from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis import DiagnosisSpec, diagnose, refinement
from wingfit.diagnosis.evidence import nominal
from wingfit.diagnosis.evidence.nominal import MAX_REFINEMENTS, Nominal, choose_discretisation, error_after
from wingfit.diagnosis.policy import POLICY
from wingfit.records import Dataset
from wingfit.sim.virtual_rigs.campaign import REFERENCE, Tracking, record, robird_wing, tunnel, vacuum
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.workers.in_process import InProcessEvaluator


@dataclass(frozen=True)
class Ladder:
    """A wing whose error falls with its ``strips`` to the power ``order``, as far as ``most``; more do not fit better.

    ``missing``: physics that is missing, orthogonal to that error; ``last``: most strips that can be simulated.
    """

    strips: int
    most: int = 1000
    last: int = 1000
    order: float = 1.0
    missing: float = 0.0

    @property
    def data(self) -> Any:
        return SimpleNamespace(policy=POLICY, noise=0.1)

    @property
    def subject(self) -> Any:
        return SimpleNamespace(description=f"{self.strips} strips")

    def finer(self) -> list[Ladder]:
        return [replace(self, strips=k) for k in (2 * self.strips, self.strips + 1) if k <= self.last]

    @property
    def error(self) -> float:
        return float(40.0 / min(self.strips, self.most) ** self.order)


def chosen(monkeypatch: pytest.MonkeyPatch, ladder: Ladder) -> Nominal:
    def fitted(one: Ladder, *_: Any) -> Any:
        return SimpleNamespace(excess=one.error**2 + one.missing**2, error=one.error)

    def change(finer: Ladder, current: Any) -> tuple[float, float]:
        return float(current.error - 40.0 / finer.strips**finer.order), 0.5

    monkeypatch.setattr(nominal, "make_refit", lambda *_: fitted(ladder))
    monkeypatch.setattr(nominal, "refit_at", fitted)
    monkeypatch.setattr(nominal, "fit_to_convergence", fitted)
    monkeypatch.setattr(nominal, "finer_change", change)
    return choose_discretisation(cast("Any", ladder), cast("Any", None), refine=True)


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("missing", [0.0, 0.05])
def test_where_the_refinements_end_the_error_of_the_last_remains(
    monkeypatch: pytest.MonkeyPatch, order: float, missing: float
) -> None:
    """Of any order of convergence, and without the physics that is missing besides."""
    found = chosen(monkeypatch, Ladder(4, order=order, missing=missing))
    strips = 4 * 2**MAX_REFINEMENTS
    assert found.subject.description == f"{strips} strips"
    assert found.discretisation_error == pytest.approx(40.0 / strips**order)
    assert found.remaining_error == found.possible_error == found.discretisation_error


def test_so_it_does_where_a_finer_wing_would_be_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    found = chosen(monkeypatch, Ladder(4, last=8))
    assert found.subject.description == "8 strips"
    assert found.remaining_error == pytest.approx(40.0 / 8)


def test_no_error_remains_where_the_last_wing_is_right_and_physics_is_missing() -> None:
    coarse, fine = (cast("Any", SimpleNamespace(excess=error**2 + 3.0**2)) for error in (5.0, 0.0))
    assert error_after(5.0, coarse, fine) == 0.0


def test_without_any_finer_wing_nothing_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    found = chosen(monkeypatch, Ladder(4, last=4))
    assert found.discretisation_error is None
    assert found.remaining_error == found.possible_error == 0.0


def test_where_a_finer_wing_fits_no_better_no_error_remains(monkeypatch: pytest.MonkeyPatch) -> None:
    found = chosen(monkeypatch, Ladder(4, most=8))
    assert (found.subject.description, found.tried_finer) == ("8 strips", "16 strips")
    assert found.remaining_error == found.possible_error == 0.0


@pytest.mark.parametrize(("limited", "better", "remaining"), [(True, 0.5, 1.0), (False, 0.5, 0.0), (True, 0.95, 2.0)])
def test_a_finer_wing_beside_an_effect_keeps_the_error_that_remains(
    monkeypatch: pytest.MonkeyPatch, limited: bool, better: float, remaining: float
) -> None:
    """Errors of the coarse and the finer wing are 2 and 1; ``better``: the finer excess with the effect."""

    def refit(excess: float, *names: str) -> Any:
        return SimpleNamespace(excess=excess, names=names, fit=SimpleNamespace(converged=True))

    def at(_: Any, one: Any) -> Any:
        return refit(1.0) if one is coarse else refit(better * one.excess, *one.names)

    monkeypatch.setattr(refinement, "finer_change", lambda *_: (1.0, 0.5))
    monkeypatch.setattr(refinement, "refit_at", at)
    monkeypatch.setattr(refinement, "continue_fit", lambda _, one: one)
    monkeypatch.setattr(refinement, "fit_to_convergence", lambda _, one: one)
    monkeypatch.setattr(refinement, "tolerated_excess", lambda *_: 0.1)
    ladder, coarse = Ladder(8, last=16), refit(4.0)
    known = Nominal(cast("Any", ladder.subject), coarse, 2.0, "", (), limited=limited)
    effect = refit(2.0, "damage")
    state: Any = SimpleNamespace(
        data=ladder.data, nominal=known, fitted_nominal=known, refits=[effect], by_excess=[effect], context=ladder,
        subject=ladder.subject,
    )  # fmt: skip
    refinement.refine_with_effects(state)
    assert state.nominal.subject.description == ("16 strips" if better < 0.75 else "8 strips")
    assert state.nominal.remaining_error == pytest.approx(remaining)
    assert state.nominal.tried_finer == ""


def test_a_fit_far_below_the_noise_is_compared_with_a_finer_wing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its excess is negative, by more than a right hypothesis may have: it is still the leading hypothesis."""
    monkeypatch.setattr(refinement, "finer_change", lambda *_: (0.01, 0.0))
    monkeypatch.setattr(refinement, "tolerated_excess", lambda *_: 0.1)
    monkeypatch.setattr(refinement, "_fit_at_finer", lambda _, one, *__: one)
    ladder, effect = Ladder(8, last=16), SimpleNamespace(excess=-1.0, names=("damage",))
    known = Nominal(cast("Any", ladder.subject), cast("Any", SimpleNamespace(excess=4.0, names=())), 2.0, "", ())
    state: Any = SimpleNamespace(
        data=ladder.data, nominal=known, fitted_nominal=known, refits=[effect], by_excess=[effect], context=ladder,
        subject=ladder.subject,
    )  # fmt: skip
    refinement.refine_with_effects(state)
    assert (state.nominal.subject.description, state.refits) == ("8 strips", [effect])


def test_a_wing_that_bends_at_nine_joints_is_found_by_a_strip_more() -> None:
    """Twice as many strips as the eight of the model fit no better."""
    plant = FlexibleWing(robird_wing(), "9x1", numerics=REFERENCE)
    conditions = (vacuum(10.0, 0.05, 3.0), vacuum(1000.0, 0.12, 2.5), tunnel(0.05, 3.5, 6.0))
    quiet = Tracking(noise=(5e-5, 5e-5, 5e-5))
    found = tuple(
        record(plant, base_genome(plant), one, quiet, np.random.default_rng(k)) for k, one in enumerate(conditions)
    )
    spec = DiagnosisSpec(CalibrationSpec(division="8x1"), suspects=("hinge_offset", "damage"))
    *_, last = diagnose(Dataset("wing", plant.wing, found), spec, InProcessEvaluator())
    assert last.finding is not None
    assert last.finding.verdict == "adequate"
    assert any("9 strips (1 each) replaces flexible wing of 8 bodies" in one for one in last.finding.remarks)
