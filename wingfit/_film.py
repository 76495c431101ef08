"""Tracks the markers of a wing in films, in this process."""

from __future__ import annotations

from collections.abc import Callable
from os import PathLike
from pathlib import Path

from wingfit.cameras.project import read_film
from wingfit.cameras.track.procedure import track
from wingfit.cameras.track.result import TrackedFilm


def track_film(
    film: str | PathLike[str],
    *,
    store: str | PathLike[str] | None = None,
    report: Callable[[str, float], object] | None = None,
) -> TrackedFilm:
    """Track the markers of a wing in the films of two to eight calibrated cameras.

    Args:
        film: the description ``film.yaml`` (docs/cameras.md).
        store: folder for what is detected, so that an interrupted run goes on.
        report: called with what is being done, and with the part of it that is done, from 0 to 1.

    Returns:
        The tracks in the axes of the cameras, with the covariance of each place.

    Raises:
        DatasetError: what is wrong with the description, a calibration or a film, or that the wing was not identified.

    """
    request = read_film(Path(film), None if store is None else Path(store))
    return track(request, report) if report else track(request)
