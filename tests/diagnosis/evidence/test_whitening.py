"""Correlated noise of the coordinates of a marker: whitened, used if it agrees with what is seen, and worth stating."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.evidence.test_position_errors import described, diagnosed
from tests.diagnosis.pendulum_rig import recorded
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.verdict.noise_remarks import noise_remarks
from wingfit.inference.noise.harmonic import noise_distance
from wingfit.inference.noise.stated import correlation_matrices
from wingfit.records import Condition, Dataset, Recording
from wingfit.records.array_types import Array
from wingfit.sim.virtual_rigs.campaign import Tracking

ACROSS, ALONG = 1e-4, 6e-4  # m, standard deviations across and along the line of sight
SIGHT = np.array([0.64, 0.48, 0.6])
COVARIANCE = ACROSS**2 * np.eye(3) + (ALONG**2 - ACROSS**2) * np.outer(SIGHT, SIGHT)


def seen_by_cameras(clean: Recording, seed: int, *, correlated: bool = True) -> Recording:
    """Return ``clean`` with noise of COVARIANCE, which is stated with or without its correlations."""
    markers = len(clean.markers)
    noise = np.random.default_rng(seed).multivariate_normal(np.zeros(3), COVARIANCE, (len(clean.times), markers))
    spread = np.sqrt(np.diag(COVARIANCE))
    correlation = COVARIANCE / np.outer(spread, spread)
    stated = np.tile(correlation[[0, 0, 1], [1, 2, 2]], (markers, 1))
    return replace(
        clean,
        values=clean.values + noise.reshape(clean.values.shape),
        standard_deviation=np.tile(spread, markers),
        noise_correlation=stated if correlated else None,
    )


def still(seed: int, *, correlated: bool = True) -> Recording:
    """Return a recording of a motion that is known, with noise of cameras."""
    (clean,) = recorded({}, noise=0.0, frequencies=(1.7,), frames=248)
    return seen_by_cameras(clean, seed, correlated=correlated)


def noises(data: WhitenedData, seeds: range) -> Array:
    """Return coefficients [N, D] of noise alone, of other draws than the one in ``data``."""
    (clean,) = recorded({}, noise=0.0, frequencies=(1.7,), frames=248)
    return np.stack([data.coefficients_of([seen_by_cameras(clean, seed).values - clean.values]) for seed in seeds])


def test_whitened_noise_has_unit_covariance() -> None:
    data = replace(WhitenedData.of((still(0),)), tolerance=0.0)
    (fit,) = data.beat_fits
    white = data.whiten(noises(data, range(1, 801)))
    steady = np.tile(~fit.trend, int(fit.used.sum()))
    white = white[:, steady].reshape(len(white), -1, 3, int((~fit.trend).sum()))
    found = np.einsum("nmip,nmjp->ij", white, white) / white[:, :, 0].size
    level = np.trace(found) / 3  # the level is that of one recording's spectrum
    assert level == pytest.approx(1.0, abs=0.3)
    np.testing.assert_allclose(found / level, np.eye(3), atol=0.03)


def test_whitening_is_undone_and_works_by_recording() -> None:
    data = WhitenedData.of((still(0), replace(still(1, correlated=False), name="other")))
    values = np.random.default_rng(2).standard_normal((4, len(data.scale)))
    white = data.whiten(values)
    np.testing.assert_allclose(data.whitening.restore(white), values, rtol=1e-9, atol=1e-12)
    for part in data.recording_slices:
        alone = data.whitening.of_part(part)
        np.testing.assert_array_equal(alone.whiten(values[:, part]), white[:, part])
        np.testing.assert_allclose(alone.restore(white[:, part]), values[:, part], rtol=1e-9, atol=1e-12)
    plain = data.recording_slices[1]
    np.testing.assert_array_equal(white[:, plain], values[:, plain] / data.scale[plain])


def test_the_sum_of_whitened_squares_is_the_quadratic_form_of_the_covariance() -> None:
    data = replace(WhitenedData.of((still(0),)), tolerance=0.0)
    (fit,) = data.beat_fits
    values = np.random.default_rng(5).standard_normal(len(data.scale)) * data.scale
    blocks, spread = (one.reshape(-1, 3, len(fit.order)) for one in (values, np.sqrt(fit.variance[fit.used])))
    sizes = np.sqrt(np.diag(COVARIANCE))
    inverse = np.linalg.inv(COVARIANCE / np.outer(sizes, sizes))
    relative = blocks / spread
    expected = np.einsum("mip,ij,mjp->", relative, inverse, relative)
    assert float(np.sum(data.whiten(values) ** 2)) == pytest.approx(expected, rel=1e-9)
    assert expected > 2.0 * float(np.sum(relative**2)), "the correlations matter"


def test_correlations_that_do_not_agree_are_not_used_and_remarked_on() -> None:
    right = still(0)
    assert right.noise_correlation is not None
    mirrored = replace(right, noise_correlation=right.noise_correlation * [-1.0, 1.0, -1.0])
    data, unstated = WhitenedData.of((mirrored,)), WhitenedData.of((still(0, correlated=False),))
    (remark,) = noise_remarks(data, "m")
    assert "correlations of the noise" in remark
    assert "axes of the wing" in remark
    values = np.random.default_rng(2).standard_normal(len(data.scale))
    np.testing.assert_array_equal(data.whiten(values), unstated.whiten(values))
    assert noise_remarks(WhitenedData.of((right,)), "m") == ()


def test_the_mean_distance_of_correlated_noise_is_that_of_its_principal_variances() -> None:
    distance = noise_distance((still(0),))
    drawn = np.random.default_rng(3).multivariate_normal(np.zeros(3), COVARIANCE, 200_000)
    assert distance == pytest.approx(float(np.linalg.norm(drawn, axis=1).mean()), rel=0.01)
    independent = noise_distance((still(0, correlated=False),))
    assert independent is not None
    assert distance is not None
    assert independent > 1.02 * distance


def test_matrices_of_correlations() -> None:
    found = correlation_matrices(np.array([[0.1, 0.2, 0.3]]))
    np.testing.assert_array_equal(found[0], [[1, 0.1, 0.2], [0.1, 1, 0.3], [0.2, 0.3, 1]])


def filmed(*, correlated: bool) -> Dataset:
    """Recordings of a wing with a displaced hinge by cameras that see badly along their line of sight."""
    exact = described(0.0, "hinge_offset", {"hinge_offset.z": 0.004}, Tracking((1e-6, 1e-6, 1e-6)))
    every = tuple(seen_by_cameras(one, k, correlated=correlated) for k, one in enumerate(exact.recordings))
    return replace(exact, recordings=every)


def test_stated_correlations_make_intervals_narrower() -> None:
    widths = list[float]()
    for correlated in (False, True):
        finding = diagnosed(filmed(correlated=correlated))
        assert finding.named == ("hinge_offset",)
        value = next(gene.value for gene in finding.genes if gene.name == "hinge_offset.z")
        assert value.low is not None
        assert value.high is not None
        assert value.low < 0.004 < value.high
        widths.append(value.high - value.low)
    assert widths[1] < 0.8 * widths[0]


def test_forces_without_noise_allow_for_the_error_of_a_solver() -> None:
    """Two solvers of the same law differ by a ten-thousandth, not by missing physics."""
    condition = Condition(
        pressure=101325.0,
        temperature=293.0,
        gravity=9.81,
        airspeed=2.0,
        angle_of_attack=0.0,
        flap_frequency=10.0,
        phase_lag=0.0,
    )
    times = np.arange(400) / 400.0
    values = np.column_stack([np.cos(2 * np.pi * 10 * times), 0.3 * np.sin(2 * np.pi * 20 * times)])
    forces = Recording("r", "wind_tunnel", condition, times, (), values, forces=("x", "z"))
    data = WhitenedData.of([forces], ("x", "z"))
    small, large = (share * np.cos(2 * np.pi * 30 * times)[:, None] * [[1.0, 1.0]] for share in (2e-4, 2e-3))
    assert np.sqrt(data.excess(data.coefficients_of([small]))) < data.noise
    assert np.sqrt(data.excess(data.coefficients_of([large]))) > 4 * data.noise
