"""Collects the result of an alignment from the final fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Index
from wingfit.records.wing import Wing
from wingfit.tracking.alignment.fit import Fit
from wingfit.tracking.alignment.flapping import Flapping, half_range
from wingfit.tracking.alignment.identity import Exchange
from wingfit.tracking.alignment.request import Tracks
from wingfit.tracking.alignment.result import AlignedTracks, DroppedTrack, MarkerResult

_POSE = 7  # parameters before the rest positions in the covariance of a fit
MODEL_ERROR = np.radians([0.25, 0.06, 0.1])
"""Standard errors of rotations about x, y, z due to the kinematic model, rad (docs/alignment.md)."""
SHIFT_ERROR = 3e-4  # standard error of the origin due to the model, spans


@dataclass(frozen=True, eq=False)
class Frame:
    """The wing's axes ``turn`` [3, 3], its hinge [3] (m), flapping, flap frequency (Hz), mean angle (rad), evidence."""

    turn: Array
    hinge: Array
    flapping: Flapping
    frequency: float
    zero: float
    evidence: float | None


def aligned(
    tracks: Tracks,
    wing: Wing,
    final: Fit,
    frame: Frame,
    used: Index,
    shown: Index,
    mine: Array,
    changed: Sequence[Exchange],
    dropped: Sequence[DroppedTrack],
    lost: int,
    remarks: Sequence[str],
) -> AlignedTracks:
    """Return the result; ``used`` [N] markers, ``shown`` [T, M] tracks of all markers, ``mine`` [T, N, 3] positions."""
    hinge = np.array([0.0, wing.hinge.y, wing.hinge.z])
    origin = frame.hinge - frame.turn.T @ hinge
    covariance = final.covariance
    rest_covariance = covariance[_POSE:, _POSE:]
    errors = np.sqrt(np.diag(rest_covariance)).reshape(-1, 3)
    span = wing.span
    results = []
    for n, m in enumerate(used):
        tracks_of = shown[:, m][shown[:, m] >= 0]
        residuals = final.residuals[:, n]
        moved = final.rest[n] + hinge - np.array(wing.markers[m].position)
        results.append(
            MarkerResult(
                marker=wing.markers[m].name,
                track=tracks.names[int(np.bincount(tracks_of).argmax())],
                seen=len(tracks_of) / len(tracks.times),
                residual_m=float(np.sqrt(np.nanmean((residuals**2).sum(axis=-1)))),
                rest_m=_triple(final.rest[n] + hinge),
                rest_error_m=_triple(errors[n]),
                moved_m=float(np.linalg.norm(moved)),
            )
        )
    pose = np.sqrt(np.diag(covariance)[:5])
    rotation_error = np.hypot([final.flap_error, pose[0], pose[1]], MODEL_ERROR)
    return AlignedTracks(
        file=tracks.file,
        side="right" if final.right else "left",
        markers=tuple(one.marker for one in results),
        times=tracks.times,
        positions=np.asarray((mine - origin) @ frame.turn.T),
        rotation=frame.turn,
        origin=origin,
        rotation_error=rotation_error,
        origin_error=np.hypot(pose[2:5], np.hypot(SHIFT_ERROR * span, _by_rotation(final.rest))),
        flap_frequency=frame.frequency,
        flap_amplitude=half_range(frame.flapping.harmonics),
        mean_flap=frame.zero,
        noise=final.noise,
        rest_scatter=final.scatter,
        side_evidence=frame.evidence,
        results=tuple(results),
        rest_covariance=rest_covariance,
        exchanges=tuple(changed),
        dropped=tuple(dropped),
        lost_samples=lost,
        remarks=tuple(remarks),
    )


def _by_rotation(rest: Array) -> Array:
    """Standard errors [3] of the hinge's position (m) by those of rotations, since the markers' middle is fixed.

    ``rest`` [N, 3]: hinge coordinates of the markers, m. Rotations about x do not move the hinge.
    """
    _, y, _ = rest.mean(axis=0)
    return np.array([MODEL_ERROR[2] * abs(y), 0.0, 0.0])


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
