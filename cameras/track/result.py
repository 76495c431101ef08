"""Tracks of markers in space, with covariances, and what was seen."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.files.table import write_table


@dataclass(frozen=True, eq=False)
class TrackedFilm:
    """Tracks of the markers of a wing in the axes of the cameras.

    Attributes:
        names: of the markers, K of them.
        times: [T] (s), on the clock of the first camera.
        positions: [T, K, 3] (m); NaN where a marker was not found.
        covariance: [T, K, 3, 3] (m^2) of the positions, from the pixels; errors of the calibration are not in it.
        by_calibration: [K, 3, 3] (m^2), covariance from that of the calibration, mean over the instants; the error is
            nearly the same at all instants. None if the cameras' covariance is unknown.
        pixels: [T, C, K, 2], where the cameras saw the markers; NaN where they did not.
        residuals: [T, C, K, 2] (pixels), seen minus projected.
        cameras: names.
        frames: [T, C], frame of each camera that shows the instant.
        pixel_error: standard deviation (pixels) beside that of each detection, for which the misfits are as expected.
        rejected: [K], count of places left out: rays do not meet, the marker jumps, or a gap between two chequers was
            taken for it.
        bad_frames: numbers of the frames that could not be decoded, of each camera.
        remarks: what was estimated or is doubtful.
    """

    names: tuple[str, ...]
    times: Float[Array, " T"]
    positions: Float[Array, "T K 3"]
    covariance: Float[Array, "T K 3 3"]
    by_calibration: Float[Array, "K 3 3"] | None
    pixels: Float[Array, "T C K 2"]
    residuals: Float[Array, "T C K 2"]
    cameras: tuple[str, ...]
    frames: Array
    pixel_error: float
    rejected: Array
    bad_frames: tuple[tuple[int, ...], ...]
    remarks: tuple[str, ...]

    @property
    def found(self) -> Array:
        """Return where [T, K] a marker has a place."""
        return np.asarray(np.isfinite(self.positions).all(2))

    def csv(self) -> str:
        """Return the tracks as CSV: ``time_s``, and x, y, z of each marker in m."""
        columns = [f"{name}_{axis}_m" for name in self.names for axis in "xyz"]
        return write_table(columns, self.times, self.positions.reshape(len(self.times), -1))

    def write_covariance(self, path: Path) -> None:
        """Write names, times and covariances (m^2) to ``path``, a NumPy archive."""
        arrays = {"names": np.array(self.names), "times": self.times, "covariance": self.covariance}
        if self.by_calibration is not None:
            arrays["by_calibration"] = self.by_calibration
        with path.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **arrays)

    def as_json(self) -> dict[str, Any]:
        """Return the summary of the tracks as JSON."""
        found = self.found
        deviation = np.sqrt(np.trace(self.covariance, axis1=2, axis2=3) / 3)
        rms = np.sqrt(np.nanmean(self.residuals**2, axis=(0, 2, 3)))
        return {
            "instants": len(self.times),
            "seconds": float(self.times[-1] - self.times[0]),
            "markers": {
                name: {
                    "found_percent": round(100 * float(found[:, k].mean()), 2),
                    "standard_deviation_mm": _rounded(1e3 * _median(deviation[:, k])),
                    "rejected": int(self.rejected[k]),
                }
                for k, name in enumerate(self.names)
            },
            "markers_found_median": float(np.median(found.sum(1))),
            "cameras": {
                name: {"residual_px": _rounded(float(rms[k])), "bad_frames": list(self.bad_frames[k])[:20]}
                for k, name in enumerate(self.cameras)
            },
            "pixel_error_px": _rounded(self.pixel_error),
            "remarks": list(self.remarks),
        }


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def _rounded(value: float) -> float | None:
    return round(value, 5) if np.isfinite(value) else None
