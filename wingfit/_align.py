"""Aligns tracks to a described wing, in this process."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Literal

from wingfit.importers import ImportedTracks, import_tracks
from wingfit.records import Wing
from wingfit.records.description.wing_description import read_wing
from wingfit.records.errors import fail
from wingfit.tracking.alignment import AlignedTracks, Known, Tracks, align, in_common_frame


def align_tracks(
    tracks: ImportedTracks | str | PathLike[str],
    wing: Wing | str | PathLike[str],
    *,
    side: Literal["left", "right"] | None = None,
    up: str | None = None,
    labels: Mapping[str, str] | None = None,
    ignore_names: bool = False,
    body: Sequence[str] = (),
    mean_flap_deg: float | None = None,
    flap_frequency_hz: float | None = None,
    report: Callable[[float], object] | None = None,
) -> AlignedTracks:
    """Align tracks in any camera axes to the frame of a described wing, and name its markers.

    Args:
        tracks: as :func:`wingfit.import_tracks` returns them, or a file that it reads without options.
        wing: its description, or a file with it: ``dataset.yaml``, or the keys of a wing alone.
        side: of the body on which the wing is; by default it is estimated.
        up: axis of the tracks that is up on the rig, for example "z" or "-y"; by default it is estimated.
        labels: marker of a track by the name of the track, where it is known.
        ignore_names: names of tracks say nothing about markers.
        body: tracks on the body that carries the hinge, three or more; its motion is removed.
        mean_flap_deg: mean flap angle over the beat; by default that of the described drive.
        flap_frequency_hz: as set on the rig. The true one on the clock of the cameras is then found in the tracks; by
            default the one that appears in the frames, which under a strobe is an alias.
        report: called with the part of the work that is done, from 0 to 1.

    Returns:
        The tracks in the wing's frame, the frame, the labels, residuals, and rest positions with standard errors.

    Raises:
        DatasetError: what is wrong with the tracks or the description, or what is not certain and would settle it.

    """
    known = Known(side, up, dict(labels or {}), ignore_names, tuple(body), mean_flap_deg, flap_frequency_hz)
    return _aligned(tracks, wing, known, report or (lambda _: None))


def align_recordings(
    tracks: Sequence[ImportedTracks | str | PathLike[str]],
    wing: Wing | str | PathLike[str],
    *,
    side: Literal["left", "right"] | None = None,
    up: str | None = None,
    labels: Mapping[str, str] | None = None,
    ignore_names: bool = False,
    body: Sequence[str] = (),
    mean_flap_deg: float | None = None,
    flap_frequency_hz: float | None = None,
    report: Callable[[float], object] | None = None,
) -> tuple[AlignedTracks, ...]:
    """Align recordings of one wing by cameras that stayed where they were: all get the mean of their frames.

    Args:
        tracks: of each recording, as in :func:`align_tracks`; as are the other arguments.
        wing: its description.
        side: of the body on which the wing is.
        up: axis of the tracks that is up on the rig.
        labels: marker of a track by the name of the track.
        ignore_names: names of tracks say nothing about markers.
        body: tracks on the body that carries the hinge.
        mean_flap_deg: mean flap angle over the beat.
        flap_frequency_hz: as set on the rig.
        report: called with the part of the work that is done, from 0 to 1.

    Returns:
        The tracks of each recording, as :func:`align_tracks` returns them.

    Raises:
        DatasetError: as there; or the frame of a recording is too far from that of the others.

    """
    if not tracks:
        raise fail("tracks", None, "no recording to align: give one or more")
    described = wing if isinstance(wing, Wing) else read_wing(wing)
    known = Known(side, up, dict(labels or {}), ignore_names, tuple(body), mean_flap_deg, flap_frequency_hz)
    found = list[AlignedTracks]()
    for number, one in enumerate(tracks):

        def part(done: float, before: int = number) -> None:
            if report:
                report((before + done) / len(tracks))

        found.append(_aligned(one, described, known, part))
    return in_common_frame(found)


def _aligned(
    tracks: ImportedTracks | str | PathLike[str],
    wing: Wing | str | PathLike[str],
    known: Known,
    report: Callable[[float], object],
) -> AlignedTracks:
    found = tracks if isinstance(tracks, ImportedTracks) else import_tracks(tracks)
    described = wing if isinstance(wing, Wing) else read_wing(wing)
    given = Tracks(found.file, found.times, found.markers, found.positions)
    return align(given, described, known, report)
