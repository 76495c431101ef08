"""The hinge of a wing: the common centre of the circles on which its markers move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.importers.start.correlation import correlated_rows
from wingfit.importers.start.harmonics import columns
from wingfit.importers.tracks import ImportedTracks
from wingfit.records.array_types import Array, Float, Mask

_NEAR = 0.1  # of the largest radius: markers so near the hinge show no circle
_STEADY = 0.03  # of the radii: what they vary with time and flap angle, at most, for a hinge that is found
_SCATTER = 0.04  # of the radii: what they vary at all, at most
_CERTAIN = 0.1  # of the largest radius: standard error of the centre, at most
_STEPS = 10
_HARMONICS = 4
_ROWS_EACH = 4  # rows for each coefficient of a motion that repeats, at least
_WHITE = 0.3  # autocorrelation of noise over one row, at most


@dataclass(frozen=True)
class Hinge:
    """A hinge at ``place`` (y and z, m); ``source`` says whether it is from the tracks or assumed.

    ``error``: standard error of the place (m), None if the hinge is assumed.
    """

    place: Array
    source: str
    error: float | None = None

    @property
    def found(self) -> bool:
        """Return whether the tracks show the hinge."""
        return self.error is not None


def find_hinge(tracks: ImportedTracks, frequency: float, *, drifts: bool) -> Hinge:
    """Return the common centre of the circles on which the markers move in the y-z plane, if they are circles.

    They are if their radii vary neither with time nor with the harmonics of ``frequency`` (Hz). Otherwise, or if the
    body ``drifts``, the hinge is assumed, in the origin or beside the innermost marker.
    """
    measured = tracks.positions[..., 1:]
    planar = _without_noise(tracks.times, measured, frequency)
    noise = float(np.sqrt(np.nanmean((measured - planar) ** 2)))
    middle = np.nanmedian(planar, axis=0)
    inside = float(middle[:, 0].min())
    centre = _first_centre(planar)
    for _ in range(_STEPS):
        step, error = _step(planar, centre, noise)
        centre = centre + step
    radii = np.hypot(*np.moveaxis(planar - centre, 2, 0))
    mean = np.nanmean(radii, axis=0)
    far = mean > _NEAR * mean.max()
    beside = centre[0] < middle[far, 0].min() or centre[0] > middle[far, 0].max()
    if not drifts and beside and error < _CERTAIN * mean.max() and _are_steady(tracks.times, radii[:, far], frequency):
        error *= _dependence((planar - centre)[:, far], noise)
        return Hinge(np.round(centre, 6) + 0.0, "from the tracks: the markers move on circles about it", error)
    if inside > 0:
        return Hinge(np.zeros(2), "assumed: the origin of the axes")
    span = float(middle[:, 0].max()) - inside
    place = np.array([inside - 0.1 * span, middle[np.argmin(middle[:, 0]), 1]])
    return Hinge(place, "assumed: beside the innermost marker")


def _without_noise(times: Array, planar: Float[Array, "T M 2"], frequency: float) -> Float[Array, "T M 2"]:
    """Return the part that repeats with ``frequency`` (Hz), if the rest is noise from row to row; else all.

    Noise that is not small beside the height of an arc moves its centre.
    """
    basis = columns(times, frequency, _HARMONICS)
    values = planar.reshape(len(times), -1)
    seen = np.isfinite(values)
    if seen.sum(axis=0).min() < _ROWS_EACH * basis.shape[1]:
        return planar
    repeated, before, rest = np.full_like(values, np.nan), 0.0, 0.0
    alike: dict[bytes, list[int]] = {}  # columns with the same gaps, which are fitted at once
    for k in range(values.shape[1]):
        alike.setdefault(seen[:, k].tobytes(), []).append(k)
    for chosen in map(np.array, alike.values()):
        there = np.flatnonzero(seen[:, chosen[0]])
        measured = values[np.ix_(there, chosen)]
        fitted = basis[there] @ np.linalg.lstsq(basis[there], measured, rcond=None)[0]
        repeated[np.ix_(there, chosen)] = fitted
        left = measured - fitted
        before, rest = before + float((left[1:] * left[:-1]).sum()), rest + float((left**2).sum())
    return repeated.reshape(planar.shape) if before < _WHITE * rest else planar


def _first_centre(planar: Float[Array, "T M 2"]) -> Array:
    """Return y and z (m) of the centre with the least algebraic misfit (Kasa 1976), which noise pulls inwards."""
    squares = (planar**2).sum(axis=2)
    # Less the means of each marker, which stand for its radius: a column for each would not fit in memory.
    rows = 2 * (planar - np.nanmean(planar, axis=0)).reshape(-1, 2)
    right = (squares - np.nanmean(squares, axis=0)).ravel()
    seen = np.isfinite(right)
    found: Array = np.linalg.lstsq(rows[seen], right[seen], rcond=None)[0]
    return found


def _step(planar: Float[Array, "T M 2"], centre: Array, noise: float) -> tuple[Array, float]:
    """Return a Gauss-Newton step (m) to the least geometric misfit, and the standard error (m) of the centre.

    ``noise`` (m) of a coordinate, which is no longer in ``planar``.
    """
    away = planar - centre
    radii = np.hypot(away[..., 0], away[..., 1])
    means = np.nanmean(radii, axis=0)
    far = means > _NEAR * means.max()
    unit = away[:, far] / np.maximum(radii[:, far], 1e-12)[..., None]
    jacobian = (unit - np.nanmean(unit, axis=0)).reshape(-1, 2)
    misfit = (radii - means)[:, far].ravel()
    seen: Mask = np.isfinite(misfit)
    jacobian, misfit = jacobian[seen], misfit[seen]
    step = np.linalg.lstsq(jacobian, misfit, rcond=None)[0]
    least = float(np.linalg.svd(jacobian, compute_uv=False)[-1])
    scatter = float(np.sqrt((misfit**2).mean() + noise**2))
    return step, scatter / max(least, 1e-12)


def _dependence(away: Float[Array, "T M 2"], noise: float) -> float:
    """Return by how much the standard error grows as the misfit of the circles varies slowly from row to row.

    ``away`` (m) from the centre; ``noise`` (m), no longer in it, is independent in each row. What counts is the misfit
    times its derivative by the distance of the centre (Newey and West 1987).
    """
    radii = np.hypot(away[..., 0], away[..., 1])
    misfit = radii - np.nanmean(radii, axis=0)
    direction = np.nanmean(away, axis=(0, 1))
    along = away @ (direction / max(float(np.hypot(*direction)), 1e-12)) / np.maximum(radii, 1e-12)
    rows = correlated_rows((along - np.nanmean(along, axis=0)) * misfit)
    spread = float(np.nanmean(misfit**2))
    return float(np.sqrt((noise**2 + rows * spread) / max(noise**2 + spread, 1e-300)))


def _are_steady(times: Array, radii: Float[Array, "T M"], frequency: float) -> bool:
    basis = columns(times, frequency, 2, drifts=True)
    varied, scatter, size = 0.0, 0.0, 0.0
    for column in radii.T:
        seen = np.isfinite(column)
        fitted = basis[seen] @ np.linalg.lstsq(basis[seen], column[seen], rcond=None)[0]
        varied += float(fitted.var())
        scatter += float(column[seen].var())
        size += float(column[seen].mean()) ** 2
    return varied < _STEADY**2 * size and scatter < _SCATTER**2 * size
