"""Tracks of a whole wing in the place of those of a small film, which would take long to render and to track."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.tracking.alignment.recorded import Filmed
from wingfit.records.files.table import write_table

DEVIATION = 2e-4  # of the stated noise, m


def write_tracks(data: Path, film: str, tracking: str, made: Filmed) -> None:
    """Write the tracks of a wing in the place of those of a small film."""
    folder = data / "films" / film / "tracked" / tracking
    tracks = made.tracks
    columns = [f"{name}_{axis}_m" for name in tracks.names for axis in "xyz"]
    table = write_table(columns, tracks.times, tracks.positions.reshape(len(tracks.times), -1))
    (folder / "tracks.csv").write_text(table)
    covariance = np.broadcast_to(DEVIATION**2 * np.eye(3), (*tracks.positions.shape[:2], 3, 3))
    names, times = np.array(tracks.names), tracks.times
    np.savez(folder / "covariance.npz", names=names, times=times, covariance=covariance)
