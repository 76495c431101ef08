from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from scipy.signal import lfilter

from wingfit.calibration.estimates.linearised import linearise, unit_at
from wingfit.calibration.estimates.uncertainty import gene_errors
from wingfit.calibration.evaluator import as_batch, gather, run_unit, units
from wingfit.calibration.problem import Evaluation, Problem, base_genome, misfit
from wingfit.calibration.result import compare, judge
from wingfit.calibration.search import CalibrationSpec, calibrate, found, prepare, resolved
from wingfit.calibration.spec import wing_model
from wingfit.inference.noise.harmonic import noise_distance
from wingfit.records import Condition, Dataset, Gene, Genome, Recording
from wingfit.sim.virtual_rigs.campaign import Tracking, _noise
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.genes import AERODYNAMIC, STRUCTURAL

SPEC = CalibrationSpec(division="4", population=16, max_generations=4, seed=7)
THREE = ("E_r", "G_f", "L_a")


class Here:
    """Evaluates in this process; counts calls."""

    def __init__(self) -> None:
        self.individuals = 0

    def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
        batch = as_batch(values)
        self.individuals += len(batch)
        return gather(problem, [run_unit(problem, batch, u, residuals=residuals) for u in units(problem, len(batch))])

    def close(self) -> None:
        pass


def test_stages_follow_the_thesis(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    structure, air = prepare(CalibrationSpec(division="4"), dataset).stages
    assert structure.free == STRUCTURAL
    assert [r.name for r in structure.recordings] == [dataset.recordings[0].name]
    assert air.free == AERODYNAMIC
    assert [r.name for r in air.recordings] == [dataset.recordings[1].name]
    (joint,) = prepare(CalibrationSpec(division="4", mode="joint"), dataset).stages
    assert joint.free == (*STRUCTURAL, *AERODYNAMIC)
    assert len(joint.recordings) == 2


def test_everything_is_simulated_as_accurately_as_the_specification_says(small: tuple[Dataset, Genome]) -> None:
    """The search, the judgement and its standard errors, the tracks; also when it goes on from a checkpoint."""
    dataset, truth = small
    seen: list[float] = []

    class Noting(Here):
        def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
            assert isinstance(problem.model, FlexibleWing)
            seen.append(problem.model.numerics.accuracy)
            return super().evaluate(problem, values, residuals=residuals)

    spec = replace(SPEC, accuracy=3e-4, max_generations=1, population=4, genes=("E_r", "L_a"))
    first, *_ = calibrate(spec, dataset, Noting())
    assert list(calibrate(spec, dataset, Noting(), first.checkpoint))
    judge(spec, dataset, Noting(), truth.as_dict())
    assert len(seen) > 4
    assert set(seen) == {3e-4}
    assert CalibrationSpec().accuracy == wing_model(dataset, SPEC).numerics.accuracy == 1e-4


def test_fitness_is_equation_14(small: tuple[Dataset, Genome]) -> None:
    """Sum over frames and markers of squared distance, over what was recorded; the mean distance in m beside it."""
    dataset, truth = small
    model = wing_model(dataset, SPEC)
    problem = Problem(model, dataset.recordings[:1], (), truth)
    record = dataset.recordings[0]
    tracks = model.observe([truth.values], record).channels[0].reshape(record.positions.shape)
    distance = np.linalg.norm(tracks - record.positions, axis=2)
    part = misfit(problem, np.zeros((1, 0)), 0)
    assert part.squares[0] == pytest.approx(np.nansum(distance**2))
    assert part.distance[0] == pytest.approx(np.nanmean(distance))
    assert part.samples == np.isfinite(distance).sum()


def test_a_failed_individual_has_the_worst_fitness_and_a_reason(small: tuple[Dataset, Genome]) -> None:
    dataset, truth = small
    model = wing_model(dataset, SPEC)
    problem = Problem(model, dataset.recordings[1:2], ("L_a",), truth)
    part = misfit(problem, np.array([[4.0], [1e6]]), 0)
    assert np.isfinite(part.squares[0])
    assert part.squares[1] == np.inf
    assert part.reasons[0] is None
    assert part.reasons[1]


@pytest.mark.parametrize("cut", [1, 4, 6])
def test_resumed_equals_uninterrupted(small: tuple[Dataset, Genome], cut: int) -> None:
    """Cut within the first stage, at its end and within the second; the checkpoint passes through JSON."""
    dataset, _ = small
    whole = list(calibrate(SPEC, dataset, Here()))
    assert [g.stage for g in whole] == ["structure"] * 4 + ["aerodynamics"] * 4
    checkpoint = json.loads(json.dumps(whole[cut - 1].checkpoint, allow_nan=False))
    rest = list(calibrate(SPEC, dataset, Here(), checkpoint))
    assert rest == whole[cut:]
    assert found(SPEC, dataset, checkpoint)[whole[cut - 1].stage] == whole[cut - 1].genome


def test_specs_stored_by_version_0_1_mean_what_they_meant() -> None:
    stored = {
        "division": "4", "mode": "staged", "population": 16, "stall": 10, "tolerance": 1e-3, "max_generations": 4,
        "seed": 7, "bounds_factor": 5.0, "accuracy": 1e-4, "recordings": (), "genes": (), "fixed": {},
    }  # fmt: skip
    assert CalibrationSpec(**stored) == replace(SPEC, mode="staged")  # type: ignore[arg-type]


def test_mode_and_method_follow_the_dataset(small: tuple[Dataset, Genome], forces: Dataset) -> None:
    wing, vehicle = resolved(SPEC, small[0]), resolved(SPEC, forces)
    assert (wing.mode, wing.method) == ("staged", "genetic")
    assert (vehicle.mode, vehicle.method) == ("local", "gauss_newton")
    chosen = replace(SPEC, mode="joint", method="cma_es")
    assert resolved(chosen, small[0]) == resolved(chosen, forces) == chosen
    refused(replace(SPEC, mode="staged"), forces, "mode 'staged'.*use 'local'")
    refused(replace(SPEC, mode="local"), small[0], "mode 'local'.*use 'staged' or 'joint'")
    refused(replace(SPEC, mode="all"), forces, "unknown mode 'all'; there are staged, joint, local")  # type: ignore[arg-type]
    refused(replace(SPEC, method="simplex"), forces, "unknown method 'simplex'")  # type: ignore[arg-type]


def test_finishing_goes_from_the_search_to_the_bottom(small: tuple[Dataset, Genome]) -> None:
    """Each stage ends with Gauss-Newton iterations, cut and taken up in the search, at its end and among them."""
    dataset, _ = small
    spec = replace(SPEC, genes=THREE, max_generations=3, finish=True, mode="joint")
    whole = list(calibrate(spec, dataset, Here()))
    names = [g.stage for g in whole]
    assert names[:3] == ["joint"] * 3
    assert set(names[3:]) == {"joint, Gauss-Newton"}
    assert whole[-1].best < whole[2].best
    assert whole[-1].progress == 1
    assert all(a.progress <= b.progress < 1 for a, b in pairwise(whole[:-1]))
    assert list(whole[-1].checkpoint["found"]) == ["joint"]
    assert whole[-1].checkpoint["found"]["joint"] == whole[-1].genome
    for cut in (2, 3, 4):
        checkpoint = json.loads(json.dumps(whole[cut - 1].checkpoint, allow_nan=False))
        assert list(calibrate(spec, dataset, Here(), checkpoint)) == whole[cut:]


def test_cma_es_searches_too_and_resumes(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    spec = replace(SPEC, genes=THREE, method="cma_es", population=8)
    whole = list(calibrate(spec, dataset, Here()))
    assert [g.stage for g in whole] == ["structure"] * 4 + ["aerodynamics"] * 4
    assert whole[3].best < whole[0].best
    assert whole[-1].evaluations == 64
    for cut in (1, 4, 6):
        checkpoint = json.loads(json.dumps(whole[cut - 1].checkpoint, allow_nan=False))
        assert list(calibrate(spec, dataset, Here(), checkpoint)) == whole[cut:]


def test_history_is_monotone_and_complete(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    evaluator = Here()
    history = list(calibrate(SPEC, dataset, evaluator))
    assert history[-1].evaluations == evaluator.individuals == 8 * 16
    assert history[-1].progress == 1
    assert all(a.progress <= b.progress for a, b in pairwise(history))
    for stage in ("structure", "aerodynamics"):
        best = [g.best for g in history if g.stage == stage]
        assert best == sorted(best, reverse=True)
        assert best[-1] < best[0]
    assert set(history[-1].genome) == {*STRUCTURAL, *AERODYNAMIC}


def test_result_judges_fitted_and_held_out_recordings(small: tuple[Dataset, Genome]) -> None:
    dataset, truth = small
    result = judge(SPEC, dataset, Here(), truth.as_dict())
    assert result.after < result.before
    assert result.held_out_after is not None
    assert result.held_out_before is not None
    assert result.held_out_after < result.held_out_before
    assert result.noise == pytest.approx(result.held_out_after, rel=0.15), "the truth leaves the noise"
    assert [r.held_out for r in result.recordings] == [False, False, True, True]
    shares = [g.best for g in result.genes if g.name.startswith("L_") and g.name[2:].isdigit()]
    assert sum(shares) == pytest.approx(1)


def test_noise_is_estimated_from_the_scatter_between_beats(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    sx, sy, sz = Tracking().noise
    draws = np.random.default_rng(0).normal(size=(200_000, 3)) * (sx, sy, sz)
    expected = np.linalg.norm(draws, axis=1).mean() * np.exp(0.2**2 / 2)
    assert noise_distance(dataset.recordings) == pytest.approx(expected, rel=0.12)


def test_standing_tells_what_the_data_ignore(small: tuple[Dataset, Genome]) -> None:
    """Rod stiffness shows; in vacuum the air does not, and its error is that of the box."""
    dataset, truth = small
    model = wing_model(dataset, SPEC)
    problem = Problem(model, dataset.recordings[:1], ("E_r", "G_f", "L_1"), truth)
    known = gene_errors(problem, Here()).standing
    assert known["E_r"].identifiable
    assert known["E_r"].standard_error < 0.02
    alone = gene_errors(Problem(model, dataset.recordings[:1], ("ID_b",), truth), Here()).standing
    assert not alone["ID_b"].identifiable


def test_standard_errors_are_honest(small: tuple[Dataset, Genome]) -> None:
    """Refits to fresh coloured noise, the beat placed anew each time, scatter as the stated error says.

    One Gauss-Newton step from the truth for each of 60 draws: 9 % is the standard error of such a scatter.
    """
    dataset, truth = small
    model, record = wing_model(dataset, SPEC), dataset.recordings[0]
    names = ("E_r", "G_f", "D_E")
    problem = Problem(model, (record,), names, truth)
    clean = model.observe([truth.values], record).channels[0]
    unit = unit_at(_free(problem), np.array([truth[n] for n in names]))
    linear = linearise(Problem(model, (replace(record, values=clean),), names, truth), Here(), unit)
    # residuals by the logarithms of the genes
    slope = linear.sensitivities[0].reshape(-1, 3) / np.log([gene.upper / gene.lower for gene in _free(problem)])
    pull, shape = np.linalg.pinv(slope), record.positions.shape
    fits = []
    for k in range(60):
        noise = _noise(shape, Tracking(beats=2), np.random.default_rng(1000 + k)).reshape(clean.shape)
        drawn = Problem(model, (replace(record, values=clean + noise),), names, truth)
        residual = misfit(drawn, np.array([[truth[n] for n in names]]), 0, residuals=True).residuals
        assert residual is not None
        fits.append(pull @ residual.ravel())
    stated = gene_errors(problem, Here()).standing
    for gene, scatter in zip(_free(problem), np.std(fits, axis=0), strict=True):
        assert stated[gene.name].standard_error == pytest.approx(scatter, rel=0.5), gene.name


def _free(problem: Problem) -> list[Gene]:
    return [gene for gene in problem.model.genes if gene.name in problem.free]


def test_a_share_searched_alone_keeps_the_rest_of_its_group(small: tuple[Dataset, Genome]) -> None:
    """With three of four weights fixed, the share still has an error; and it is smaller than with all four free."""
    dataset, truth = small
    model = wing_model(dataset, SPEC)
    alone = gene_errors(Problem(model, dataset.recordings[1:2], ("L_1",), truth), Here()).standing["L_1"]
    weights = ("L_1", "L_2", "L_3", "L_4")
    among = gene_errors(Problem(model, dataset.recordings[1:2], weights, truth), Here()).standing["L_1"]
    assert 1e-4 < alone.standard_error < among.standard_error


def test_a_gene_whose_neighbours_fail_has_no_error_and_stops_nothing(small: tuple[Dataset, Genome]) -> None:
    dataset, truth = small

    class Fragile(Here):
        """Fails every individual whose L_a is not the truth's."""

        def evaluate(self, problem: Problem, values: npt.ArrayLike, *, residuals: bool = False) -> Evaluation:
            found = super().evaluate(problem, values, residuals=residuals)
            off = as_batch(values)[:, problem.free.index("L_a")] != truth["L_a"]
            parts = [
                replace(p, reasons=tuple("broken" if o else r for o, r in zip(off, p.reasons, strict=True)))
                for p in found.per_recording
            ]
            return Evaluation(tuple(parts))

    model = wing_model(dataset, SPEC)
    known = gene_errors(Problem(model, dataset.recordings[1:2], ("L_a", "L_b"), truth), Fragile()).standing
    assert known["L_a"].standard_error == np.inf
    assert not known["L_a"].identifiable
    assert known["L_b"].standard_error < 0.1


def test_comparison_lies_on_the_recording(small: tuple[Dataset, Genome]) -> None:
    dataset, truth = small
    record = dataset.recordings[1]
    laid = compare(CalibrationSpec(division="4"), dataset, truth.as_dict(), record.name)
    assert laid.recorded.shape == laid.simulated.shape == (len(record.times), len(record.markers), 3)
    assert np.all((laid.phase >= 0) & (laid.phase < 1))
    assert np.nanmean(np.linalg.norm(laid.recorded - laid.simulated, axis=2)) < 1.2e-3
    reference = [record.markers.index(m) for m in dataset.wing.reference_markers if m in record.markers]
    assert laid.accuracy == CalibrationSpec().accuracy
    assert 0 < laid.solution.error <= laid.accuracy
    assert laid.solution.steps >= 64
    assert laid.solution.beats > 1
    near = (laid.phase < 0.05) | (laid.phase > 0.95)
    assert np.abs(laid.simulated[near][:, reference, 2].mean(axis=1)).max() < 0.06, "phase 0 is the horizontal"


def refused(spec: CalibrationSpec, dataset: Dataset, match: str) -> None:
    with pytest.raises(ValueError, match=match):
        prepare(spec, dataset)


def test_specs_that_do_not_fit_are_refused_with_what_would(small: tuple[Dataset, Genome], marker_only: Dataset) -> None:
    dataset, _ = small
    refused(replace(SPEC, division="7"), dataset, "preset")
    refused(replace(SPEC, accuracy=0.0), dataset, "accuracy is 0.0 m; it must be a positive number")
    refused(replace(SPEC, recordings=("nope",)), dataset, "no recording 'nope'")
    refused(replace(SPEC, recordings=(dataset.held_out[0],)), dataset, "held out")
    refused(replace(SPEC, genes=("E_x",)), dataset, "unknown gene 'E_x'")
    refused(replace(SPEC, fixed={"E_f": 1.0}), dataset, r"E_f.* must lie in")
    refused(replace(SPEC, fixed=nominal_values(dataset)), dataset, "nothing")
    refused(replace(SPEC, recordings=(dataset.recordings[1].name,)), dataset, "vacuum")
    refused(SPEC, marker_only, "recording")
    twice = (dataset.recordings[0].name,) * 2
    refused(replace(SPEC, recordings=twice), dataset, "2 times")


@pytest.mark.parametrize("which", [0, 2], ids=["fitted", "held out"])
def test_recordings_that_cannot_be_judged_are_refused_before_the_search(
    small: tuple[Dataset, Genome], which: int
) -> None:
    dataset, _ = small

    def without(record: Recording, columns: slice) -> Dataset:
        values = record.values.copy()
        values[:, columns] = np.nan
        changed = [replace(r, values=values) if r is record else r for r in dataset.recordings]
        return replace(dataset, recordings=tuple(changed))

    record = dataset.recordings[which]
    refused(SPEC, without(record, slice(0, None, 3)), "nothing to compare")
    refused(SPEC, without(record, slice(2, None, 3)), "nothing to compare")
    blind = [k for k, m in enumerate(record.markers) if m in dataset.wing.reference_markers]
    values = record.positions.copy()
    values[:, blind] = np.nan
    changed = [replace(r, values=values.reshape(len(values), -1)) if r is record else r for r in dataset.recordings]
    refused(SPEC, replace(dataset, recordings=tuple(changed)), "reference markers")


def test_noise_of_degenerate_tracks_is_a_number_or_none(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    record = dataset.recordings[0]
    still = replace(record, values=np.zeros_like(record.values))
    assert noise_distance((still,)) is None, "nothing moves: nothing was tracked"
    blinking = record.values.copy()
    blinking[::2] = np.nan
    found = noise_distance((replace(record, values=blinking),))
    assert found is None or found > 0
    assert noise_distance((replace(record, values=np.full_like(record.values, np.nan)),)) is None


def test_noise_estimate_scales_to_long_recordings() -> None:
    """Twenty thousand frames (a minute of motion capture) in seconds, with the right answer."""
    rng = np.random.default_rng(3)
    frames = 20_000
    noise = 5e-4 * lfilter([1.0], [1.0, -0.8], rng.normal(size=(frames, 6)), axis=0) * 0.6
    times = np.arange(frames) / 330.0
    wave = 0.1 * np.sin(2 * np.pi * 3.0 * times)[:, None]
    condition = Condition(3.0, 0.0, 1e5, 293.0)
    record = Recording("long", "wind_tunnel", condition, times, ("a", "b"), wave + noise)
    expected = np.linalg.norm(noise.reshape(frames, 2, 3), axis=2).mean()
    assert noise_distance((record,)) == pytest.approx(expected, rel=0.02)


def nominal_values(dataset: Dataset) -> Mapping[str, float]:
    return base_genome(wing_model(dataset, SPEC)).as_dict()


def test_a_poor_fit_tells_no_gene_and_says_why(small: tuple[Dataset, Genome]) -> None:
    """Standard errors count on a misfit that is noise; with the nominal genome it is far more."""
    dataset, truth = small
    poor = judge(SPEC, dataset, Here(), nominal_values(dataset))
    assert not any(gene.identifiable for gene in poor.genes)
    assert any("times the tracking noise" in remark for remark in poor.remarks)
    good = judge(SPEC, dataset, Here(), truth.as_dict())
    assert good.remarks == ()
    assert any(gene.identifiable for gene in good.genes)


def test_a_misfit_beyond_a_fifth_of_the_span_points_to_the_checks(small: tuple[Dataset, Genome]) -> None:
    """Tracks of a left wing: no discretisation and no effect brings the simulation near them."""
    dataset, truth = small
    left = tuple(
        replace(one, values=(one.positions * [1.0, -1.0, 1.0]).reshape(one.values.shape)) for one in dataset.recordings
    )
    found = judge(SPEC, replace(dataset, recordings=left), Here(), truth.as_dict())
    assert found.after > 0.2 * dataset.wing.span
    assert any("likely disagree" in remark and "wingfit datasets check" in remark for remark in found.remarks)
    assert not any("finer discretisation" in remark for remark in found.remarks)


def test_a_gene_at_its_bound_is_not_told(small: tuple[Dataset, Genome]) -> None:
    from wingfit.calibration.result import _at_bound

    dataset, _ = small
    nominal = base_genome(wing_model(dataset, SPEC))
    gene = nominal.genes[0]
    assert not _at_bound(gene, nominal)
    assert _at_bound(gene, nominal.replace({gene.name: gene.lower}))
    assert _at_bound(gene, nominal.replace({gene.name: gene.upper}))


def test_estimates_in_another_unit_are_refused(small: tuple[Dataset, Genome]) -> None:
    dataset, _ = small
    gigapascal = replace(dataset, rig=replace(dataset.wing, estimates={"E_r": 180.0}))
    refused(SPEC, gigapascal, r"E_r.* Pa.*check its unit")
