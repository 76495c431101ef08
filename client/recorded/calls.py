"""Methods of the client that fetch what a dataset holds: the described wing, recorded values, and the checks."""

from __future__ import annotations

from typing import Any, cast

from wingfit.client.recorded import answers as r
from wingfit.client.transport import Transport, given, part


class RecordedCalls(Transport):
    """Base class of the client: methods that fetch what was described and recorded in a dataset.

    ``recording`` is the name of a recording; None: the first of the dataset. Datasets of another kind raise
    :class:`WingfitError`, as do names that the dataset does not have.
    """

    def described_wing(self, dataset_id: str) -> r.DescribedWing:
        """Fetch the described wing of a dataset of tracks, at rest, in mm: outline, rods, hinge, markers, drive."""
        return cast(r.DescribedWing, self._recorded(dataset_id, "wing"))

    def recorded_tracks(self, dataset_id: str, recording: str | None = None, *, beat: int | None = None) -> r.Tracks:
        """Fetch the markers of a recording over its mean beat, or over ``beat`` (from 1), in mm."""
        return cast(r.Tracks, self._recorded(dataset_id, "tracks", recording=recording, beat=beat))

    def recorded_samples(
        self, dataset_id: str, recording: str | None = None, *, marker: str | None = None
    ) -> r.Samples:
        """Fetch the coordinates of a ``marker`` (None: the first) in mm, or the forces in N, over time, with gaps."""
        return cast(r.Samples, self._recorded(dataset_id, "samples", recording=recording, marker=marker))

    def recorded_forces(self, dataset_id: str, recording: str | None = None) -> r.Forces:
        """Fetch the recorded forces of a vehicle over the mean beat, in N, with the motion of the wings in degrees."""
        return cast(r.Forces, self._recorded(dataset_id, "forces", recording=recording))

    def recorded_series(self, dataset_id: str, recording: str | None = None) -> r.SeriesValues:
        """Fetch channels and inputs of a recording of series over time, in their units, with the gaps."""
        return cast(r.SeriesValues, self._recorded(dataset_id, "series", recording=recording))

    def dataset_checks(self, dataset_id: str) -> r.Checks:
        """Fetch which checks the upload of a dataset carried out, and how many likely mistakes each found."""
        return cast(r.Checks, self._recorded(dataset_id, "checks"))

    def _recorded(self, dataset_id: str, what: str, **query: str | int | None) -> Any:
        return self._json("GET", f"/v1/datasets/{part(dataset_id)}/{what}", params=given(**query))
