"""Tracks a rendered film as a user would, with cameras calibrated from its chessboards; compares with the truth."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from benchmarks.cameras.render import write
from benchmarks.cameras.renderer.presets import BEAT, PRESETS
from benchmarks.cameras.renderer.wings import Flapping
from wingfit.cameras.calibrate.board import Board
from wingfit.cameras.calibrate.boards import find_boards
from wingfit.cameras.calibrate.from_boards import calibrate_boards
from wingfit.cameras.calibrate.result import Calibration
from wingfit.cameras.camera import Camera, Lens, LensModel
from wingfit.cameras.track.procedure import Report, Request, track
from wingfit.cameras.track.result import TrackedFilm
from wingfit.cameras.triangulation import triangulate
from wingfit.cameras.video.source import Film
from wingfit.records.array_types import Array

NINETY = 1.6449  # standard deviations of the 90 % interval
WRONG_M = 0.005  # an error beyond which a track is that of another marker
WITHIN_S = 0.01
REACH_M = 1.0  # width of what the cameras see at the wing


@dataclass(frozen=True, eq=False)
class Tracked:
    """A tracked film.

    Attributes:
        calibration: of the cameras, from rendered chessboards.
        found: the tracks.
        truth: [T, K, 3] (m), the true positions in the same axes.
        noise: [T, K, 3] (m), the error of the same pixels triangulated with the true cameras.
        field_m: width of what the first camera sees at the wing.
        frames, seconds: count of frames of all cameras, and the CPU time that tracking took.
    """

    calibration: Calibration
    found: TrackedFilm
    truth: Array
    noise: Array
    field_m: float
    frames: int
    seconds: float

    def as_json(self) -> dict[str, Any]:
        """Return the scores of the tracks."""
        errors = self.found.positions - self.truth
        distance = np.linalg.norm(errors, axis=2)
        seen = np.isfinite(distance)
        variances = np.diagonal(self.found.covariance, axis1=2, axis2=3)
        if self.found.by_calibration is not None:
            variances = variances + np.diagonal(self.found.by_calibration, axis1=1, axis2=2)
        rms = float(np.sqrt(np.mean(distance[seen] ** 2)))
        whole = np.abs(errors[seen]) < NINETY * np.sqrt(variances[seen])
        own = np.diagonal(self.found.covariance, axis1=2, axis2=3)
        noise = np.abs(self.noise[seen]) < NINETY * np.sqrt(own[seen])
        return {
            "markers": len(self.found.names),
            "tracked_in_95_percent_of_frames": int(np.percentile(seen.sum(1), 5)),
            "frames_with_47_percent": round(100 * float((seen.sum(1) >= 47).mean()), 1),
            "error_mm": round(1e3 * rms, 4),
            "largest_error_mm": round(1e3 * float(distance[seen].max()), 3),
            "wrong_labels": int((distance[seen] > WRONG_M).sum()),
            "field_over_error": round(self.field_m / rms),
            "coverage_percent": round(100 * float(noise.mean()), 1),
            "coverage_with_calibration_percent": round(100 * float(whole.mean()), 1),
            "frames_per_second": round(self.frames / self.seconds, 2),
            "calibration_px": round(self.calibration.rms_px, 4),
            "remarks": list(self.found.remarks),
        }


def render_and_track(preset: str, folder: Path, options: dict[str, Any], report: Report) -> Tracked:
    """Render the film of ``preset`` into ``folder`` if it is not there, calibrate its cameras and track it."""
    if not (folder / "done").exists():
        write(PRESETS[preset](**options), folder)
        (folder / "done").touch()
    cameras = json.loads((folder / "cameras.json").read_text())
    calibration = calibrated(folder, [camera["name"] for camera in cameras])
    request = request_of(folder, calibration)
    strobe = request.light == "strobe"
    began = time.process_time()
    found = track(request, report)
    seconds = time.process_time() - began
    frames = sum(film.opened().count for film in request.films)
    truth = _truth(folder, cameras[0], found, strobe=strobe)
    noise = _noise(cameras, found, truth)
    return Tracked(calibration, found, truth, noise, _field(cameras[0]), frames, seconds)


def request_of(folder: Path, calibration: Calibration | None = None) -> Request:
    """Return what is tracked in a rendered film; its cameras are calibrated if no ``calibration`` is given."""
    scene = json.loads((folder / "scene.json").read_text())
    cameras = json.loads((folder / "cameras.json").read_text())
    names = [camera["name"] for camera in cameras]
    calibration = calibration or calibrated(folder, names)
    plan = Flapping(BEAT).markers()
    strobe = scene["strobe_hz"] is not None
    return Request(
        cameras=calibration.cameras,
        films=tuple(
            Film(folder / f"wing-{name}.avi", camera["rate"]) for name, camera in zip(names, cameras, strict=True)
        ),
        kind=scene["kind"],
        light="strobe" if strobe else "continuous",
        names=tuple(scene["markers"]),
        reference=np.column_stack([plan, np.zeros(len(plan))]),
        calibration=calibration.covariance,
        within_s=0.0 if strobe else WITHIN_S,
    )


def calibrated(folder: Path, names: list[str], lens: LensModel = "brown") -> Calibration:
    """Calibrate the cameras of a rendered film from its chessboards, with this model of their lenses."""
    with np.load(folder / "boards.npz") as boards:
        board = Board(int(boards["inner"][0]), int(boards["inner"][1]), float(boards["side"]))
    images = {name: sorted((folder / f"boards-{name}").glob("*.png")) for name in names}
    return calibrate_boards(find_boards(images, board), lens=lens)


def _truth(folder: Path, camera: dict[str, Any], found: TrackedFilm, *, strobe: bool) -> Array:
    """Return the true positions [T, K, 3] at the instants of ``found``, in the axes of the first camera."""
    with np.load(folder / "truth.npz") as truth:
        times, positions = truth["times"], truth["positions"]
    if strobe:
        nearest = np.abs(times[:, None] - _clock(camera, found.times)[None]).argmin(0)
        at = positions[nearest]
    else:
        at = CubicSpline(times, positions)(_clock(camera, found.times) + camera["exposure"] / 2)
    return np.asarray(at @ np.array(camera["rotation"]).T + np.array(camera["translation"]))


def _noise(cameras: list[dict[str, Any]], found: TrackedFilm, truth: Array) -> Array:
    """Return the errors [T, K, 3] of the pixels of ``found``, triangulated with the true cameras."""
    rotation, move = np.array(cameras[0]["rotation"]), np.array(cameras[0]["translation"])
    true = [
        Camera(
            one["name"], tuple(one["size"]), np.array(one["matrix"]), Lens("brown", tuple(one["distortion"])),
            np.array(one["rotation"]) @ rotation.T,
            np.array(one["translation"]) - np.array(one["rotation"]) @ rotation.T @ move,
        )
        for one in cameras
    ]  # fmt: skip
    pixels = np.moveaxis(found.pixels, 1, 0).reshape(len(true), -1, 2)
    points = triangulate(true, pixels, np.broadcast_to(np.eye(2), (*pixels.shape, 2)))
    return np.asarray(points.positions.reshape(truth.shape) - truth)


def _clock(camera: dict[str, Any], times: Array) -> Array:
    """Return times of the renderer at ``times`` of the film, which count frames at the nominal rate."""
    return np.asarray(camera["start"] + times * (1 - camera["clock_error"]))


def _field(camera: dict[str, Any]) -> float:
    """Return the width (m) that the camera sees at the distance of the middle of the wing, about ``REACH_M``."""
    return float(camera["size"][0] / camera["matrix"][0][0] * REACH_M)
