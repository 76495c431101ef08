"""From films of a wing under several conditions to a dataset: rendered, tracked, and aligned to the described wing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

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

CONDITIONS = ((1e3, 0.0), (1e4, 0.0524), (1e5, 0.0), (1e5, 0.1222), (1e4, 0.1222))
HELD_OUT = 4
FLASHES = 62
KELVIN = 293.15
Report = Callable[[str], object]


def dataset_from_films(
    folder: Path, genes: Mapping[str, float], report: Report, *, lens: bool = True, flashes: int = FLASHES
) -> Dataset:
    """Film a simulated wing with ``genes`` under all conditions, and return what a user would get from the films.

    ``lens``: whether the distortion that the calibration finds is used, or left out of the cameras.
    """
    wing = robird_wing()
    films, calibration = list[TrackedFilm](), None
    for number, (pressure, lag) in enumerate(CONDITIONS):
        condition = Condition(BEAT, lag, pressure, KELVIN)
        place = folder / f"film{number}"
        report(f"{place.name}: rendering")
        if not (place / "done").exists():
            made = thesis_strobe(flashes=flashes, seed=number + 1, scene=simulated_scene(condition, genes))
            write(replace(made, wand=replace(made.wand, until=0.1)), place)
            (place / "done").touch()
        calibration = calibration or calibrated(place, ["left", "right"])  # the cameras stay where they are
        cameras = [one if lens else replace(one, lens=Lens()) for one in calibration.cameras]
        report(f"{place.name}: tracking")
        films.append(_tracked(place, wing, cameras, calibration.covariance if lens else None))
    report("aligning")
    known = Known(side="right", flap_frequency_hz=BEAT)
    tracks = [Tracks(f"film{k}", one.times, one.names, one.positions) for k, one in enumerate(films)]
    every = in_common_frame([align(one, wing, known) for one in tracks])
    recordings = tuple(_recording(one, condition) for one, condition in zip(every, CONDITIONS, strict=True))
    frame = FrameError(_triple(every[0].rotation_error), _triple(every[0].origin_error))
    poses = tuple(one.pose.seen_from(every[0].rotation, every[0].origin) for one in cameras)
    held_out = (recordings[HELD_OUT].name,)
    return Dataset("films of a wing", wing, recordings, held_out, frame_error=frame, cameras=poses)


def _tracked(place: Path, wing: Wing, cameras: Sequence[Camera], covariance: Array | None) -> TrackedFilm:
    request = Request(
        cameras=tuple(cameras),
        films=tuple(Film(place / f"wing-{camera.name}.avi") for camera in cameras),
        kind="chequer",
        light="strobe",
        names=tuple(marker.name for marker in wing.markers),
        reference=np.array([marker.position for marker in wing.markers]),
        calibration=covariance,
        store=place / "detected",
    )
    return track(request)


def _recording(aligned: AlignedTracks, condition: tuple[float, float]) -> Recording:
    pressure, lag = condition
    values = aligned.positions.reshape(len(aligned.times), -1)
    known = Condition(aligned.flap_frequency, lag, pressure, KELVIN)
    return Recording(aligned.file, "vacuum_chamber", known, aligned.times, aligned.markers, values)


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
