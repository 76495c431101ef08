"""The motion of a rigid wing: it turns with the drive, so that nothing is integrated."""

from __future__ import annotations

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.sim.kernels import LANES
from wingfit.sim.solver.settle import Subject
from wingfit.sim.solver.simulate import Beat

SAMPLES = 256  # of a beat; the series of cos and sin of the flap angle converge faster than exponentially


def rigid_beats(subject: Subject, genomes: Float[Array, "B G"]) -> tuple[Beat, ...]:
    """Return one beat of each of ``genomes``: positions of the markers by Rodrigues' formula, exact to round-off.

    Loads, energies and powers are NaN: they are not computed for a rigid wing.
    """
    beats: list[Beat] = []
    for start in range(0, len(genomes), LANES):
        chunk = genomes[start : start + LANES]
        beats += [_beat(tracks) for tracks in _tracks(subject, chunk)[: len(chunk)]]
    return tuple(beats)


def _tracks(subject: Subject, genomes: Float[Array, "B G"]) -> Float[Array, "W n M 3"]:
    """Return the markers of up to LANES individuals at equal steps of the drive phase, m."""
    scene, wing = subject.scene(genomes), subject.structure.wing
    angle = scene.rods.angles(2 * np.pi * np.arange(SAMPLES) / SAMPLES)[:, 0, 0].T[:, :, None, None]
    axis, offset, place = (scene.lanes.hinge[k : k + 3].T[:, None, None, :] for k in (0, 3, 6))
    hinge = np.array([0.0, wing.hinge.y, wing.hinge.z])
    arms = np.array([marker.position for marker in wing.markers]) - hinge - offset
    along = (arms * axis).sum(axis=-1, keepdims=True) * axis
    turned = along + np.cos(angle) * (arms - along) + np.sin(angle) * np.cross(np.broadcast_to(axis, arms.shape), arms)
    return np.asarray(place + turned)


def _beat(tracks: Float[Array, "n M 3"]) -> Beat:
    n = len(tracks)
    rods, air, energy, power = (np.full(shape, np.nan) for shape in ((n, 2, 6), (n, 3), (n, 3), (n, 4)))
    return Beat(tracks, rods, air, energy, power, beats=1, error=0.0, growth=0.0, reason=None)
