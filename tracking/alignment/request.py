"""What is given to an alignment: tracks in camera axes, and what the user knows about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.errors import Faults, fail, nearest
from wingfit.records.wing import Wing

LEAST_FRAMES, LEAST_TRACKS = 16, 5
Side = Literal["left", "right"]


@dataclass(frozen=True, eq=False)
class Tracks:
    """Tracks of a recording in any axes: ``times`` [T] (s), ``names`` [K], ``positions`` [T, K, 3] (m; NaN: not seen).

    ``file`` names them in messages.
    """

    file: str
    times: Float[Array, " T"]
    names: tuple[str, ...]
    positions: Float[Array, "T K 3"]

    def only(self, keep: Array) -> Tracks:
        """Return the tracks in ``keep`` [K], a mask."""
        names = tuple(name for name, one in zip(self.names, keep, strict=True) if one)
        return Tracks(self.file, self.times, names, self.positions[:, keep])


@dataclass(frozen=True)
class Known:
    """What the user states.

    Attributes:
        side: of the body on which the wing is.
        up: direction of the cameras' axes that is up on the wing's rig, for example "z" or "-y".
        labels: marker of a track, by the name of the track.
        ignore_names: names of tracks say nothing about markers.
        body: names of tracks on the body that carries the hinge.
        mean_flap_deg: mean flap angle over the beat, degrees; by default that of the described drive.
        flap_frequency_hz: flap frequency as set on the rig, Hz; needed for frames of a strobe.
    """

    side: Side | None = None
    up: str | None = None
    labels: Mapping[str, str] = field(default_factory=dict)
    ignore_names: bool = False
    body: tuple[str, ...] = ()
    mean_flap_deg: float | None = None
    flap_frequency_hz: float | None = None

    def check(self, tracks: Tracks, wing: Wing) -> None:
        """Raise DatasetError that lists statements which name unknown tracks, markers or directions."""
        faults = Faults()
        self._check_names(tracks, wing, faults)
        if self.side not in (None, "left", "right"):
            faults.add("--side", self.side, f"is {self.side!r}; it must be left or right")
        if self.up is not None and self.up.lstrip("+-") not in ("x", "y", "z"):
            faults.add("--up", self.up, f"is {self.up!r}; it must be x, y, z, -x, -y or -z: an axis of the tracks")
        if 0 < len(self.body) < 3:
            faults.add(
                "--body", len(self.body), f"names {len(self.body)} tracks; a body needs 3 that are not on a line"
            )
        if len(set(self.labels.values())) < len(self.labels):
            faults.add("--label", None, "gives one marker to two tracks; a marker has one track")
        if self.mean_flap_deg is not None and not abs(self.mean_flap_deg) < 90:
            faults.add(
                "--mean-flap-deg", self.mean_flap_deg, f"is {self.mean_flap_deg:g} deg; it must be within +-90 deg"
            )
        if self.flap_frequency_hz is not None and not 0.01 <= self.flap_frequency_hz <= 1000:
            value = f"{self.flap_frequency_hz:g}"
            faults.add("--flap-frequency-hz", value, f"is {value} Hz; it must be from 0.01 to 1000 Hz")
        faults.raise_any()

    def _check_names(self, tracks: Tracks, wing: Wing, faults: Faults) -> None:
        markers = [marker.name for marker in wing.markers]
        for track, marker in self.labels.items():
            if track not in tracks.names:
                faults.add("--label", track, f"there is no track {track!r}; {nearest(track, tracks.names)}")
            if marker not in markers:
                faults.add("--label", marker, f"there is no described marker {marker!r}; {nearest(marker, markers)}")
        for name in self.body:
            if name not in tracks.names:
                faults.add("--body", name, f"there is no track {name!r}; {nearest(name, tracks.names)}")

    def up_vector(self) -> Array | None:
        """Return the unit vector [3] that is up in the axes of the tracks; None if it was not given."""
        if self.up is None:
            return None
        vector = np.zeros(3)
        vector["xyz".index(self.up.lstrip("+-"))] = -1.0 if self.up.startswith("-") else 1.0
        return vector


def checked(tracks: Tracks, wing: Wing) -> None:
    """Raise DatasetError for tracks that cannot be aligned to ``wing`` whatever they are."""
    T, K = tracks.positions.shape[:2]
    if len(tracks.times) != T or len(tracks.names) != K or not (np.diff(tracks.times) > 0).all():
        raise fail(
            tracks.file, None, "times must increase, one for each row of positions, and names one for each track"
        )
    if np.isinf(tracks.positions).any():
        t, k = np.argwhere(np.isinf(tracks.positions).any(axis=-1))[0]
        infinite = (
            f"track {tracks.names[k]!r} is infinite at {tracks.times[t]:g} s; leave a position that was not seen empty"
        )
        raise fail(tracks.file, None, infinite)
    if T < LEAST_FRAMES:
        raise fail(tracks.file, T, f"holds {T} frames; at least {LEAST_FRAMES} are needed: record a beat or more")
    if K < LEAST_TRACKS:
        raise fail(tracks.file, K, f"holds {K} tracks; at least {LEAST_TRACKS} are needed: track more markers")
    if len(wing.markers) < LEAST_TRACKS:
        count = len(wing.markers)
        raise fail(
            "wing.markers", count, f"describes {count} markers; at least {LEAST_TRACKS} are needed: describe more"
        )
