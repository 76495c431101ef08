"""Markers of a hawk, both wings at once: an alignment to one described wing must refuse, and say why."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.tracking.alignment.recorded import dataset
from wingfit import DatasetError, align_tracks, import_tracks
from wingfit.records import Hinge, Marker, Station, Wing

HAWK = Path(__file__).parents[4] / "shared" / "data" / "hawk" / "2024-06-03-TestBilateralMarkers.csv"
pytestmark = pytest.mark.skipif(
    not HAWK.is_file(), reason="the folder ../shared with recordings of others is not there"
)
_PLACES = {
    "wingtip": (0.06, 0.48, 0.02), "primary": (0.08, 0.36, 0.02), "secondary": (0.16, 0.34, 0.0),
    "shoulder": (0.0, 0.08, 0.02), "elbow": (0.02, 0.2, 0.03),
}  # fmt: skip


def hawk_wing(count: int) -> Wing:
    """Return the Robird's wing in the size of a hawk's, with the first ``count`` markers of the hawk."""
    whole = dataset().rig
    assert isinstance(whole, Wing)
    markers = tuple(Marker(name, place, 1e-4) for name, place in [*_PLACES.items()][:count])
    stations = (Station(0.03, -0.06, 0.25, 0.01), Station(0.52, 0.02, 0.12, 0.008))
    return replace(
        whole, name="hawk", markers=markers, stations=stations, reference_markers=("wingtip",), hinge=Hinge(0.0, 0.0)
    )


def test_three_markers_of_a_wing_are_too_few() -> None:
    tracks = import_tracks(HAWK, unit="m", time_unit="s", rows="seqID=01_09_017_2")
    with pytest.raises(DatasetError, match=r"describes 3 markers; at least 5 are needed"):
        align_tracks(tracks, hawk_wing(3))


def test_both_wings_and_the_tail_are_not_one_wing() -> None:
    tracks = import_tracks(HAWK, unit="m", time_unit="s", rows="seqID=01_09_017_2")
    with pytest.raises(DatasetError) as caught:
        align_tracks(tracks, hawk_wing(5))
    assert any(words in str(caught.value) for words in ("needed", "accepted", "check", "is it the described wing"))
