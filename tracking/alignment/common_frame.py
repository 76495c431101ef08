"""One frame for recordings of the same cameras: the mean of the frames that were found in each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail
from wingfit.tracking.alignment.result import AlignedTracks, MarkerResult

MOST_APART = 4.0  # standard errors by which the frame of a recording may differ from the mean


def in_common_frame(every: Sequence[AlignedTracks]) -> tuple[AlignedTracks, ...]:
    """Return the alignments ``every``, of recordings by cameras that stayed where they were, in their common frame.

    Small errors of the frame would otherwise differ between recordings, as if the wing were mounted anew for each.
    The stated errors of the frame stay as they are, since most of them come from the model, and are alike in all.
    DatasetError if the side of one differs, or if its frame is too far from the mean of all.
    """
    first = every[0]
    for one in every:
        if one.side != first.side:
            message = (
                f"it shows a {one.side} wing, {first.file} a {first.side} one: align recordings of one wing together"
            )
            raise fail(one.file, one.side, message)
    mirror = np.diag([1.0, 1.0 if first.side == "right" else -1.0, 1.0])
    turn = mirror @ Rotation.from_matrix([mirror @ one.rotation for one in every]).mean().as_matrix()
    origin = np.mean([one.origin for one in every], axis=0)
    _check_near(max(every, key=lambda one: _apart(one, turn, origin).max()), turn, origin)
    return tuple(_moved(one, turn, origin) for one in every)


def _apart(one: AlignedTracks, turn: Array, origin: Array) -> Float[Array, " 6"]:
    """Return how far the frame of ``one`` is turned about x, y, z, and shifted along them, in standard errors."""
    away = Rotation.from_matrix(one.rotation @ turn.T).as_rotvec()  # both are mirrored, or none
    shift = one.rotation @ (one.origin - origin)
    return np.asarray(np.abs(np.concatenate([away / one.rotation_error, shift / one.origin_error])))


def _check_near(one: AlignedTracks, turn: Array, origin: Array) -> None:
    """Raise DatasetError if the frame of ``one`` is far from ``turn`` [3, 3] and ``origin`` [3] (m)."""
    apart = _apart(one, turn, origin)
    worst = int(np.argmax(apart))
    if apart[worst] <= MOST_APART:
        return
    errors = np.concatenate([np.degrees(one.rotation_error), 1e3 * one.origin_error])
    what, unit = ("turned about", "deg") if worst < 3 else ("shifted along", "mm")
    value = f"{apart[worst] * errors[worst]:.3g}"
    message = (
        f"its frame is {what} the wing's {'xyzxyz'[worst]} by {value} {unit} against the mean of all recordings; at "
        f"most {MOST_APART * errors[worst]:.3g} {unit} are accepted: if the cameras were moved or calibrated anew, "
        "align it by itself"
    )
    raise fail(one.file, value, message)


def _moved(one: AlignedTracks, turn: Array, origin: Array) -> AlignedTracks:
    """Return ``one`` in the frame with the axes ``turn`` [3, 3] and the ``origin`` [3] (m) in those of the tracks."""

    def moved(places: Array) -> Array:
        return np.asarray((places @ one.rotation + one.origin - origin) @ turn.T)

    rest = moved(np.array([marker.rest_m for marker in one.results]))
    results = tuple(
        _placed(marker, (float(x), float(y), float(z))) for marker, (x, y, z) in zip(one.results, rest, strict=True)
    )
    return replace(one, positions=moved(one.positions), rotation=turn, origin=origin, results=results)


def _placed(marker: MarkerResult, rest: tuple[float, float, float]) -> MarkerResult:
    return replace(marker, rest_m=rest)
