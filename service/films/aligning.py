"""Makes a dataset of tracked films: tracks of several films in the frame of the wing that another dataset describes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from decimal import Decimal
from pathlib import Path

import numpy as np

from wingfit.cameras.files.read import read_cameras
from wingfit.client.films import answers as a
from wingfit.importers import import_tracks
from wingfit.records import CameraPose, Condition, Dataset, Recording, Wing
from wingfit.records.array_types import Array
from wingfit.records.dataset import FrameError
from wingfit.records.errors import DatasetError, Fault, fail
from wingfit.records.units import CELSIUS, DEG, MBAR, Unit, to_si
from wingfit.service.films.files import TrackingFiles
from wingfit.service.films.requests import FilmedDatasetIn, FilmedRecordingIn
from wingfit.tracking.alignment import AlignedTracks, Known, Tracks, align, in_common_frame
from wingfit.tracking.marker_noise import marker_noise

# Where the options of 'wingfit align', which its messages name, are in the request.
_OPTIONS = {"--side": "side", "--up": "up", "--mean-flap-deg": "mean_flap_deg"}
_FREQUENCY = "--flap-frequency-hz"


def dataset_of_films(
    wing: Wing, body: FilmedDatasetIn, films: Sequence[TrackingFiles]
) -> tuple[Dataset, list[a.FilmAlignment]]:
    """Return the dataset of the tracked ``films``, one for each recording of ``body``, and how each was aligned.

    All get one frame, which needs cameras that stayed where they were. The dataset states the noise of each marker,
    the errors of the frame, the cameras, and the flap frequencies on the clock of the cameras. DatasetError, with
    places in the request, if the tracks cannot be aligned with certainty.
    """
    cameras = _same_cameras(body, films)
    every = list[AlignedTracks]()
    for number, (one, film) in enumerate(zip(body.recordings, films, strict=True)):
        with _placed_in(number):
            every.append(_aligned(wing, body, one, film.tracks))
    every = _in_common_frame(body, every)
    recordings = list[Recording]()
    for number, (one, found, film) in enumerate(zip(body.recordings, every, films, strict=True)):
        with _placed_in(number):
            recordings.append(_recording(one, found, film))
    first = every[0]
    dataset = Dataset(
        body.name,
        wing,
        tuple(recordings),
        tuple(one.name for one in body.recordings if one.held_out),
        frame_error=FrameError(_triple(first.rotation_error), _triple(first.origin_error)),
        cameras=tuple(pose.seen_from(first.rotation, first.origin) for pose in cameras),
    )
    return dataset, [_answer(one, found) for one, found in zip(body.recordings, every, strict=True)]


def _same_cameras(body: FilmedDatasetIn, films: Sequence[TrackingFiles]) -> tuple[CameraPose, ...]:
    """Return the cameras of all ``films``; DatasetError if they are not those of the first film."""
    every = list[tuple[CameraPose, ...]]()
    for number, film in enumerate(films):
        with _placed_in(number):
            every.append(tuple(camera.pose for camera in read_cameras(film.cameras).cameras))
    for number, poses in enumerate(every):
        if poses != every[0]:
            message = (
                f"its cameras were calibrated otherwise than those of {body.recordings[0].name}; recordings with one "
                "frame have the same file of cameras: make a dataset for each calibration"
            )
            raise fail(f"body.recordings.{number}.tracking_id", body.recordings[number].tracking_id, message)
    return every[0]


def _in_common_frame(body: FilmedDatasetIn, every: Sequence[AlignedTracks]) -> list[AlignedTracks]:
    try:
        return list(in_common_frame(every))
    except DatasetError as error:
        number = next(k for k, one in enumerate(body.recordings) if one.name == error.where)
        with _placed_in(number):
            raise


def _aligned(wing: Wing, body: FilmedDatasetIn, one: FilmedRecordingIn, path: Path) -> AlignedTracks:
    found = import_tracks(path)
    given = Tracks(one.name, found.times, found.markers, found.positions)
    return align(
        given,
        wing,
        Known(
            side=body.side,
            up=body.up,
            ignore_names=body.ignore_names,
            mean_flap_deg=body.mean_flap_deg,
            flap_frequency_hz=one.flap_frequency_hz,
        ),
    )


def _recording(one: FilmedRecordingIn, found: AlignedTracks, film: TrackingFiles) -> Recording:
    noise = marker_noise(found, film.covariance)
    condition = Condition(
        flap_frequency=found.flap_frequency,
        phase_lag=_si(one.phase_lag_deg, DEG),
        pressure=_si(one.pressure_mbar, MBAR),
        temperature=_si(one.temperature_c, CELSIUS),
        airspeed=one.airspeed_m_s,
        angle_of_attack=_si(one.angle_of_attack_deg, DEG),
    )
    return Recording(
        one.name,
        one.rig,
        condition,
        found.times,
        found.markers,
        found.positions.reshape(len(found.times), -1),
        noise.standard_deviation.ravel(),
        noise_correlation=noise.correlation,
    )


def _answer(one: FilmedRecordingIn, found: AlignedTracks) -> a.FilmAlignment:
    return {
        "recording": one.name,
        "tracking_id": one.tracking_id,
        "side": found.side,
        "residual_mm": 1e3 * found.noise,
        "rest_scatter_mm": 1e3 * found.rest_scatter,
        "flap_frequency_hz": found.flap_frequency,
        "flap_amplitude_deg": float(np.degrees(found.flap_amplitude)),
        "mean_flap_deg": float(np.degrees(found.mean_flap)),
        "frames": len(found.times),
        "markers": [*found.markers],
        "exchanges": len(found.exchanges),
        "dropped": [{"track": lost.track, "reason": lost.reason} for lost in found.dropped],
        "remarks": [*found.remarks],
    }


@contextmanager
def _placed_in(number: int) -> Iterator[None]:
    """Give the faults of recording ``number`` their places in the request, where the paths of files mean nothing."""
    try:
        yield
    except DatasetError as error:
        raise _placed(error, f"body.recordings.{number}") from None


def _placed(error: DatasetError, recording: str) -> DatasetError:
    """Return ``error`` with the places of its faults in the request, where ``recording`` is the one at fault."""

    def where(place: str) -> str:
        if place in _OPTIONS:
            return f"body.{_OPTIONS[place]}"
        return f"{recording}.flap_frequency_hz" if place == _FREQUENCY else recording

    return DatasetError([Fault(where(one.where), one.value, one.message) for one in error.errors], error.count)


def _si(value: float, unit: Unit) -> float:
    return to_si(Decimal(repr(value)), unit)


def _triple(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
