"""What a first description says about the errors of the numbers that it estimates."""

from __future__ import annotations

import re
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.importers.reading import read
from tests.importers.start.test_start import HINGE, described, loaded, tracks_of
from wingfit.importers.start import Conditions, start_dataset
from wingfit.importers.start.correlation import correlated_rows
from wingfit.importers.tracks import ImportedTracks
from wingfit.records import DatasetError


def stated(fact: str) -> tuple[float, float]:
    """The first number of a fact, and its standard error."""
    found = re.search(r"(-?[0-9.]+) (?:mm|deg).*, standard error ([0-9.]+) (?:mm|deg)", fact)
    assert found, fact
    return float(found[1]), float(found[2])


def noisy(rms: float, seed: int, rows: int) -> ImportedTracks:
    """Tracks with noise of ``rms`` (m) of which ``rows`` neighbouring rows vary together."""
    tracks = tracks_of()
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((len(tracks.times) + rows - 1, *tracks.positions.shape[1:]))
    smooth = sum(noise[k : k + len(tracks.times)] for k in range(rows)) / np.sqrt(rows)
    return replace(tracks, positions=tracks.positions + rms * smooth)


@pytest.mark.parametrize(("rms", "rows"), [(0.003, 1), (0.01, 1), (0.03, 1), (0.01, 20)])
def test_errors_are_within_twice_what_is_stated(rms: float, rows: int) -> None:
    hinges, angles = [], []
    for seed in range(12):
        facts = described(noisy(rms, seed, rows))
        (hinge, off), (angle, turned) = stated(facts["hinge"]), stated(facts["flap angle"])
        hinges.append((hinge - 1e3 * HINGE[0]) / off)
        angles.append((angle - 30) / turned)
    for ratios in (hinges, angles):
        assert sum(abs(one) < 2 for one in ratios) >= 10, ratios
        assert 0.2 < np.sqrt(np.mean(np.square(ratios))) < 1.6, "neither too small nor without meaning"


def test_a_large_error_comes_with_a_remedy() -> None:
    assert "measure it, or export a longer part" in described(noisy(0.03, 1, 1))["flap angle"]
    assert "measure it" not in described(noisy(0.003, 1, 1))["flap angle"]
    assert "a cosine explains 100 % of its variance" in described(tracks_of())["flap angle"]


def test_the_angle_about_an_assumed_hinge_has_no_error_but_a_word() -> None:
    facts = described(tracks_of(drift=0.05))
    assert "about the assumed hinge: not exact, larger if it is farther out" in facts["flap angle"]
    assert "standard error" not in facts["flap angle"] + facts["hinge"]


def test_rows_that_vary_together_are_counted() -> None:
    rng = np.random.default_rng(2)
    white = rng.standard_normal((4000, 3))
    assert correlated_rows(white) == pytest.approx(1, abs=0.2)
    smooth = np.stack([np.convolve(one, np.ones(10), "valid") for one in white.T], axis=1)
    assert correlated_rows(smooth) == pytest.approx(10, rel=0.25)


@pytest.mark.parametrize(("scale", "words"), [(1e-6, "extent 4"), (1e-197, "no clear flap"), (1e3, "span 4")])
def test_wings_of_an_impossible_size_are_refused(scale: float, words: str) -> None:
    tracks = tracks_of()
    with pytest.raises(DatasetError, match=words):
        start_dataset([replace(tracks, positions=scale * tracks.positions)], "wing", Conditions())
    with pytest.raises(DatasetError, match="check the unit"):
        start_dataset([replace(tracks, positions=scale * tracks.positions)], "wing", Conditions(flap_frequency_hz=5.0))


@pytest.mark.parametrize("scale", [1e-3, 0.1, 2, 5, 9, 15])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_what_is_described_can_be_loaded(scale: float, axis: int, tmp_path: Path) -> None:
    tracks = tracks_of()
    positions, described_places = scale * tracks.positions, 0
    for k, away in enumerate((0.0, 3.0, 12.0)):
        moved = positions.copy()
        moved[..., axis] += away
        with suppress(DatasetError):
            found = start_dataset([replace(tracks, positions=moved)], "wing", Conditions())
            (tmp_path / str(k)).mkdir()
        if (tmp_path / str(k)).exists():
            loaded(found, tmp_path / str(k) / "wing")
            described_places += 1
    assert described_places >= (scale < 9)


def test_a_small_wing_is_shown_with_its_digits() -> None:
    tracks = tracks_of()
    facts = described(replace(tracks, positions=1e-2 * tracks.positions))
    assert facts["hinge"].startswith("y 0.50 mm, z 0.20 mm")
    assert facts["planform"].startswith("4.86 mm x 1.12 mm")


def test_five_hundred_markers_are_described_within_seconds(tmp_path: Path) -> None:
    one = tracks_of(beats=2, distances=(0.45,))
    parts = np.linspace(0.2, 1, 500)[:, None]
    places = np.array([0.0, *HINGE]) + parts * (one.positions - np.array([0.0, *HINGE]))
    tracks = replace(one, markers=tuple(f"m{k}" for k in range(500)), positions=places)
    before = time.process_time()
    start = start_dataset([tracks], "wing", Conditions())
    assert time.process_time() - before < 3
    assert loaded(start, tmp_path / "wing").wing.hinge.y == pytest.approx(HINGE[0], abs=1e-3)


def test_one_marker_is_one_marker() -> None:
    assert described(tracks_of(distances=(0.3,)))["rest positions"].startswith("1 marker, ")
    still = "time_s,a_x_m,a_y_m,a_z_m\n" + "".join(f"{t / 100},0,{t % 3},{t % 2}\n" for t in range(20))
    facts = start_dataset([read(still)], "arm", Conditions()).facts
    assert facts[1].value == "1 coordinate that never changes: a_x_m"
