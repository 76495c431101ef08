"""The result of an alignment: tracks in the wing's frame, the frame, the labels, and how well all of it is known."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.files.table import write_table
from wingfit.tracking.alignment.identity import Exchange
from wingfit.tracking.alignment.request import Side

Axes = Literal["wing", "body"]
_DECIMALS = 9  # of metres


@dataclass(frozen=True)
class MarkerResult:
    """One marker that was recognised.

    Attributes:
        marker, track: its names in the description and in the tracks.
        seen: fraction of the frames that show it.
        residual_m: RMS distance of its samples from the modelled motion, m.
        rest_m, rest_error_m: estimated rest position (x, y, z) in the wing frame and its standard errors, m.
        moved_m: distance of this rest position from the described one, m.
    """

    marker: str
    track: str
    seen: float
    residual_m: float
    rest_m: tuple[float, float, float]
    rest_error_m: tuple[float, float, float]
    moved_m: float


@dataclass(frozen=True)
class DroppedTrack:
    """A track that is no described marker, and the reason."""

    track: str
    reason: str


@dataclass(frozen=True, eq=False)
class AlignedTracks:
    """Tracks of a wing in its own frame: x aft, y outboard, z up; those of a left wing are mirrored into it.

    Attributes:
        file: name of the file of the tracks.
        side: of the wing, "left" or "right".
        markers: described names [N] of the markers that were recognised.
        times: [T], s.
        positions: [T, N, 3], m; NaN where not seen.
        rotation: [3, 3] from the axes of the tracks to those of the wing; with determinant -1 for a left wing.
        origin: [3] position of the wing frame's origin in the axes of the tracks, m. Where the body moves, both are
            those of its mean pose. ``positions`` = (track - origin) @ rotation.T.
        rotation_error: [3] standard errors of small rotations about x, y, z of the wing, rad.
        origin_error: [3] standard errors of the origin along x, y, z of the wing, m.
        flap_frequency: on the clock of the cameras, Hz. With a strobe it is the true one if the user said what it is
            about, and else as it appears in the frames.
        flap_amplitude, mean_flap: half the range of the flap angle, and its mean over the beat, rad.
        noise: standard deviation of a coordinate of a sample against the modelled motion, m.
        rest_scatter: standard deviation of the described rest positions, m.
        side_evidence: twice the ln of the odds for this side; None if the side was given.
        results: of each marker.
        rest_covariance: [3 N, 3 N] of the rest positions, m^2, in the order of ``markers``, x, y, z each.
        exchanges: parts of tracks that belong to other markers than their tracks.
        dropped: tracks that are not used.
        lost_samples: count of samples of markers' tracks that were near no marker.
        remarks: what else the reader should know.
    """

    file: str
    side: Side
    markers: tuple[str, ...]
    times: Float[Array, " T"]
    positions: Float[Array, "T N 3"]
    rotation: Float[Array, "3 3"]
    origin: Float[Array, " 3"]
    rotation_error: Float[Array, " 3"]
    origin_error: Float[Array, " 3"]
    flap_frequency: float
    flap_amplitude: float
    mean_flap: float
    noise: float
    rest_scatter: float
    side_evidence: float | None
    results: tuple[MarkerResult, ...]
    rest_covariance: Array
    exchanges: tuple[Exchange, ...]
    dropped: tuple[DroppedTrack, ...]
    lost_samples: int
    remarks: tuple[str, ...]

    def csv(self, axes: Axes = "wing") -> str:
        """Return the tracks as a table: seconds, metres, an empty cell for a gap.

        ``axes``: "wing" for ``recordings/<name>.csv`` (docs/formats.md); "body" for x to the nose, y right, z down, as
        ``wingfit kinematics`` reads them (docs/tracking.md), with the origin of the wing frame.
        """
        signs = (1, 1, 1) if axes == "wing" else (-1, 1 if self.side == "right" else -1, -1)
        columns = [f"{marker}_{axis}_m" for marker in self.markers for axis in "xyz"]
        values = np.round(self.positions * signs, _DECIMALS) + 0.0  # not -0
        return write_table(columns, self.times, values.reshape(len(self.times), -1))

    def as_json(self) -> dict[str, Any]:
        """Return everything but the positions and the covariance, for JSON; angles in degrees."""
        return {
            "file": self.file,
            "side": self.side,
            "frames": len(self.times),
            "rotation": self.rotation.tolist(),
            "origin_m": self.origin.tolist(),
            "rotation_error_deg": np.degrees(self.rotation_error).tolist(),
            "origin_error_m": self.origin_error.tolist(),
            "flap_frequency_hz": self.flap_frequency,
            "flap_amplitude_deg": float(np.degrees(self.flap_amplitude)),
            "mean_flap_deg": float(np.degrees(self.mean_flap)),
            "noise_m": self.noise,
            "rest_scatter_m": self.rest_scatter,
            "side_evidence": self.side_evidence,
            "markers": [asdict(one) for one in self.results],
            "exchanges": [asdict(one) for one in self.exchanges],
            "dropped": [asdict(one) for one in self.dropped],
            "lost_samples": self.lost_samples,
            "remarks": list(self.remarks),
        }
