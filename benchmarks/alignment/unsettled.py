"""Recordings whose frame, side or labels nobody can know: the only right answer is a refusal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.concealed.rigs import WINGS
from wingfit.records import FourierDrive, Hinge, Marker, Rod, Wing
from wingfit.tracking.alignment import Tracks

Array = npt.NDArray[np.float64]
_FRAMES, _PER_BEAT, _NOISE = 60, 28.0, 3e-4
_STROKE = 0.6


@dataclass(frozen=True, eq=False)
class Unsettled:
    """A case: its ``name``, tracks, and the description that they get."""

    name: str
    tracks: Tracks
    wing: Wing


def grid_wing(across: int, *, flat: bool, symmetric: bool) -> Wing:
    """Return a wing with a grid of markers; ``flat``: in the plane of the hinge; ``symmetric``: fore and aft."""
    x = np.linspace(-0.05, 0.05, across) if symmetric else np.array([-0.05, -0.028, 0.004, 0.05, 0.061])[:across]
    y = (0.05, 0.11, 0.16, 0.22, 0.29)
    markers = tuple(
        Marker(f"g{k:02d}", (float(a), b, 0.0 if flat else 0.006), 5e-5)
        for k, (b, a) in enumerate((b, a) for b in y for a in x)
    )
    rods = (
        Rod("front", 0.0, 0.03, 0.0, 0.28, 0.002, 1600.0, 0.002),
        Rod("rear", 0.03, 0.03, 0.03, 0.28, 0.002, 1600.0, 0.002),
    )
    names = tuple(one.name for one in markers[:across])
    drive = FourierDrive(0.0, (0.0,), (_STROKE,))
    return replace(
        WINGS["insect"][0], name="grid", markers=markers, rods=rods, driven_rods=("front", "rear"),
        reference_markers=names, hinge=Hinge(0.0, 0.0), drive=drive,
    )  # fmt: skip


def rigid(wing: Wing, stroke: float = _STROKE, seed: int = 0, *, noise: float = _NOISE) -> Array:
    """Return tracks [T, M, 3] (m) of ``wing`` that flaps as a rigid one by ``stroke`` (rad), in random camera axes."""
    rng = np.random.default_rng(seed)
    hinge = np.array([0.0, wing.hinge.y, wing.hinge.z])
    rest = np.array([one.position for one in wing.markers]) - hinge
    angle = stroke * np.sin(2 * np.pi * np.arange(_FRAMES) / _PER_BEAT)
    turned = Rotation.from_rotvec(angle[:, None] * [1.0, 0.0, 0.0]).as_matrix()
    positions = np.einsum("tij,mj->tmi", turned, rest) + hinge
    axes = Rotation.random(random_state=seed).as_matrix()
    return np.asarray(positions @ axes.T + rng.normal(size=3) + noise * rng.standard_normal(positions.shape))


def tracks_of(positions: Array) -> Tracks:
    """Return ``positions`` [T, K, 3] as unlabelled tracks of 200 frames per second."""
    names = tuple(f"t{k:02d}" for k in range(positions.shape[1]))
    return Tracks("unsettled", np.arange(len(positions)) / 200.0, names, positions)


@lru_cache
def unsettled() -> tuple[Unsettled, ...]:
    """Return all cases."""
    flat, even = grid_wing(4, flat=True, symmetric=False), grid_wing(4, flat=False, symmetric=True)
    solid = grid_wing(4, flat=False, symmetric=False)
    rng = np.random.default_rng(9)
    walk = np.cumsum(2e-3 * rng.standard_normal((_FRAMES, 20, 3)), axis=0) + 0.1 * rng.standard_normal((20, 3))
    shuffled = replace(
        solid, markers=tuple(replace(one, position=(*rng.uniform([-0.05, 0.05], [0.06, 0.29]).tolist(), 0.006))
                             for one in solid.markers),
    )  # fmt: skip
    return (
        Unsettled("all markers in the plane of the hinge: left or right", tracks_of(rigid(flat)), flat),
        Unsettled("markers symmetric fore and aft, without names", tracks_of(rigid(even)), even),
        Unsettled("a wing that hardly moves", tracks_of(rigid(solid, 0.02)), solid),
        Unsettled("half the stroke of the described drive", tracks_of(rigid(solid, 0.25)), solid),
        Unsettled("millimetres read as metres", tracks_of(1e3 * rigid(solid)), solid),
        Unsettled("points that wander", tracks_of(walk), solid),
        Unsettled("markers at other places than described", tracks_of(rigid(solid)), shuffled),
        Unsettled("another wing", tracks_of(rigid(WINGS["bird"][0], 0.5)), WINGS["robird"][0]),
    )
