"""From films of a wing under several conditions to a dataset: rendered, tracked, and aligned to the described wing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from benchmarks.cameras.render import write
from benchmarks.cameras.renderer.presets import BEAT, thesis_strobe
from benchmarks.cameras.renderer.simulated import simulated_scene
from benchmarks.cameras.tracked import calibrated
from wingfit.cameras.camera import Camera, Lens
from wingfit.cameras.track.procedure import Request, track
from wingfit.cameras.track.result import TrackedFilm
from wingfit.cameras.video.source import Film
from wingfit.records import Condition, Dataset, FrameError, Recording, Wing
from wingfit.records.array_types import Array
from wingfit.sim.virtual_rigs.campaign import robird_wing
from wingfit.tracking.alignment import AlignedTracks, Known, Tracks, align, in_common_frame
from wingfit.tracking.marker_noise import MarkerNoise, noise_in_wing_axes

CONDITIONS = ((1e3, 0.0), (1e4, 0.0524), (1e5, 0.0), (1e5, 0.1222), (1e4, 0.1222))
HELD_OUT = 4
FLASHES = 62
KELVIN = 293.15
Cameras = Literal["right", "undistorted", "pinhole"]
Report = Callable[[str], object]


def dataset_from_films(
    folder: Path, genes: Mapping[str, float], report: Report, *, cameras: Cameras = "right", flashes: int = FLASHES
) -> Dataset:
    """Film a simulated wing with ``genes`` under all conditions, and return what a user would get from the films.

    ``cameras``: "right" as the chessboards give them; "undistorted": these, without the distortion of their lenses;
    "pinhole": calibrated without distortion, so that focal lengths and poses are wrong too.
    """
    wing, places = robird_wing(), list[Path]()
    for number, (pressure, lag) in enumerate(CONDITIONS):
        condition = Condition(BEAT, lag, pressure, KELVIN)
        place = folder / f"film{number}"
        report(f"{place.name}: rendering")
        if not (place / "done").exists():
            made = thesis_strobe(flashes=flashes, seed=number + 1, scene=simulated_scene(condition, genes))
            write(replace(made, wand=replace(made.wand, until=0.1)), place)
            (place / "done").touch()
        places.append(place)
    used, covariance = _calibrated(places[0], cameras)  # the cameras stay where they are
    films = list[TrackedFilm]()
    for place in places:
        report(f"{place.name}: tracking")
        films.append(_tracked(place, wing, used, covariance))
    report("aligning")
    known = Known(side="right", flap_frequency_hz=BEAT)
    tracks = [Tracks(f"film{k}", one.times, one.names, one.positions) for k, one in enumerate(films)]
    every = in_common_frame([align(one, wing, known) for one in tracks])
    noises = [
        noise_in_wing_axes(one, film.names, film.covariance, one.file) for one, film in zip(every, films, strict=True)
    ]
    recordings = tuple(_recording(*one) for one in zip(every, noises, CONDITIONS, strict=True))
    frame = FrameError(_triple(every[0].rotation_error), _triple(every[0].origin_error))
    poses = tuple(one.pose.seen_from(every[0].rotation, every[0].origin) for one in used)
    held_out = (recordings[HELD_OUT].name,)
    return Dataset("films of a wing", wing, recordings, held_out, frame_error=frame, cameras=poses)


def _calibrated(place: Path, cameras: Cameras) -> tuple[tuple[Camera, ...], Array | None]:
    """Return the cameras, and the covariance of their parameters unless they are wrong on purpose."""
    found = calibrated(place, ["left", "right"], "pinhole" if cameras == "pinhole" else "brown")
    if cameras == "right":
        return found.cameras, found.covariance
    return tuple(replace(one, lens=Lens()) for one in found.cameras), None


def _tracked(place: Path, wing: Wing, cameras: tuple[Camera, ...], covariance: Array | None) -> TrackedFilm:
    request = Request(
        cameras=cameras,
        films=tuple(Film(place / f"wing-{camera.name}.avi") for camera in cameras),
        kind="chequer",
        light="strobe",
        names=tuple(marker.name for marker in wing.markers),
        reference=np.array([marker.position for marker in wing.markers]),
        calibration=covariance,
        store=place / "detected",
    )
    return track(request)


def _recording(aligned: AlignedTracks, noise: MarkerNoise, condition: tuple[float, float]) -> Recording:
    pressure, lag = condition
    values = aligned.positions.reshape(len(aligned.times), -1)
    known = Condition(aligned.flap_frequency, lag, pressure, KELVIN)
    return Recording(
        aligned.file,
        "vacuum_chamber",
        known,
        aligned.times,
        aligned.markers,
        values,
        noise.standard_deviation.ravel(),
        noise_correlation=noise.correlation,
    )


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
