"""A hawk's wing, recorded by others: it can be described, checked, and calibrated as a rigid wing."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import wingfit
from tests.records.malformed import zipped
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
    load_archive,
    wing_or_vehicle,
)
from wingfit.records.files.folder import contents

FILE = Path(__file__).parents[4] / "shared" / "data" / "hawk" / "2024-06-03-TestUnilateralMarkers.csv"
pytestmark = pytest.mark.skipif(not FILE.exists(), reason="the recordings of hawks are not there")
FLAPS_HZ = 5.1


def hawk() -> Dataset:
    """The first flaps after take-off of one bird; rest positions are those of the spread wing at mid-downstroke."""
    tracks = wingfit.import_tracks(
        FILE, unit="m", time_unit="s", rows="seqID=01_09_017_2,Left=1", axes="x out, y fore, z up"
    )
    used = tracks.times < 0.6
    names = ("wingtip", "primary", "secondary")
    columns = [next(k for k, marker in enumerate(tracks.markers) if marker.startswith(name)) for name in names]
    values = tracks.positions[used][:, columns].reshape(np.count_nonzero(used), -1)
    wing = Wing(
        name="hawk",
        structure="rigid",
        stations=(Station(0.03, -0.12, 0.26, 0.02), Station(0.36, -0.1, 0.22, 0.004), Station(0.5, -0.07, 0.08, 0.002)),
        materials=Materials(0.0, 1.1),
        rods=(),
        driven_rods=(),
        markers=(
            Marker("wingtip", (-0.03, 0.49, 0.0), 0.0),
            Marker("primary", (-0.08, 0.37, 0.0), 0.0),
            Marker("secondary", (0.1, 0.34, 0.0), 0.0),
        ),
        reference_markers=("primary",),
        hinge=Hinge(0.03, 0.0),
        drive=FourierDrive(math.radians(-5.0), (0.0,), (math.radians(35.0),)),
    )
    condition = Condition(FLAPS_HZ, 0.0, 101325.0, 293.15, airspeed=3.0)
    recording = Recording("flight", "wind_tunnel", condition, tracks.times[used], names, values)
    return Dataset("hawk", wing, (recording,), ())


def test_a_hawk_is_described_and_calibrated() -> None:
    dataset = hawk()
    read = wing_or_vehicle(load_archive(zipped(contents(dataset)), "hawk.zip"))
    assert read.wing == dataset.wing
    assert np.array_equal(read.recordings[0].values, dataset.recordings[0].values, equal_nan=True)
    spec = wingfit.CalibrationSpec(mode="joint", method="gauss_newton", effects=("stroke_amplitude", "stroke_bias"))
    found = wingfit.calibrate(read, spec)
    assert found.before is not None
    assert found.after is not None
    assert found.after < found.before  # a real wing also folds on the upstroke, which no rigid wing does
    assert [gene.name for gene in found.genes if gene.searched] == [
        "stroke_amplitude.part",
        "stroke_amplitude.linkage",
        "stroke_bias.angle",
    ]
    amplitude = 35.0 * (1 + next(gene.best for gene in found.genes if gene.name == "stroke_amplitude.part"))
    assert 38.0 < amplitude < 48.0  # deg
