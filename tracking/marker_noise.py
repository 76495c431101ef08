"""The noise of aligned markers from the covariances that a tracker wrote: for ``dataset.yaml``."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.description.yaml_text import write_yaml
from wingfit.records.errors import DatasetError, check_most, fail, nearest
from wingfit.tracking.alignment.result import AlignedTracks

LARGEST_BYTES = 2_000_000_000  # of an unpacked array: an hour of frames of 50 markers takes a third of it
INDEPENDENT = 2e-4  # share of the noise of a coordinate that is independent, at least
PAIRS = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, eq=False)
class MarkerNoise:
    """Noise of the coordinates of N ``markers`` in the axes of the wing.

    Attributes:
        markers: described names [N].
        standard_deviation: [N, 3] along x, y and z, m.
        correlation: [N, 3] of x with y, x with z, and y with z.
    """

    markers: tuple[str, ...]
    standard_deviation: Float[Array, "N 3"]
    correlation: Float[Array, "N 3"]

    def yaml(self) -> str:
        """Return the keys ``standard_deviation_m`` and ``noise_correlation`` of a recording in ``dataset.yaml``."""
        sizes = [[float(f"{value:.4g}") for value in row] for row in self.standard_deviation.tolist()]
        pairs = [[round(value, 6) for value in row] for row in self.correlation.tolist()]
        data = {"standard_deviation_m": sizes, "noise_correlation": pairs}
        return write_yaml({key: dict(zip(self.markers, rows, strict=True)) for key, rows in data.items()})


def marker_noise(aligned: AlignedTracks, covariance: str | PathLike[str]) -> MarkerNoise:
    """Return the noise of the markers of ``aligned``, from the covariances of the tracks before their alignment.

    Args:
        aligned: tracks in the wing's frame.
        covariance: file that ``wingfit track --covariance`` wrote with these tracks: ``names`` [K], and ``covariance``
            [T, K, 3, 3] (m^2; NaN where a marker was not found) in the axes of the cameras.

    Returns:
        The mean over the instants, turned into the axes of the wing.

    Raises:
        DatasetError: it is no such file, has no covariance of a marker, or one that noise cannot have.

    """
    names, every = _read(Path(covariance))
    return noise_in_wing_axes(aligned, names, every, str(covariance))


def noise_in_wing_axes(
    aligned: AlignedTracks, names: Sequence[str], covariance: Float[Array, "T K 3 3"], where: str
) -> MarkerNoise:
    """Return the noise of the markers of ``aligned`` from the ``covariance`` (m^2) of K tracks with ``names``.

    ``where`` the covariances come from, for messages; arguments and DatasetError as of :func:`marker_noise`.
    """
    tracks = {one.marker: one.track for one in aligned.results}
    found = np.stack([_mean(tracks[marker], names, covariance, where) for marker in aligned.markers])
    found = aligned.rotation @ found @ aligned.rotation.T
    spread = np.sqrt(np.einsum("nii->ni", found))
    correlation = np.stack([found[:, i, j] / (spread[:, i] * spread[:, j]) for i, j in PAIRS], axis=1)
    # Cameras far away and close together: with a little independent noise, six digits are a covariance still.
    matrices = found / (spread[:, :, None] * spread[:, None, :])
    correlation[np.linalg.eigvalsh(matrices)[:, 0] < INDEPENDENT] *= 1.0 - INDEPENDENT
    return MarkerNoise(aligned.markers, spread, correlation)


def _mean(track: str, names: Sequence[str], covariance: Float[Array, "T K 3 3"], where: str) -> Float[Array, "3 3"]:
    """Return the covariance [3, 3] (m^2) of ``track``, mean over the instants at which it was found."""
    if track not in names:
        raise fail(where, track, f"has no covariance of track {track!r}; {nearest(track, list(names))}")
    own = covariance[:, list(names).index(track)]
    own = own[np.isfinite(own).all(axis=(1, 2))]
    if not len(own):
        raise fail(where, track, f"has no finite covariance of track {track!r}; track the film again")
    found = np.asarray(own.mean(axis=0))
    spread = np.sqrt(np.maximum(np.diag(found), np.finfo(float).tiny))
    least = float(np.linalg.eigvalsh(found / np.outer(spread, spread)).min())
    if not least > 0.0:
        what = f"the least eigenvalue of the correlations of track {track!r} is {least:.2g}"
        raise fail(where, f"{least:.2g}", f"{what}; that of noise is above 0: track the film again")
    return found


def _read(path: Path) -> tuple[list[str], Float[Array, "T K 3 3"]]:
    """Return names [K] and covariances of the file ``path``."""
    remedy = "give the file that wingfit track --covariance wrote"
    try:
        with zipfile.ZipFile(path) as packed:
            size = sum(one.file_size for one in packed.infolist())
        check_most(str(path), "holds", size, LARGEST_BYTES, "bytes unpacked", "track a part of the film")
        with np.load(path, allow_pickle=False) as stored:
            names, covariance = [str(one) for one in stored["names"]], np.asarray(stored["covariance"], float)
    except DatasetError:
        raise
    except OSError as error:
        raise fail(str(path), None, f"cannot be read: {error.strerror or error}; {remedy}") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, KeyError, ValueError, TypeError, RuntimeError) as error:
        raise fail(str(path), None, f"is no file of covariances ({error}); {remedy}") from error
    if covariance.ndim != 4 or covariance.shape[1:] != (len(names), 3, 3):
        shape = list(covariance.shape)
        raise fail(str(path), str(shape), f"holds covariances {shape}; they must be [T, {len(names)}, 3, 3]: {remedy}")
    return names, covariance
