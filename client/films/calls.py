"""Methods of the client about films, and about the tracking of markers in them."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import httpx

from wingfit.client import answers as a
from wingfit.client.films.answers import Film, FilmedDataset, FoundMarker, MarkerKind, Tracking, TrackingResult
from wingfit.client.follow_job import Watching
from wingfit.client.transport import CountedFile, OnBytes, WingfitError, given, part

OnTracking = Callable[[Tracking], None]


class FilmCalls(Watching):
    """Base class of the client: methods that upload films, track their markers, and fetch the tracks."""

    def create_film(self, name: str, cameras: Sequence[str], *, rate_hz: Mapping[str, float] | None = None) -> Film:
        """Make a film of two to eight ``cameras``, named as in the file of calibrated cameras, and return it.

        ``rate_hz``: frames per second of a camera whose video states another rate, such as that of playback.
        """
        body = {"name": name, "cameras": list(cameras), "rate_hz": dict(rate_hz or {})}
        return cast(Film, self._json("POST", "/v1/films", json=body, key=str(uuid.uuid4())))

    def upload_film_file(self, film_id: str, name: str, path: str | Path, *, on_bytes: OnBytes | None = None) -> Film:
        """Upload the file ``path`` of a film, and return the film; an earlier file of that name is replaced.

        ``name``: of the camera for its video; "cameras" for the file of calibrated cameras (cameras.yaml).
        ``on_bytes(sent, total)`` is called during the transfer.
        """
        source = Path(path)
        if not source.is_file():
            raise WingfitError("no such file", f"{source} is no file; give a video, or cameras.yaml")
        url = f"{_film(film_id)}/files/{part(name)}"

        def send() -> httpx.Response:
            with CountedFile(source, on_bytes) as stream:
                length = {"Content-Length": str(source.stat().st_size)}
                pieces = iter(lambda: stream.read(_PIECE), b"")
                return self._http.put(url, content=pieces, headers=length, timeout=self.simulating)

        return cast(Film, self._repeat(send).json())

    def films(self) -> list[Film]:
        """List all films, newest first."""
        return cast(list[Film], self._all("/v1/films"))

    def film(self, film_id: str) -> Film:
        """Fetch one film."""
        return cast(Film, self._json("GET", _film(film_id)))

    def film_frame(self, film_id: str, camera: str, number: int, *, width_px: int | None = None) -> bytes:
        """Fetch one frame of a camera as JPEG; wider ones are scaled down to ``width_px``."""
        return self._call("GET", _frame(film_id, camera, number), params=given(width_px=width_px)).content

    def film_markers(self, film_id: str, camera: str, number: int, kind: MarkerKind) -> list[FoundMarker]:
        """Fetch the markers of a ``kind`` ("chequer" or "dot") that the detector sees in one frame."""
        path = f"{_frame(film_id, camera, number)}/markers"
        return cast(list[FoundMarker], self._json("GET", path, params={"kind": kind})["markers"])

    def delete_film(self, film_id: str) -> None:
        """Delete a film with its files; the server refuses this while trackings of the film exist."""
        self._call("DELETE", _film(film_id))

    def submit_tracking(self, film_id: str, **spec: Any) -> Tracking:
        """Submit the tracking of the markers in a film, and return the queued tracking.

        ``spec``: kind ("chequer" or "dot") and light ("strobe" or "continuous"), which are needed; name,
        clocks_within_ms, first_frame, last_frame (not included); dataset_id of the wing, or places: a list of dicts
        with marker, x_m, y_m and z_m. Without both, the markers get names. labels: a list of dicts with camera, frame,
        marker, x_px and y_px, of markers that you named in some frames.
        """
        body = given(film_id=film_id, **spec)
        return cast(Tracking, self._json("POST", "/v1/trackings", json=body, key=str(uuid.uuid4())))

    def trackings(self, *, film_id: str | None = None, state: str | None = None) -> list[Tracking]:
        """List all trackings, newest first, optionally only those of a film, in a state."""
        return cast(list[Tracking], self._all("/v1/trackings", film_id=film_id, state=state))

    def tracking(self, tracking_id: str) -> Tracking:
        """Fetch one tracking with its progress."""
        return cast(Tracking, self._json("GET", _tracking(tracking_id)))

    def cancel_tracking(self, tracking_id: str) -> Tracking:
        """Stop a tracking permanently, within seconds, and return it as it is now."""
        return cast(Tracking, self._json("POST", f"{_tracking(tracking_id)}/cancel"))

    def delete_tracking(self, tracking_id: str) -> None:
        """Delete a tracking that has ended, with its tracks."""
        self._call("DELETE", _tracking(tracking_id))

    def tracking_events(
        self, tracking_id: str, *, last_event_id: str | None = None, patience_s: float = 60.0
    ) -> Iterator[a.Event]:
        """Yield the server-sent events of a tracking until it ends; arguments and errors as in ``Client.events``."""
        return self._events(_tracking(tracking_id), last_event_id, patience_s)

    def wait_for_tracking(
        self, tracking_id: str, on_progress: OnTracking | None = None, *, patience_s: float = 60.0
    ) -> Tracking:
        """Block until the tracking has ended, and return it; arguments and errors are those of ``Client.wait``."""
        return self._wait(_tracking(tracking_id), on_progress, patience_s)

    def tracking_result(self, tracking_id: str) -> TrackingResult:
        """Fetch the summary of the tracks of a tracking that has succeeded."""
        return cast(TrackingResult, self._json("GET", f"{_tracking(tracking_id)}/result"))

    def download_tracks(self, tracking_id: str, path: str | Path, *, on_bytes: OnBytes | None = None) -> Path:
        """Write the tracks as CSV to the file or into the folder ``path``; return the path of the file."""
        return self._file(f"{_tracking(tracking_id)}/tracks.csv", Path(path), f"{tracking_id}-tracks.csv", on_bytes)

    def download_covariance(self, tracking_id: str, path: str | Path, *, on_bytes: OnBytes | None = None) -> Path:
        """Write the covariances of all places (a NumPy archive) to ``path``; return the path of the file."""
        name = f"{tracking_id}-covariance.npz"
        return self._file(f"{_tracking(tracking_id)}/covariance.npz", Path(path), name, on_bytes)

    def dataset_of_films(self, name: str, recordings: Sequence[Mapping[str, Any]], **known: Any) -> FilmedDataset:
        """Align the tracks of films to a described wing, and store them as a new dataset ``name``.

        ``recordings``: of each tracking that has succeeded, a dict with tracking_id, name, rig ("vacuum_chamber" or
        "wind_tunnel"), flap_frequency_hz, phase_lag_deg, pressure_mbar and temperature_c; airspeed_m_s,
        angle_of_attack_deg and held_out where they apply. ``known``: dataset_id of a dataset that describes
        the wing, or description, the text of a dataset.yaml or of the keys of a wing; and side ("left" or "right"), up
        ("z", "-y", ...), mean_flap_deg, ignore_names. Returns the dataset, and how each film was aligned.
        """
        body = {
            "name": name,
            "recordings": [dict(one) for one in recordings],
            **given(**known),
        }
        answer = self._json("POST", "/v1/trackings/dataset", json=body, key=str(uuid.uuid4()), timeout=self.simulating)
        return cast(FilmedDataset, answer)

    def tracking_report(self, tracking_id: str) -> str:
        """Fetch pictures of the tracks, as the text of one HTML file."""
        return self._call("GET", f"{_tracking(tracking_id)}/report.html").text


_PIECE = 2**20


def _film(film_id: str) -> str:
    return f"/v1/films/{part(film_id)}"


def _frame(film_id: str, camera: str, number: int) -> str:
    return f"{_film(film_id)}/frames/{part(camera)}/{number}"


def _tracking(tracking_id: str) -> str:
    return f"/v1/trackings/{part(tracking_id)}"
