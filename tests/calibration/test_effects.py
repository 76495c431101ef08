"""Effects in calibrations: stages, what is refused, and searches of sizes that start at zero."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.calibration.conftest import FORCE_TRUTHS
from tests.calibration.linear import blank
from tests.calibration.test_search import Here
from wingfit.calibration.effects import absent, effect_of, group_of
from wingfit.calibration.estimates.likelihood import Step, estimate, iterate
from wingfit.calibration.estimates.linearised import free_genes, unit_at, values_at
from wingfit.calibration.estimates.uncertainty import uncertainty
from wingfit.calibration.forces.result import ForceResult
from wingfit.calibration.initial_effect_position import placed
from wingfit.calibration.problem import Problem, base_genome
from wingfit.calibration.search import CalibrationSpec, calibrate, model_for, prepare
from wingfit.calibration.summary import summarise
from wingfit.records import Dataset, Gene, Genome, Recording
from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.model import Array, Observation, genome_batch
from wingfit.sim.wing.genes import AERODYNAMIC, STRUCTURAL

SHIFT = ("camera_shift.x", "camera_shift.y", "camera_shift.z")
SPEC = CalibrationSpec(division="4", effects=("camera_shift",), population=6, max_generations=2, seed=7)


def _unseen(scene: WingScene, values: Values) -> None:
    """Tracks show nothing of it."""


@pytest.fixture
def bump(monkeypatch: pytest.MonkeyPatch) -> Effect:
    """An effect that sits at a place, entered in the registry."""
    found = Effect(
        name="bump",
        title="A bump",
        family="aerodynamics",
        port="air",
        size=(Parameter("size", "1", -1.0, 1.0, 0.3, "height"),),
        shape=(Parameter("place", "1", 0.0, 1.0, 0.5, "where", place=True),),
        law="y = size",
        source="none",
        signature="a bump",
        confused_with=(),
        wing=_unseen,
    )
    monkeypatch.setitem(EFFECTS, "bump", found)
    return found


@dataclass(frozen=True)
class Bumpy:
    """A sine of amplitude a, and the bump, ``width`` of the beat wide; no bump beyond the place ``end``."""

    width: float = 0.1
    lower: float = -1.0
    end: float = 1.0

    @property
    def genes(self) -> tuple[Gene, ...]:
        return (
            Gene("a", "1", 1.0, -4.0, 6.0, "linear", "a"),
            Gene("bump.size", "1", 0.0, self.lower, 1.0, "linear", "height"),
            Gene("bump.place", "1", 0.5, 0.0, 1.0, "linear", "where"),
        )

    @property
    def searched(self) -> tuple[str, ...]:
        return tuple(gene.name for gene in self.genes)

    def observe(self, genomes: Array, recording: Recording) -> Observation:
        batch = genome_batch(self.genes, genomes)
        phase = recording.times * recording.condition.flap_frequency % 1.0
        bump = np.exp(-(((phase - batch[:, 2:]) / self.width) ** 2))
        forces = 0.1 * (batch[:, :1] * np.sin(2 * np.pi * phase) + batch[:, 1:2] * bump)
        bad = (batch[:, 1] != 0.0) & (batch[:, 2] > self.end)
        forces[bad] = np.nan
        return Observation(forces[:, :, None], tuple("broken" if one else None for one in bad))


def bumpy(model: Bumpy, size: float, place: float) -> Problem:
    """A recording with such a bump and some noise; all genes free."""
    empty = blank(320)
    clean = Bumpy(model.width).observe(np.array([[1.3, size, place]]), empty).channels[0]
    noisy = clean + 1e-3 * np.random.default_rng(3).normal(size=clean.shape)
    return Problem(model, (replace(empty, values=noisy),), model.searched, base_genome(model), ("x",))


def shifted(dataset: Dataset, shift: Array) -> Dataset:
    """``dataset`` seen by cameras whose frame is off by ``shift`` (m)."""
    moved = [replace(r, values=(r.positions + shift).reshape(r.values.shape)) for r in dataset.recordings]
    return replace(dataset, recordings=tuple(moved))


def refused(dataset: Dataset, said: str, **spec: object) -> None:
    with pytest.raises(ValueError, match=said):
        prepare(replace(SPEC, **spec), dataset)  # type: ignore[arg-type]


@pytest.mark.usefixtures("bump")
def test_aerodynamic_effects_are_fitted_in_air_and_all_others_in_vacuum(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    structure, air = prepare(replace(SPEC, effects=("bump", "camera_shift")), dataset).stages
    assert structure.free == (*STRUCTURAL, *SHIFT)
    assert air.free == (*AERODYNAMIC, "bump.size", "bump.place")
    assert (group_of("camera_shift.x"), group_of("bump.place"), group_of("E_f")) == (
        "structure",
        "aerodynamics",
        "structure",
    )
    structure, air = prepare(replace(SPEC, effects=("residual_air",)), dataset).stages
    assert "residual_air.density" in structure.free, "the air that remains in a vacuum shows there alone"
    assert "residual_air.density" not in air.free
    assert effect_of("E_f") is effect_of("bump") is effect_of("bump.colour") is effect_of("nothing.x") is None


@pytest.mark.usefixtures("bump")
def test_genes_of_effects_are_named_and_fixed_like_others(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    (stage,) = prepare(replace(SPEC, mode="joint", genes=("camera_shift.y", "L_a")), dataset).stages
    assert stage.free == ("L_a", "camera_shift.y")
    held = replace(SPEC, mode="joint", genes=("L_a",), fixed={"camera_shift.z": 1e-3})
    first = next(calibrate(held, dataset, Here()))
    assert (first.genome["camera_shift.z"], first.genome["camera_shift.x"]) == (1e-3, 0.0)
    refused(dataset, "'camera_shift' would stay switched off: none of camera_shift.x, .* is searched", genes=("L_a",))
    refused(dataset, "'bump' would stay switched off", effects=("bump",), genes=("L_a", "bump.place"))
    refused(dataset, "gene 'camera_shift.x' is 1 m; it must lie in", fixed={"camera_shift.x": 1.0})
    refused(dataset, "unknown gene 'camera_shift.x'", effects=(), genes=("camera_shift.x",))


@pytest.mark.usefixtures("bump")
def test_effects_that_cannot_be_are_refused(small: tuple[Dataset, Genome], forces: Dataset) -> None:
    dataset, _ = small
    refused(dataset, "unknown effect 'added_moss'; there are .*camera_shift", effects=("added_moss",))
    refused(dataset, "'bump' is named 2 times; name it once", effects=("bump", "bump"))
    with pytest.raises(ValueError, match="'bump' does not apply to a vehicle"):
        prepare(CalibrationSpec(effects=("bump",)), forces)


def test_the_bounds_of_an_effect_are_its_own(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    wide, narrow = (model_for(dataset, replace(SPEC, bounds_factor=factor)).genes for factor in (5.0, 1.5))
    assert wide[-3:] == narrow[-3:]
    assert wide[0] != narrow[0]
    assert [gene.name for gene in wide[-3:]] == list(SHIFT)


@pytest.mark.parametrize("method", ["genetic", "cma_es"])
def test_a_search_starts_with_the_effect_switched_off(small: tuple[Dataset, Genome], method: str) -> None:
    """Its first individual is the nominal one, so that its best is never worse than what there is without."""
    dataset, _ = small
    spec = replace(SPEC, mode="joint", method=method, genes=(*SHIFT, "L_a"))  # type: ignore[arg-type]
    first, second = calibrate(spec, dataset, Here())
    alone = Problem(model_for(dataset, spec), dataset.fitted, ("L_a",), base_genome(model_for(dataset, spec)))
    nominal = Here().evaluate(alone, [[alone.base["L_a"]]]).fitness[0]
    assert second.best <= first.best <= nominal * (1 + 1e-9)
    assert np.isfinite([first.mean, first.diversity]).all()
    checkpoint = json.loads(json.dumps(first.checkpoint, allow_nan=False))
    assert list(calibrate(spec, dataset, Here(), checkpoint)) == [second]


def test_gauss_newton_finds_a_typical_shift_of_the_cameras(small: tuple[Dataset, Genome]) -> None:
    """From zero, beside a gene of the wing that starts at its estimate; the remaining error is noise."""
    dataset, truth = small
    typical = EFFECTS["camera_shift"].typical(dataset.wing)
    seen = shifted(dataset, np.array(list(typical.values())))
    fixed = {name: value for name, value in truth.as_dict().items() if name != "E_r"}
    spec = replace(SPEC, mode="joint", method="gauss_newton", max_generations=20, fixed=fixed, bounds_factor=10.0)
    *_, last = calibrate(spec, seen, Here())
    for name, value in typical.items():
        assert last.genome[name] == pytest.approx(value, abs=0.03 * value), name
    assert last.genome["E_r"] == pytest.approx(truth["E_r"], rel=0.05)


def test_gauss_newton_finds_a_typical_offset_of_a_balance_on_each_recording(forces: Dataset) -> None:
    """Without being named; that of an axis that is not fitted stays at zero and does not count as identifiable."""
    typical = EFFECTS["balance_offset"].typical(forces.vehicle)
    spec = CalibrationSpec(effects=("balance_offset",))
    model = model_for(forces, spec)
    shown = []
    for record, truth in zip(forces.recordings, FORCE_TRUTHS, strict=True):
        plain, off = (base_genome(model, truth | more).values for more in ({}, typical))
        clean, moved = model.observe(np.array([plain, off]), record).channels
        shown.append(replace(record, values=record.values + moved - clean))
    dataset = replace(forces, recordings=tuple(shown))
    *_, last = calibrate(spec, dataset, Here())
    for record, truth in zip(dataset.recordings, FORCE_TRUTHS, strict=True):
        found = last.checkpoint["found"][record.name]
        assert found["balance_offset.x"] == pytest.approx(typical["balance_offset.x"], rel=0.1)
        assert found["balance_offset.z"] == 0.0
        assert found["C_l"] == pytest.approx(truth["C_l"], rel=0.05)
    result = summarise(spec, dataset, Here(), last.checkpoint)
    told = {gene.name: gene.identifiable for gene in result.genes}
    assert told["balance_offset.z"] is False
    assert isinstance(result, ForceResult)
    known = {gene.name: gene.absolute_error for gene in result.genes}
    errors = [one.standard_errors["balance_offset.x"] for one in result.estimates]
    assert known["balance_offset.x"] == max(errors)
    assert 0 < max(errors) < 0.1 * typical["balance_offset.x"]
    assert result.after < 0.5 * result.before


@pytest.mark.usefixtures("bump")
@pytest.mark.parametrize("lower", [-1.0, 0.0])
@pytest.mark.parametrize("place", [0.12, 0.3, 0.85])
def test_gauss_newton_finds_an_effect_far_from_its_usual_place(place: float, lower: float) -> None:
    """At zero size nothing says where the effect is, and from its usual place the bump cannot be seen."""
    found = estimate(bumpy(Bumpy(lower=lower), 0.3, place), Here(), {})
    assert found.converged
    assert found.values["bump.place"] == pytest.approx(place, abs=0.01)
    assert found.values["bump.size"] == pytest.approx(0.3, rel=0.05)
    assert found.uncertainty.standing["bump.place"].identifiable


@pytest.mark.usefixtures("bump")
def test_the_start_of_an_effect_changes_nothing_that_is_simulated() -> None:
    problem = bumpy(Bumpy(), 0.3, 0.85)
    genes = free_genes(problem)
    unit = unit_at(genes, np.array([gene.nominal for gene in genes]))
    start, evaluated = placed(problem, Here(), unit)
    values = values_at(genes, start[None])[0]
    assert values[:2].tolist() == [1.0, 0.0]
    assert values[2] == pytest.approx(0.85, abs=0.05)
    before, after = Here().evaluate(problem, values_at(genes, np.stack([unit, start]))).fitness
    assert before == after
    first = next(iterate(problem, here := Here(), {}))
    assert first.evaluations == here.individuals > evaluated > 0
    on = unit_at(genes, np.array([1.0, 0.1, 0.5]))  # an effect that is on stands where it was put
    untouched, evaluated = placed(problem, Here(), on)
    assert (untouched.tolist(), evaluated) == (on.tolist(), 0)


@pytest.mark.usefixtures("bump")
def test_places_that_cannot_be_simulated_are_not_started_from() -> None:
    found = estimate(bumpy(Bumpy(end=0.6), 0.3, 0.3), Here(), {})
    assert found.values["bump.place"] == pytest.approx(0.3, abs=0.01)


@pytest.mark.usefixtures("bump")
def test_an_interrupted_iteration_does_not_place_again() -> None:
    problem = bumpy(Bumpy(), 0.3, 0.85)
    steps: list[Step] = list(iterate(problem, Here(), {}))
    checkpoint = json.loads(json.dumps(steps[0].checkpoint))
    assert list(iterate(problem, Here(), {}, checkpoint)) == steps[1:]


@pytest.mark.usefixtures("bump")
def test_an_effect_that_is_not_there_is_found_at_zero_and_its_place_not_determined() -> None:
    """The data show the opposite of what a one-sided size can do."""
    problem = bumpy(Bumpy(lower=0.0, width=0.5), -0.3, 0.5)
    found = estimate(problem, Here(), {})
    assert found.values["bump.size"] == 0.0
    assert np.isfinite(found.uncertainty.correlation).all()
    assert not found.uncertainty.standing["bump.place"].identifiable
    assert not any("bound" in remark and "bump.size" in remark for remark in found.remarks)
    (said,) = absent(found.values, problem.free)
    assert said == "effect 'bump' is switched off in the best genome, and bump.place is not determined"
    assert absent(found.values | {"bump.size": 0.1}, problem.free) == ()


@pytest.mark.usefixtures("bump")
def test_the_uncertainty_at_zero_size_is_that_of_the_rest() -> None:
    """The place has no slope there, and changes nothing of what is known of the others."""
    problem = bumpy(Bumpy(), 0.0, 0.5)
    with_place = uncertainty(problem, Here())
    without = uncertainty(replace(problem, free=("a", "bump.size")), Here())
    assert np.isfinite(with_place.covariance).all()
    np.testing.assert_allclose(with_place.covariance[:2, :2], without.covariance, rtol=1e-6)
    assert any("bump.place is not identifiable" in remark for remark in with_place.remarks)
    assert with_place.standing["bump.place"].standard_error > 0.5
