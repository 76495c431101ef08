"""Prints the results of ``wingfit align``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from wingfit.cli.base.output import mm, number, percent, remarks, say, table
from wingfit.records.camera_pose import CameraPose
from wingfit.tracking.alignment import AlignedTracks
from wingfit.tracking.alignment.result import MarkerResult

_DIGITS = 7  # of the axes of a camera, and after the point of metres and pixels


def show(found: AlignedTracks, cameras: Sequence[CameraPose] = (), *, is_true: bool) -> None:
    """Print the frame, the labels, the residuals and the rest positions.

    ``cameras``: of the calibration in whose axes the tracks were; printed in the wing's frame, for the dataset.
    ``is_true``: the flap frequency is not that of an alias.
    """
    frames = f"{len(found.times)} frames, {len(found.markers)} markers"
    say(f"{found.file}: {found.side} wing, {frames}, residual {mm(1e3 * found.noise)} mm")
    turned = np.degrees(found.rotation_error)
    rows = [
        [f"wing {axis}", *(f"{value:.5f}" for value in row)] for axis, row in zip("xyz", found.rotation, strict=True)
    ]
    rows = [[*row, f"{error:.2f}"] for row, error in zip(rows, turned, strict=True)]
    table(["axis", ">track x", ">track y", ">track z", ">error deg"], rows)
    origin = ", ".join(f"{1e3 * value:.2f}" for value in found.origin)
    errors = ", ".join(f"{1e3 * value:.2f}" for value in found.origin_error)
    say(f"origin in the tracks: {origin} mm; standard errors along wing x, y, z: {errors} mm")
    turns, moves = (", ".join(f"{value:.3g}" for value in one) for one in (turned, found.origin_error))
    say(f"for the dataset: frame_error: {{rotation_deg: [{turns}], origin_m: [{moves}]}}")
    if cameras:
        say("for the dataset: cameras:")
        for one in cameras_of(found, cameras):
            say(f"- {{{', '.join(f'{key}: {_plain(value)}' for key, value in one.items())}}}")
    say(f"side: {found.side}, {_evidence(found.side_evidence)}")
    where = "on the clock of the cameras" if is_true else "as it appears in the frames"
    period = f"{number(found.flap_frequency, 7)} Hz {where}"
    angles = f"mean {np.degrees(found.mean_flap):.2f} deg, half range {np.degrees(found.flap_amplitude):.1f} deg"
    say(f"flapping: {angles}, {period}")
    scatter = f"{mm(1e3 * found.rest_scatter)} mm"
    say(f"described rest positions differ from the estimated ones by {scatter} (standard deviation of a coordinate)")
    columns = [
        "marker", "track", ">seen", ">residual mm", ">rest x mm", ">y mm", ">z mm", ">errors mm", ">from described mm",
    ]  # fmt: skip
    table(columns, [_cells(one) for one in found.results])
    swaps = [[one.track, one.marker, f"{one.start_s:.4f}", f"{one.end_s:.4f}", one.frames] for one in found.exchanges]
    if swaps:
        say("parts of tracks that are other markers:")
        table(["track", "marker", ">from s", ">to s", ">frames"], swaps)
    if found.dropped:
        say("tracks that are not used:")
        table(["track", "reason"], [[one.track, one.reason] for one in found.dropped])
    if found.lost_samples:
        say(f"samples near no marker, left out: {found.lost_samples}")
    remarks(f"{found.file}: {one}" for one in found.remarks)


def _plain(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value)


def cameras_of(found: AlignedTracks, cameras: Sequence[CameraPose]) -> list[dict[str, object]]:
    """Return ``cameras``, given in the axes of the tracks, in the wing's frame, as ``dataset.yaml`` has them."""
    return [
        {
            "name": one.name,
            "centre_m": [round(value, _DIGITS) for value in one.centre],
            "rotation": [[round(value, _DIGITS) + 0.0 for value in row] for row in one.rotation],
            "focal_px": round(one.focal_px, 4),
        }
        for one in (camera.seen_from(found.rotation, found.origin) for camera in cameras)
    ]


def _evidence(value: float | None) -> str:
    if value is None:
        return "as you gave it, or the direction that is up"
    return f"ln of the odds against the other side {number(value / 2, 3)}"


def _cells(one: MarkerResult) -> list[str]:
    rest = [f"{1e3 * value:.2f}" for value in one.rest_m]
    errors = " ".join(f"{1e3 * value:.2f}" for value in one.rest_error_m)
    return [one.marker, one.track, percent(one.seen), mm(1e3 * one.residual_m), *rest, errors, mm(1e3 * one.moved_m)]
