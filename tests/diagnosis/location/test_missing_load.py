"""The location, instant, size and error of a load unknown to the model; none where there is none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import numpy.typing as npt
import pytest

from tests.diagnosis.loaded import (
    CONDITIONS,
    LAG1,
    case,
    chord_at,
    model,
    noise,
    nominal,
    of_samples,
    recorded_tracks,
    with_drive_error,
    with_load,
)
from wingfit.diagnosis.finding import Interval
from wingfit.diagnosis.location.missing_load import PHASES, Case, LoadPlace, infer, locate_load, missing_loads
from wingfit.diagnosis.location.missing_physics import missing_force
from wingfit.sim.effects.probe import Probe
from wingfit.sim.wing.probing import Probed

Array = npt.NDArray[np.float64]

PROBE, DRIVING = Probe(), Probe(driving=True)
PLACE, WHEN, SIZE = 0.7, 0.3, 10.0


@cache
def cases() -> tuple[tuple[Case, Probed], ...]:
    """A wing of six strips with a load at 70 % of its span, 0.3 beats after the crossing."""
    plant = replace(model("6x1"), probe=Probe(tuple(np.linspace(0.0, 1.0, 21).tolist()), 12))
    found = []
    for k, condition in enumerate(CONDITIONS):
        genome = with_load(plant, condition, PLACE, WHEN, SIZE)
        recording = recorded_tracks(plant, genome, condition, np.random.default_rng(k))
        found.append(case(model("6x1"), recording, PROBE))
    return tuple(found)


@cache
def drive_error_cases(*turns_deg: float) -> tuple[tuple[Case, Probed], ...]:
    """The same wing without a load, its front and rear rod turned further for a moment."""
    plant, found = replace(model("6x1"), probe=Probe((0.0, 1.0), 12, driving=True)), []
    for k, condition in enumerate(CONDITIONS):
        recording = recorded_tracks(
            plant, with_drive_error(plant, condition, WHEN, turns_deg), condition, np.random.default_rng(k)
        )
        found.append(case(model("6x1"), recording, DRIVING))
    return tuple(found)


def test_a_drive_error_is_no_load() -> None:
    inferred = infer([one for one, _ in drive_error_cases(1.0, 1.0)], DRIVING)
    found = locate_load(inferred)
    assert inferred.drive_error
    assert found is not None
    assert found.span is found.chord is None
    assert found.phase is not None
    assert abs(found.phase.value - WHEN) < 10.0 / 360.0
    motions = missing_loads(inferred)
    assert [motion.rod for motion in motions] == [*["front"] * len(CONDITIONS), *["rear"] * len(CONDITIONS)]
    for motion in motions:
        values = np.degrees(motion.values[0])
        assert motion.unit == "rad"
        assert abs(motion.phase[int(np.argmax(values))] - WHEN) < 10.0 / 360.0
        assert values.max() - values.mean() == pytest.approx(0.87, abs=0.15)  # of one degree, without the mean


def test_an_error_of_the_rear_rod_alone_is_identified() -> None:
    inferred = infer([one for one, _ in drive_error_cases(0.0, 1.0)], DRIVING)
    assert inferred.drive_error
    motions = missing_loads(inferred)
    rear = [motion for motion in motions if motion.rod == "rear"]
    assert [motion.recording for motion in rear] == list(inferred.names)
    for motion in rear:
        values = np.degrees(motion.values[0])
        assert abs(motion.phase[int(np.argmax(values))] - WHEN) < 10.0 / 360.0
        assert values.max() - values.mean() == pytest.approx(0.87, abs=0.15)
    for motion in (one for one in motions if one.rod != "rear"):
        assert np.abs(np.degrees(motion.values)).max() < 0.3


def test_a_load_is_no_drive_error() -> None:
    plant = replace(model("6x1"), probe=Probe(tuple(np.linspace(0.0, 1.0, 21).tolist()), 12))
    found = []
    for k, condition in enumerate(CONDITIONS[:2]):
        recording = recorded_tracks(
            plant, with_load(plant, condition, PLACE, WHEN, SIZE), condition, np.random.default_rng(k)
        )
        found.append(case(model("6x1"), recording, DRIVING)[0])
    inferred = infer(found, DRIVING)
    assert not inferred.drive_error
    assert span_of(locate_load(inferred)).value == pytest.approx(PLACE, abs=0.1)


def span_of(found: LoadPlace | None) -> Interval:
    """The location along the span, which must exist."""
    assert found is not None
    assert found.span is not None
    return found.span


def noise_case(one: Case, rng: np.random.Generator, size: Array | None = None) -> Case:
    """The case with noise alone, or with a load of ``size`` [P] as well."""
    residual = rng.standard_normal(len(one.residual))
    return replace(one, residual=residual if size is None else residual + one.responses @ size)


def test_a_load_is_located_with_all_genes_free() -> None:
    inferred = infer([one for one, _ in cases()], PROBE, response_error=0.0)
    found = locate_load(inferred)
    assert found is not None
    assert found.phase is not None
    assert found.chord is None
    assert abs(found.phase.value - WHEN) < 10.0 / 360.0
    span = span_of(found)
    assert abs(span.value - PLACE) < 0.05
    assert span.low is not None
    assert span.high is not None
    assert span.high - span.low < 0.35
    assert found.duration[0] > WHEN - 0.12
    assert found.duration[1] < WHEN + 0.12
    assert found.extent[0] > 0.2
    for load in missing_loads(inferred):
        values = np.array(load.values)
        assert values.shape == (len(PROBE.stations), PHASES)
        station, instant = np.unravel_index(np.argmax(values), values.shape)
        assert load.stations[station] in (0.5, 0.75)
        assert abs(load.phase[instant] - WHEN) < 10.0 / 360.0
        assert values[station, instant] > 5 * np.array(load.errors)[:, (instant + PHASES // 2) % PHASES].min()


def test_response_error_widens_the_location() -> None:
    sure, doubtful = (
        locate_load(infer([one for one, _ in cases()], PROBE, response_error=response_error))
        for response_error in (0.0, 0.002)
    )
    assert abs(span_of(doubtful).value - PLACE) < 0.05
    spans = [span_of(one) for one in (sure, doubtful)]
    ends = [span.high - span.low for span in spans if span.high and span.low]
    assert ends[1] > 2 * ends[0]


@pytest.mark.parametrize("part", [0.2, 0.9])
def test_the_chord_location_of_a_load(part: float) -> None:
    plant = replace(model("6x1"), probe=Probe(tuple(np.linspace(0.0, 1.0, 21).tolist()), 4, turning=True))
    probe = Probe(harmonics=4, turning=True)
    found = []
    for k, condition in enumerate(CONDITIONS[:2]):
        genome = with_load(plant, condition, PLACE, WHEN, SIZE, part)
        recording = recorded_tracks(plant, genome, condition, np.random.default_rng(k))
        found.append(case(model("6x1"), recording, probe)[0])
    located = locate_load(infer(found, probe, chord_at(plant, probe.stations)))
    assert located is not None
    assert located.chord is not None
    assert abs(located.chord.value - part) < 0.1
    assert abs(span_of(located).value - PLACE) < 0.15


def test_a_probe_with_moments_needs_the_chord() -> None:
    with pytest.raises(ValueError, match="chord at each of its 5 stations"):
        infer([cases()[0][0]], replace(PROBE, turning=True))


def test_noise_alone_is_no_load() -> None:
    rng = np.random.default_rng(5)
    for _ in range(5):
        assert locate_load(infer([noise_case(one, rng) for one, _ in cases()], PROBE)) is None


def test_errors_match_the_scatter_of_estimates() -> None:
    """Random localised loads are inferred with z-scores of about one."""
    rng = np.random.default_rng(6)
    span, scores = np.linspace(0.1, 0.9, 5), []
    hats = PROBE.hats(np.linspace(0.0, 1.0, 401))
    for _ in range(12):
        centre = rng.uniform(0.2, 0.9)
        shape = np.linalg.lstsq(hats, np.exp(-0.5 * ((np.linspace(0, 1, 401) - centre) / 0.15) ** 2), rcond=None)[0]
        fall = np.concatenate([[1.0], np.tile(1.0 / np.arange(1, PROBE.harmonics + 1), 2)])
        sizes = [np.outer(shape, fall * rng.standard_normal(len(fall))).ravel() for _ in cases()]
        drawn = [noise_case(one, rng, 2.0 * size) for (one, _), size in zip(cases(), sizes, strict=True)]
        phase = np.arange(12) / 12
        values, errors = infer(drawn, PROBE, response_error=0.0).fields(span, phase)
        for r, size in enumerate(sizes):
            truth = np.kron(PROBE.hats(span), PROBE.terms(phase + drawn[r].crossing)) @ (2.0 * size)
            scores.append((values[r].ravel() - truth) / errors[r].ravel())
    spread = float(np.sqrt(np.mean(np.square(scores))))
    assert 0.6 < spread < 1.4
    assert np.mean(np.abs(scores) < 1.645) > 0.8


def test_an_unexplained_residual_raises_the_noise() -> None:
    one = cases()[0][0]
    rough = replace(one, residual=one.residual + 3.0 * np.random.default_rng(1).standard_normal(len(one.residual)))
    plain, worse = (infer([c], PROBE).floor[0] for c in (one, rough))
    assert worse == pytest.approx(np.hypot(plain, 3.0), rel=0.05)


def test_coloured_noise_is_whitened() -> None:
    rng = np.random.default_rng(2)
    residuals = noise((400, 6), rng)
    residuals[rng.uniform(size=residuals.shape) < 0.2] = np.nan
    nothing = np.zeros((400, 6, 1))
    white = of_samples("", residuals, LAG1, nothing, nothing, 0.0).residual
    assert len(white) == np.isfinite(residuals).sum()
    assert abs(np.std(white) - 1.0) < 0.05
    assert abs(np.mean(white[1:] * white[:-1])) < 0.06


def test_missing_force_of_force_recordings() -> None:
    rng, phase = np.random.default_rng(3), np.asarray(np.arange(300) * 0.0337 % 1.0, float)
    residual = np.asarray(0.2 * np.cos(2 * np.pi * (phase - 0.25)) + 0.05, float)
    off = [missing_force("run", 0.02 * rng.normal(size=300) - residual, phase, 0.02, 0.0) for _ in range(20)]
    at = np.array(off[0].phase)
    scores = [
        (np.array(one.values[0]) - 0.2 * np.cos(2 * np.pi * (at - 0.25)) - 0.05) / np.array(one.errors[0])
        for one in off
    ]
    assert 0.8 < float(np.sqrt(np.mean(np.square(scores)))) < 1.2
    assert off[0].unit == "N"


def test_no_cases_are_refused() -> None:
    with pytest.raises(ValueError, match="at least one"):
        infer([], PROBE)


def test_a_wrong_gene_is_no_load() -> None:
    """A wrong gene, the same under all conditions, is not inferred as a load."""
    rng = np.random.default_rng(4)
    genes = len(nominal(model("6x1")))
    wrong = 0.2 * np.eye(genes)[0]
    off = [replace(one, residual=noise_case(one, rng).residual + one.sensitivities @ wrong) for one, _ in cases()]
    assert locate_load(infer(off, PROBE)) is None
