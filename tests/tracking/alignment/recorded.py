"""A recording of the example wing in the axes of some cameras, with the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit import load_dataset
from wingfit.records import Dataset, Wing
from wingfit.records.array_types import Array
from wingfit.tracking.alignment import Tracks

ROBIRD = Path(__file__).parents[3] / "examples" / "robird"
TURN = Rotation.from_euler("xyz", [0.7, -0.4, 2.0]).as_matrix()
PLACE = np.array([0.4, -0.2, 1.5])
FRAMES = 62


@dataclass(frozen=True, eq=False)
class Filmed:
    """``tracks`` in camera axes; the same samples in the wing frame, ``true`` [T, K, 3] m; names of the ``markers``."""

    wing: Wing
    tracks: Tracks
    true: Array
    markers: tuple[str, ...]

    def renamed(self, names: tuple[str, ...]) -> Filmed:
        """Return it with other names of the tracks."""
        tracks = self.tracks
        return replace(self, tracks=Tracks(tracks.file, tracks.times, names, tracks.positions))

    def filmed_by(self, positions: Array) -> Filmed:
        """Return it with other positions of the tracks."""
        return replace(self, tracks=Tracks("trial.csv", self.tracks.times, self.tracks.names, positions))


@lru_cache
def dataset() -> Dataset:
    found = load_dataset(ROBIRD)
    assert isinstance(found, Dataset)
    return found


def filmed(number: int = 0, *, left: bool = False) -> Filmed:
    """Return two beats of a recording of the example, without names of the tracks."""
    recording = dataset().recordings[number]
    wing = dataset().rig
    assert isinstance(wing, Wing)
    true = recording.values.reshape(len(recording.times), -1, 3)[:FRAMES]
    positions = true * (1, -1 if left else 1, 1) @ TURN.T + PLACE
    names = tuple(f"t{k}" for k in range(true.shape[1]))
    return Filmed(wing, Tracks("trial.csv", recording.times[:FRAMES], names, positions), true, recording.markers)


def turned_by(rotation: Array, *, left: bool = False) -> float:
    """Return the angle between an estimated ``rotation`` and the true one, degrees."""
    true = np.diag([1.0, -1.0 if left else 1.0, 1.0]) @ TURN.T
    return float(np.degrees(Rotation.from_matrix(rotation @ true.T).magnitude()))
