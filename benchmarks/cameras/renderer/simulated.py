"""The wing of the virtual campaign of the thesis, simulated by wingfit, as a scene: its markers are where they move."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from benchmarks.cameras.renderer.scene import Poses, Scene, Surface, frames_of, grid_triangles
from wingfit.records import Condition, Genome, Wing
from wingfit.records.array_types import Array
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

_SIDE = 7  # the wing has 7 by 7 markers: the first index runs along the span, the second along the chord
_GAP = 0.8  # width of a marker relative to the distance to the nearest other one, at most


def simulated_scene(
    condition: Condition, changed: Mapping[str, float] | None = None, division: str = "11", size: float = 0.010
) -> Scene:
    """Return the wing in its periodic motion under ``condition``, with a chequer at each of its 49 markers.

    At time 0 the phase of the drive is 0. Tangents and surface follow from the motion of neighbouring markers.

    Args:
        condition: of :class:`wingfit.records.Condition`.
        changed: values of genes that differ from the wing's estimates; a name "effect.gene" switches the effect on.
        division: of the wing, see :class:`wingfit.sim.wing.division.Division`.
        size: greatest width of a marker, m; where markers are close, they are smaller.

    Raises:
        ValueError: the simulation fails.
    """
    wing, values = robird_wing(), dict(changed or {})
    effects = tuple(dict.fromkeys(name.partition(".")[0] for name in values if "." in name))
    model = FlexibleWing(wing, division, effects=effects)
    beat = model.beat(Genome.nominal(model.genes).replace(values).values, blank_recording(wing, condition))
    if beat.reason:
        raise ValueError(f"the simulation of the wing with {values or 'its estimates'} fails: {beat.reason}")
    rest = np.array([marker.position for marker in wing.markers])
    gap = np.linalg.norm(rest[:, None] - rest, axis=-1) + np.diag(np.full(len(rest), np.inf))
    slopes, outer = slope_weights(rest[:, :2]), edge_weights(wing, rest[:, :2])
    frequency, track = condition.flap_frequency, beat.tracks

    def poses(times: Array) -> Poses:
        positions = periodic(track, frequency * times)
        tangents = np.einsum("kdn,tni->tkdi", slopes, positions)
        return Poses(positions, frames_of(tangents[:, :, 0], tangents[:, :, 1]))

    def surface(times: Array) -> Array:
        return np.asarray(np.einsum("vn,tni->tvi", outer, periodic(track, frequency * times)))

    return Scene(
        poses,
        tuple(marker.name for marker in wing.markers),
        np.minimum(size, _GAP * gap.min(axis=1)),
        surface=Surface(surface, grid_triangles(_SIDE + 2, _SIDE + 2), margin=0.01),
    )


def periodic(tracks: Array, beats: Array) -> Array:
    """Evaluate the Fourier series of ``tracks`` [n, K, 3], n equal steps of a beat, at the times ``beats`` [T]."""
    series = np.fft.rfft(tracks, axis=0) / len(tracks)
    series[1 : (len(tracks) + 1) // 2] *= 2  # each stands for two frequencies, that of half the sampling rate for one
    turn = np.exp(2j * np.pi * np.arange(len(series)) * beats[:, None])
    return np.asarray(np.einsum("th,hki->tki", turn, series, optimize=True).real)


def slope_weights(plan: Array) -> Array:
    """Weights [K, 2, K] that give the slopes of positions along x and y at each marker of a 7 by 7 grid.

    They fit a plane by least squares to the marker and its up to eight neighbours. ``plan``: [K, 2] at rest, m.
    """
    weights = np.zeros((len(plan), 2, len(plan)))
    for k in range(len(plan)):
        i, j = divmod(k, _SIDE)
        near = [
            a * _SIDE + b
            for a in range(max(0, i - 1), min(_SIDE, i + 2))
            for b in range(max(0, j - 1), min(_SIDE, j + 2))
        ]
        design = np.column_stack([plan[near] - plan[k], np.ones(len(near))])
        weights[k][:, near] = np.linalg.pinv(design)[:2]
    return weights


def edge_weights(wing: Wing, plan: Array) -> Array:
    """Weights [81, K] that give the vertices of a surface of 9 by 9 points from the positions of the markers.

    The inner points are the markers, the outer ones are extrapolated along the surface to the edges of the wing.
    """
    stations = np.array([(s.y, s.leading_edge, s.chord) for s in wing.stations]).T
    spans = np.concatenate([[stations[0, 0]], plan[::_SIDE, 1], [stations[0, -1]]])
    lead, chord = np.interp(spans, stations[0], stations[1]), np.interp(spans, stations[0], stations[2])
    slopes, weights = slope_weights(plan), np.zeros((_SIDE + 2, _SIDE + 2, len(plan)))
    for i in range(_SIDE + 2):
        for j in range(_SIDE + 2):
            k = min(max(i - 1, 0), _SIDE - 1) * _SIDE + min(max(j - 1, 0), _SIDE - 1)
            share = (plan[k, 0] - np.interp(plan[k, 1], spans, lead)) / np.interp(plan[k, 1], spans, chord)
            share = {0: 0.0, _SIDE + 1: 1.0}.get(j, float(share))
            place = np.array([lead[i] + share * chord[i], spans[i]])
            weights[i, j, k] = 1.0
            weights[i, j] += (place - plan[k]) @ slopes[k]
    return weights.reshape(-1, len(plan))
