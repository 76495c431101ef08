"""Flights of hawks, recorded by others: described as they flew, none is refused; glides are remarked on."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import wingfit
from wingfit.checks import Mistake, examine
from wingfit.checks.harmonics import fit
from wingfit.records import (
    Condition,
    Dataset,
    FourierDrive,
    Hinge,
    Marker,
    Materials,
    Recording,
    Station,
    Wing,
)

FILE = Path(__file__).parents[3] / "shared" / "data" / "hawk" / "2024-06-03-TestBilateralMarkers.csv"
pytestmark = pytest.mark.skipif(not FILE.exists(), reason="the recordings of hawks are not there")
SHOULDER = 0.03  # m from the middle of the body
# Flap frequencies (Hz) of the first flaps of flights that are long enough to count them.
FLIGHTS = {"01_09_017_2": 4.7, "03_05_002": 4.85, "04_12_268": 4.97, "05_09_057_1": 3.7}


def flight(name: str, side: str, markers: tuple[str, ...], seconds: float, *, whole: bool = False) -> Dataset:
    """The wing of one ``side``; rest positions and drive are those of the recorded motion itself."""
    axes = "x out, y fore, z up" if side == "right" else "x in, y fore, z up"
    tracks = wingfit.import_tracks(FILE, unit="m", time_unit="s", rows=f"seqID={name}", axes=axes)
    used = (tracks.times - tracks.times[0] < seconds) | whole
    columns = [tracks.markers.index(f"{side}_{marker}_rot") for marker in markers]
    times, places = tracks.times[used], tracks.positions[used][:, columns]
    arms = places[..., 1] - SHOULDER + 1j * places[..., 2]
    angle = np.angle(arms[:, 0])
    flap = fit(times, angle[:, None], FLIGHTS[name], 1)
    level = arms * np.exp(-1j * angle)[:, None]
    rest = np.column_stack([places[..., 0].mean(0), np.median(level.real, 0) + SHOULDER, np.median(level.imag, 0)])
    tip = float(rest[:, 1].max()) + 0.01
    wing = Wing(
        name="hawk",
        structure="rigid",
        stations=(Station(SHOULDER, -0.25, 0.6, 0.02), Station(tip, -0.25, 0.6, 0.004)),
        materials=Materials(0.0, 0.5),
        rods=(),
        driven_rods=(),
        markers=tuple(Marker(one, tuple(map(float, at)), 0.0) for one, at in zip(markers, rest, strict=True)),  # type: ignore[arg-type]
        reference_markers=(markers[1],),
        hinge=Hinge(SHOULDER, 0.0),
        drive=FourierDrive(float(flap.mean[0]), (float(flap.waves[0, 0].real),), (-float(flap.waves[0, 0].imag),)),
    )
    condition = Condition(FLIGHTS[name], 0.0, 101325.0, 293.15, airspeed=6.0)
    recording = Recording("flight", "wind_tunnel", condition, times, markers, places.reshape(len(times), -1))
    return Dataset("hawk", wing, (recording,), ())


def kinds(dataset: Dataset) -> set[str]:
    found = examine(dataset)
    assert not [str(one) for one in found if one.certain]
    return {one.kind for one in found}


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(
    "markers", [("wingtip", "primary", "secondary"), ("wingtip", "primary", "secondary", "tailtip")]
)
@pytest.mark.parametrize("name", FLIGHTS)
def test_no_flight_is_refused(name: str, side: str, markers: tuple[str, ...]) -> None:
    kinds(flight(name, side, markers, math.inf))
    for seconds in (0.36, 0.6):
        if np.count_nonzero(flight(name, side, markers, seconds).recordings[0].times) >= 8:
            kinds(flight(name, side, markers, seconds))


def test_a_glide_is_remarked_on_and_the_flaps_are_the_proposed_window() -> None:
    found = examine(flight("04_12_268", "left", ("wingtip", "primary", "secondary"), math.inf))
    remark = next(one for one in found if one.kind == "unsteady")
    assert "window_s: [-0.02, 1.01" in remark.change


def test_a_flight_in_inches_is_still_refused() -> None:
    good = flight("04_12_268", "left", ("wingtip", "primary", "secondary"), 0.6)
    first = good.recordings[0]
    inches = Recording(first.name, first.rig, first.condition, first.times, first.markers, first.values / 0.0254)
    found: tuple[Mistake, ...] = examine(Dataset("hawk", good.wing, (inches,), ()))
    assert {one.kind for one in found if one.certain} == {"length unit"}
