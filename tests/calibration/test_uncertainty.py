from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfiltfilt

from tests.calibration.linear import TRUTH, Linear, problem, recorded
from tests.workers import pendulum
from wingfit.calibration.estimates.likelihood import estimate, iterate
from wingfit.calibration.estimates.remarks import remarks
from wingfit.calibration.estimates.uncertainty import uncertainty
from wingfit.calibration.problem import Problem, base_genome
from wingfit.inference.noise.coloured import Block, grid, last_lag, score_covariances
from wingfit.records import Gene, Recording
from wingfit.sim.model import Array
from wingfit.workers.in_process import InProcessEvaluator

HERE = InProcessEvaluator()
NINETY = 1.645
FILTER = butter(4, 40.0, fs=1000.0, output="sos")
AROUND = 1500  # samples that are drawn beside the recording, so that filters have settled
Noise = Callable[[int, int, np.random.Generator], Array]


def remembering(samples: int, channels: int, rng: np.random.Generator, memory: float = 0.9) -> Array:
    """First-order autoregressive noise of unit variance."""
    draws = rng.normal(size=(samples + AROUND, channels))
    noise = lfilter([1.0], [1.0, -memory], draws, axis=0)[AROUND:]
    return np.asarray(noise * np.sqrt(1 - memory**2))


def low_passed(samples: int, channels: int, rng: np.random.Generator) -> Array:
    """Noise without anything above 40 Hz of 500; its exact deviation is that of the filter's gain."""
    draws = rng.normal(size=(samples + AROUND, channels))
    noise = sosfiltfilt(FILTER, draws, axis=0)[AROUND // 2 : samples + AROUND // 2]
    return np.asarray(noise / 0.27)


def together(samples: int, channels: int, rng: np.random.Generator) -> Array:
    """Coloured noise of two axes of which one follows the other."""
    noise = remembering(samples, channels, rng)
    return np.asarray(noise @ np.array([[1.0, 0.6], [0.0, 0.8]]))


def fitted(given: Problem) -> tuple[list[float], list[float]]:
    """Values of the best genome, and their standard errors."""
    *_, last = iterate(given, HERE, {})
    known = uncertainty(replace(given, base=given.base.replace(last.values)), HERE)
    return list(last.values.values()), list(known.standard_errors.values())


def assert_covered(found: list[tuple[list[float], list[float]]]) -> None:
    """90 % intervals hold the truth in 85 to 95 % of all cases, and of each gene in 80 % at least."""
    values, errors = np.moveaxis(np.array(found), 1, 0)
    covered = np.abs(values - list(TRUTH.values())) <= NINETY * errors
    assert 0.85 <= covered.mean() <= 0.95
    assert covered.mean(axis=0).min() > 0.8


@pytest.mark.parametrize(
    ("noise", "samples", "axes"),
    [(remembering, 800, "x"), (low_passed, 1000, "x"), (together, 800, "xz")],
    ids=["autoregressive", "low-passed", "two axes"],
)
def test_intervals_of_forces_cover_what_they_say(noise: Noise, samples: int, axes: str) -> None:
    """90 % intervals over 200 repetitions; bounds for white noise would cover about half."""
    rng = np.random.default_rng(5)
    draws = (recorded(0.03 * noise(samples, len(axes), rng), axes) for _ in range(200))
    assert_covered([fitted(problem(draw)) for draw in draws])


def by_beat(beats: int, samples: int, rng: np.random.Generator) -> Array:
    """Noise [beats * samples, 1] that scales each beat, so that it is large where the force is, and a little more."""
    scale = 0.02 * np.repeat(remembering(beats, 1, rng, 0.3), samples, axis=0)
    t = np.arange(beats * samples) % samples / samples
    return np.asarray(scale * np.sin(np.pi * t)[:, None] ** 4 + 0.005 * rng.normal(size=scale.shape))


@pytest.mark.parametrize(("recordings", "beats"), [(1, 40), (4, 12)])
def test_noise_that_follows_the_force_is_judged_from_beat_to_beat(recordings: int, beats: int) -> None:
    """Formulas for stationary noise would cover two thirds of the third gene."""
    rng, found = np.random.default_rng(7), []
    for _ in range(200 // recordings):
        several = tuple(recorded(by_beat(beats, 80, rng)) for _ in range(recordings))  # 80 ms at 1 kHz
        found.append(fitted(replace(problem(several[0]), recordings=several)))
    assert_covered(found)


@pytest.mark.parametrize("beats", [5, 14, 30])
def test_misfit_that_repeats_is_no_noise(beats: int) -> None:
    """Half as large as the force, it moves the estimate; it does not make the estimate vary."""
    rng = np.random.default_rng(8)
    t = np.arange(80 * beats) / 80
    misfit = 0.05 * np.cos(6 * np.pi * t) + 0.05 * np.cos(4 * np.pi * t + 1)
    draws = (recorded(misfit[:, None] + 0.01 * remembering(80 * beats, 1, rng)) for _ in range(100))
    values, errors = np.moveaxis(np.array([fitted(problem(draw)) for draw in draws]), 1, 0)
    ratio = np.median(errors, axis=0) / np.std(values, axis=0)
    assert 0.8 < ratio.min() < ratio.max() < 1.5


def test_a_gene_at_its_bound_leaves_the_others_their_errors() -> None:
    record = recorded(0.03 * remembering(4000, 1, np.random.default_rng(9)))
    model = Linear(upper=1.3)  # below the true c
    whole = problem(record, model)
    stopped, fixed = (
        estimate(whole, HERE, {}),
        estimate(replace(whole, free=("a", "b"), base=whole.base.replace({"c": 1.3})), HERE, {}),
    )
    errors = stopped.uncertainty.standard_errors
    assert errors["c"] == np.inf
    assert np.isnan(stopped.uncertainty.correlations.values[2]).all()
    assert [errors["a"], errors["b"]] == pytest.approx(list(fixed.uncertainty.standard_errors.values()), rel=1e-2)
    assert any("c is at its upper bound 1.3" in remark for remark in stopped.remarks)
    assert not any("c has no known error" in remark for remark in stopped.remarks)


@pytest.mark.parametrize("beats", [5, 12, 40])
def test_where_bounds_stop_every_gene_there_is_still_an_answer(beats: int) -> None:
    noise = 0.001 * np.random.default_rng(0).normal(size=(80 * beats, 1))
    given = replace(problem(recorded(noise), Linear(upper=1.1)), free=("c",))
    found = estimate(given, HERE, {})
    assert found.values == {"c": pytest.approx(1.1)}
    assert found.uncertainty.standard_errors == {"c": np.inf}
    assert found.remarks == (
        "c is at its upper bound 1.1: the best value may lie beyond; the standard errors of the other genes hold for "
        "this value",
    )


def test_few_beats_are_said() -> None:
    short, long = (recorded(0.03 * remembering(80 * beats, 1, np.random.default_rng(9))) for beats in (5, 30))
    assert any("5 whole beats, and fewer than 8 say little" in r for r in estimate(problem(short), HERE, {}).remarks)
    assert not any("whole beats" in remark for remark in estimate(problem(long), HERE, {}).remarks)


def test_intervals_of_tracks_cover_what_they_say() -> None:
    """Tracks with gaps, each axis with noise of another size and a long memory."""
    rng, off, errors = np.random.default_rng(6), [], []
    clean = pendulum.recording("long", 9.81, 300)
    model = pendulum.Pendulum()
    truth = np.array([[pendulum.TRUE[gene.name] for gene in pendulum.GENES]])
    tracks = model.observe(truth, clean).channels[0]
    for _ in range(200):
        values = tracks + remembering(300, 3, rng, 0.85) * np.array([4e-4, 4e-4, 8e-4])
        for start in rng.integers(0, 290, 6):
            values[start : start + rng.integers(2, 10)] = np.nan
        given = Problem(model, (replace(clean, values=values),), tuple(pendulum.TRUE), base_genome(model))
        *_, last = iterate(given, HERE, pendulum.TRUE)
        known = uncertainty(replace(given, base=given.base.replace(last.values)), HERE)
        off.append([last.values[name] - pendulum.TRUE[name] for name in pendulum.TRUE])
        errors.append(list(known.standard_errors.values()))
    covered = np.abs(off) <= NINETY * np.array(errors)
    assert 0.85 <= covered.mean() <= 0.95
    assert covered.mean(axis=0).min() > 0.8


def test_white_noise_gives_the_textbook_covariance() -> None:
    record = recorded(0.03 * np.random.default_rng(2).normal(size=(5000, 1)), rate=50_000.0)  # of about one beat
    found = estimate(problem(record), HERE, {})
    shapes = Linear().shapes(record)[:, 0]
    expected = 0.03**2 * np.linalg.inv(shapes.T @ shapes)
    np.testing.assert_allclose(found.uncertainty.covariance, expected, rtol=0.25, atol=0.1 * expected.max())
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(found.uncertainty.correlation, expected / scale / scale[:, None], atol=0.05)


def test_correlations_are_given_back_what_the_fit_took() -> None:
    """Noise of a known memory, a fit of many slow waves: a third of the variance goes, two thirds of that come back."""
    rng, memory, frames = np.random.default_rng(3), 0.9, 400
    t = np.arange(frames)
    waves = [f(2 * np.pi * k * t / frames) for k in range(1, 7) for f in (np.sin, np.cos)]
    basis, _ = np.linalg.qr(np.stack(waves, axis=1))
    raw, whole, scores = [], [], []
    for _ in range(40):
        noise = remembering(frames, 1, rng, memory)[:, 0]
        left = noise - basis @ (basis.T @ noise)
        block = _block(t / 1000.0, left[:, None], basis[:, None])
        lost = np.zeros_like(block.raw)
        raw.append(block.correlation(lost)[:2, 0, 0])
        for _ in range(10):
            found = block.correlation(lost)
            image = block.through(block.spectrum(found, last_lag(found)))
            lost = block.lost(image, np.eye(12), block.scores(image))
        whole.append(block.correlation(lost)[:2, 0, 0])
        scores.append(np.trace(score_covariances([block], np.eye(12))[0]))
    before, after = np.mean(raw, axis=0), np.mean(whole, axis=0)
    assert before[0] < 0.75, "the fit takes a good part of the variance"
    assert 0.85 < after[0] < 1.05
    assert after[1] / after[0] == pytest.approx(memory, abs=0.02)
    true = np.trace(basis.T @ memory ** np.abs(t[:, None] - t) @ basis)
    assert np.mean(scores) == pytest.approx(true, rel=0.2), "what the covariance of the estimate is made of"


def _block(times: Array, white: Array, sensitivity: Array, *, grouped: bool = True) -> Block:
    return Block.of(times, white, sensitivity, np.ones(white.shape, bool), grouped=grouped)


def test_scores_are_the_double_sum() -> None:
    """sum_ij S_i^T R(i - j) S_j written out, for two outputs that are correlated, with a pause between frames."""
    rng = np.random.default_rng(4)
    times = np.concatenate([np.arange(30), np.arange(34, 60)]) / 100.0
    slope, white = rng.normal(size=(56, 2, 3)), rng.normal(size=(56, 2))
    block = _block(times, white, slope)
    correlation = np.zeros((len(block.pairs), 2, 2))
    correlation[0], correlation[1] = [[1.0, 0.3], [0.3, 1.0]], [[0.3, 0.2], [-0.1, 0.3]]
    found = block.scores(block.through(block.spectrum(correlation, 2)))
    at = np.round(times * 100).astype(int)
    expected = np.zeros((3, 3))
    for i in range(56):
        for j in range(56):
            ahead = at[j] - at[i]
            if abs(ahead) <= 1:
                product = correlation[abs(ahead)] if ahead >= 0 else correlation[abs(ahead)].T
                expected += slope[i].T @ product @ slope[j]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_products_are_counted_where_both_samples_were_seen() -> None:
    seen = np.ones((50, 1), bool)
    seen[20:30] = False
    white = np.where(seen, 1.0, 0.0)
    block = Block.of(np.arange(50) / 10.0, white, np.zeros((50, 1, 1)), seen, grouped=False)
    assert block.pairs[0] == 40
    assert block.pairs[3] == sum(seen[k, 0] and seen[k + 3, 0] for k in range(47))
    np.testing.assert_allclose(block.correlation(np.zeros_like(block.raw))[:10, 0, 0], 1.0, atol=1e-9)


def test_frames_lie_on_a_grid_of_time() -> None:
    assert grid(np.array([0.0, 0.1, 0.21, 0.5, 0.6]), 10).tolist() == [0, 1, 2, 5, 6]
    assert grid(np.array([0.0, 0.1, 0.2, 900.0, 900.1]), 10).tolist() == [0, 1, 2, 13, 14], "a pause is cut short"
    assert grid(np.array([0.0, 0.1, 0.101, 0.2, 0.3]), 10).tolist() == [0, 1, 2, 3, 4], "too uneven for a grid"
    assert grid(np.array([0.0]), 10).tolist() == [0]


def test_the_ratio_of_twins_is_told_and_said() -> None:
    """b acts against a, all but exactly: their difference shows, their sum does not."""
    model = Linear(twins=True)
    found = estimate(
        problem(recorded(0.01 * remembering(600, 1, np.random.default_rng(7)), model=model), model), HERE, {}
    )
    assert any(remark.startswith("a and b compensate each other") or "a : b" in remark for remark in found.remarks)
    assert found.uncertainty.correlation[0, 1] > 0.99
    together = found.uncertainty.correlations
    assert together.genes == found.uncertainty.free
    np.testing.assert_allclose(together.values, found.uncertainty.correlation, atol=1e-6)
    assert not any("c is not identifiable" in remark for remark in found.remarks)


def gene(name: str, share: str | None = None) -> Gene:
    return Gene(name, "1", 1.0, 0.2, 5.0, "log", name, share)


ALL = np.ones(2, bool)


def test_what_the_data_cannot_tell_is_put_into_words() -> None:
    pair = [gene("C_l"), gene("C_D0")]
    ratio = np.array([[0.5, 0.499], [0.499, 0.5]])
    (said,) = remarks(pair, ratio, ALL, 0.075)
    assert (
        said == "only the ratio C_l : C_D0 is identifiable, to 4.5%; the standard errors of each are C_l 71%, C_D0 71%"
    )
    (said,) = remarks(pair, ratio * np.array([[1, -1], [-1, 1]]), ALL, 0.075)
    assert said.startswith("only the product C_l x C_D0 is identifiable, to 4.5%")
    (said,) = remarks(pair, np.diag([1e-4, 0.36]), ALL, 0.075)
    assert said == "C_D0 is not identifiable from these data: its standard error is 60%"
    uneven = np.outer([1.0, -0.5], [1.0, -0.5]) * 0.3 + 1e-5 * np.eye(2)
    (said,) = remarks(pair, uneven, ALL, 0.075)
    assert said.startswith("C_l and C_D0 compensate each other: C_l ")
    assert "+10 %" in said.replace("-10 %", "+10 %")
    assert remarks(pair, np.diag([1e-4, 1e-3]), ALL, 0.075) == ()
    both = remarks(pair, 0.2 * np.eye(2), ALL, 0.075)
    assert len(both) == 2, "two genes that are not identifiable, though there is no trade-off"
    assert all("is not identifiable from these data: its standard error is 45%" in one for one in both)


def test_shares_are_named_together_and_lost_genes_first() -> None:
    genes = [gene("L_1", "L"), gene("L_2", "L"), gene("G_r")]
    covariance = np.diag([0.04, 1e-4, 0.5])
    said = remarks(genes, covariance, np.array([True, True, False]), 0.075)
    assert said == (
        "G_r has no known error: no neighbour of the best genome can be simulated",
        "these data do not identify the shares L: L_1 (standard error 20%)",
    )


def test_a_gene_that_the_data_ignore_has_the_error_of_its_box() -> None:
    """Its bound is the half width of the box, not infinity, and the others' errors are as without it."""
    record = recorded(0.01 * remembering(600, 1, np.random.default_rng(8)))

    class Deaf(Linear):
        def shapes(self, recording: Recording) -> Array:
            shapes = super().shapes(recording)
            return np.asarray(shapes * np.array([1.0, 0.0, 1.0]))

    given = replace(problem(record), model=Deaf(), base=base_genome(Deaf()))
    known = uncertainty(given, HERE)
    assert known.standard_errors["b"] == pytest.approx(5.0)
    assert known.standard_errors["a"] < 0.4
    assert any(remark.startswith("b is not identifiable from these data") for remark in known.remarks)
