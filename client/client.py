"""The Python client of the wingfit server, with an example.

>>> client = Client()                                               # doctest: +SKIP
>>> dataset = client.upload_dataset("examples/robird")              # doctest: +SKIP
>>> run = client.submit_run(dataset["id"], division="11")           # doctest: +SKIP
>>> client.wait(run["id"], on_progress=lambda run: print(run["progress"]))  # doctest: +SKIP
>>> client.result(run["id"])["after_mm"]                            # doctest: +SKIP

Answers are plain dicts of the types in ``client/*answers.py``. Every failure is a :class:`WingfitError`.
"""

from __future__ import annotations

import io
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal, cast

import httpx

from wingfit.client import answers as a
from wingfit.client import force_answers as f
from wingfit.client.diagnosis_client import DiagnosisCalls
from wingfit.client.drive_client import DriveCalls
from wingfit.client.effect_answers import Effect
from wingfit.client.export_answers import Format, ModelFormat
from wingfit.client.films.calls import FilmCalls
from wingfit.client.importing.calls import ImportCalls
from wingfit.client.key_client import KeyCalls
from wingfit.client.lists.calls import ListCalls
from wingfit.client.load_answers import Loads
from wingfit.client.planning.calls import PlanCalls
from wingfit.client.recorded.calls import RecordedCalls
from wingfit.client.series_answers import SeriesResult
from wingfit.client.transport import (
    DEFAULT_URL,
    CountedFile,
    OnBytes,
    ServerAwayError,
    WingfitError,
    given,
    part,
    zip_folder,
)

__all__ = ["DEFAULT_URL", "Client", "ServerAwayError", "WingfitError"]

OnRun = Callable[[a.Run], None]


class Client(
    DiagnosisCalls, DriveCalls, FilmCalls, ImportCalls, KeyCalls, ListCalls, PlanCalls, RecordedCalls
):  # fmt: skip
    """Sends requests to one server and returns the answers; a context manager, at whose end the connections close."""

    def health(self) -> a.Health:
        """Fetch the status and version of the server, its evaluator, and the number of active jobs."""
        return cast(a.Health, self._json("GET", "/v1/health"))

    def backup(self, path: str | Path, *, on_bytes: OnBytes | None = None) -> Path:
        """Write a copy of the server's whole database to the file or into the folder ``path``; return the file's path.

        Other users cannot read the file. ``on_bytes(received, total)`` is called during the transfer.
        """
        return self._file("/v1/backup", Path(path), "wingfit.sqlite3", on_bytes, private=True)

    # -- datasets ------------------------------------------------------------

    def upload_dataset(
        self, path: str | Path, *, name: str | None = None, on_bytes: OnBytes | None = None
    ) -> a.Dataset:
        """Upload the dataset at ``path``: a zip, a NetCDF file, or a folder, which is zipped first.

        ``name`` replaces the dataset's own; ``on_bytes(sent, total)`` is called during the transfer.
        """
        source = Path(path)
        if not source.exists():
            raise WingfitError("no such dataset", f"{source} does not exist; give a folder, a .zip or a .nc file")
        with TemporaryDirectory(prefix="wingfit-") as scratch:
            archive = zip_folder(source, Path(scratch) / f"{source.resolve().name}.zip") if source.is_dir() else source
            key = str(uuid.uuid4())

            def send() -> httpx.Response:
                with CountedFile(archive, on_bytes) as stream:
                    return self._http.post(
                        "/v1/datasets",
                        files={"file": (archive.name, cast(io.BufferedReader, stream))},
                        data={"name": name} if name else {},
                        headers={"Idempotency-Key": key},
                    )

            return cast(a.Dataset, self._repeat(send).json())

    def dataset(self, dataset_id: str) -> a.Dataset:
        """Fetch one dataset with its recordings."""
        return cast(a.Dataset, self._json("GET", f"/v1/datasets/{part(dataset_id)}"))

    def download(self, dataset_id: str, path: str | Path, *, on_bytes: OnBytes | None = None) -> Path:
        """Write a dataset, byte for byte as uploaded, to the file ``path``, and return the path of the file.

        If ``path`` is a folder, the file is written there under the name that the server gives.
        ``on_bytes(received, total)`` is called during the transfer; ``total`` is 0 if the server does not report it.
        """
        return self._file(f"/v1/datasets/{part(dataset_id)}/archive", Path(path), f"{dataset_id}.zip", on_bytes)

    def drawing(self, dataset_id: str) -> str:
        """Fetch a drawing of the wing that a dataset describes, seen from above and to scale, as the text of an SVG."""
        return self._call("GET", f"/v1/datasets/{part(dataset_id)}/drawing").text

    def delete_dataset(self, dataset_id: str) -> None:
        """Delete a dataset; the server refuses this while runs or diagnoses of the dataset exist."""
        self._call("DELETE", f"/v1/datasets/{part(dataset_id)}")

    # -- runs ----------------------------------------------------------------

    def submit_run(self, dataset_id: str, **spec: Any) -> a.Run:
        """Submit a calibration, and return the queued run.

        ``spec``: method, mode, finish, population, stall, tolerance, max_generations, seed, recordings, genes, effects,
        name; for a wing also division, search_division, bounds_factor, accuracy_mm; for a vehicle also preset, without,
        axes, low_pass_hz, peel_width_beats; for series also rig, as in :meth:`submit_diagnosis`. Omitted settings have
        the server's defaults.
        """
        body = given(dataset_id=dataset_id, **spec)
        return cast(a.Run, self._json("POST", "/v1/runs", json=body, key=str(uuid.uuid4())))

    def check_run(self, dataset_id: str, **spec: Any) -> a.Checked:
        """Return the name and settings that :meth:`submit_run` would submit, or raise its error; submit nothing."""
        body = given(dataset_id=dataset_id, **spec)
        return cast(a.Checked, self._json("POST", "/v1/runs?validate_only=true", json=body))

    def run(self, run_id: str) -> a.Run:
        """Fetch one run with its progress."""
        return cast(a.Run, self._json("GET", _run(run_id)))

    def cancel(self, run_id: str) -> a.Run:
        """Stop a run permanently, within a second; its results so far are kept. Returns the run as it is now."""
        return cast(a.Run, self._json("POST", f"{_run(run_id)}/cancel"))

    def pause(self, run_id: str) -> a.Run:
        """Request that a run stop after its current generation; it can be resumed. Returns the run as it is now."""
        return cast(a.Run, self._json("POST", f"{_run(run_id)}/pause"))

    def resume(self, run_id: str) -> a.Run:
        """Continue a paused run, or withdraw a pause that has not taken effect yet; return the run."""
        return cast(a.Run, self._json("POST", f"{_run(run_id)}/resume"))

    def delete_run(self, run_id: str) -> None:
        """Delete a run that has ended, with its results."""
        self._call("DELETE", _run(run_id))

    def history(self, run_id: str, *, after: int | None = None) -> list[a.HistoryItem]:
        """Fetch the generations finished so far; with ``after``, only those whose sequence number is larger."""
        items: list[Any] = []
        while True:
            page = self._json("GET", f"{_run(run_id)}/history", params=given(after=after, limit=1000))["items"]
            items += page
            if not page or page[-1]["sequence"] == after:
                return cast(list[a.HistoryItem], items)
            after = page[-1]["sequence"]

    def export_run(
        self,
        run_id: str,
        format: Format,  # noqa: A002
        path: str | Path,
        *,
        on_bytes: OnBytes | None = None,
    ) -> Path:
        """Write a run to the file or into the folder ``path``, and return the path of the file.

        ``format``: "json": the whole run; "csv": its generations; "netcdf": its generations, its genes, and every
        recording with its simulation. ``on_bytes(received, total)`` is called during the transfer.
        """
        return self._export(_run(run_id), format, Path(path), run_id, on_bytes)

    def export_model(
        self,
        job_id: str,
        format: ModelFormat,  # noqa: A002
        path: str | Path,
        *,
        hypothesis: str | None = None,
        on_bytes: OnBytes | None = None,
    ) -> Path:
        """Write the calibrated model of a run or diagnosis to the file or into the folder ``path``; return the file.

        ``format``: "python": a file or package that needs no wingfit; "tables": CSV and JSON over the fitted range;
        "fmu": FMI 3.0; "json": all values. ``hypothesis``: effects joined by "+", or
        "nominal", the model to take of a diagnosis that names none for certain.
        """
        kind = "diagnoses" if job_id.startswith("dx_") else "runs"
        if kind == "runs" and hypothesis is not None:
            raise WingfitError("not sent", f"{job_id} is a run, which has one model: give no hypothesis")
        params = given(format=format, hypothesis=hypothesis)
        return self._file(
            f"/v1/{kind}/{part(job_id)}/model", Path(path), job_id, on_bytes, params=params, timeout=self.simulating
        )

    def genome(self, run_id: str) -> a.GenomeInfo:
        """Fetch all genes of a run: value in the best genome so far, nominal value, unit and bounds."""
        return cast(a.GenomeInfo, self._json("GET", f"{_run(run_id)}/genome"))

    def result(self, run_id: str) -> a.Result | f.ForceResult | SeriesResult:
        """Fetch the result of a finished run: misfits before and after, and genes; ``kind``: tracks, forces, series."""
        return cast("a.Result | f.ForceResult | SeriesResult", self._json("GET", f"{_run(run_id)}/result"))

    def forces(self, run_id: str, recording: str | None = None, source: f.Source | None = None) -> f.Forces:
        """Fetch recorded and modelled forces of one recording over the beat.

        ``recording``: its name, None for the first of the dataset. ``source`` of the model's coefficients: "local" (the
        estimate on this recording), "joint" (on all together), "global" (the global model), "average" (of the local
        estimates) or "nominal"; None for the first of these that the run has.
        """
        params = given(recording=recording, source=source)
        return cast(f.Forces, self._simulated("GET", f"{_run(run_id)}/forces", params=params))

    def predict(
        self,
        run_id: str,
        *,
        flap_frequency_hz: float,
        body_pitch_deg: float,
        airspeed_m_s: float,
        pressure_mbar: float | None = None,
        temperature_c: float | None = None,
    ) -> f.Prediction:
        """Predict the forces over a beat under a given condition, from the global model of a finished run.

        The global model gives the coefficients as linear functions of flap frequency and body pitch. The default air
        has 1013.25 mbar and 20 degrees C.
        """
        condition = given(
            flap_frequency_hz=flap_frequency_hz,
            body_pitch_deg=body_pitch_deg,
            airspeed_m_s=airspeed_m_s,
            pressure_mbar=pressure_mbar,
            temperature_c=temperature_c,
        )
        return cast(f.Prediction, self._simulated("POST", f"{_run(run_id)}/predictions", json=condition))

    def models(self) -> f.Models:
        """Fetch the blade-element models of vehicles (presets) and the terms of which they consist."""
        return cast(f.Models, self._json("GET", "/v1/models"))

    def effects(self) -> list[Effect]:
        """List the effects that a run or a simulation can include."""
        return cast(list[Effect], self._json("GET", "/v1/effects")["effects"])

    def effect(self, name: str) -> Effect:
        """Fetch the description of the effect ``name``."""
        return cast(Effect, self._json("GET", f"/v1/effects/{part(name)}"))

    def comparison(
        self, run_id: str, recording: str | None = None, genome: Literal["best", "nominal"] = "best"
    ) -> a.Comparison:
        """Fetch recorded and simulated marker tracks of one recording (None: the first), simulated with ``genome``."""
        params = given(recording=recording, genome=genome)
        return cast(a.Comparison, self._simulated("GET", f"{_run(run_id)}/comparison", params=params))

    def loads(
        self,
        run_id: str,
        recording: str | None = None,
        genome: Literal["best", "nominal"] = "best",
        outputs: Sequence[str] | None = None,
    ) -> Loads:
        """Fetch motor torques, forces, powers and energies of one recording (None: the first) over one simulated beat.

        ``outputs``: names of the groups of loads to return, as in :meth:`simulate`; None for all.
        """
        params = given(recording=recording, genome=genome, outputs=list(outputs) if outputs else None)
        return cast(Loads, self._simulated("GET", f"{_run(run_id)}/loads", params=params))

    def _simulated(self, method: str, path: str, **options: Any) -> Any:
        """Send a request that requires a simulation, with the longer time limit ``simulating_s``; return the answer."""
        return self._json(method, path, key=str(uuid.uuid4()), timeout=self.simulating, **options)

    def events(self, run_id: str, *, last_event_id: str | None = None, patience_s: float = 60.0) -> Iterator[a.Event]:
        """Yield the server-sent events of a run until it ends; with ``last_event_id``, only those after that event.

        A broken connection is resumed. Raises :class:`ServerAwayError` if no server answers for ``patience_s`` seconds.
        """
        return self._events(_run(run_id), last_event_id, patience_s)

    def wait(self, run_id: str, on_progress: OnRun | None = None, *, patience_s: float = 60.0) -> a.Run:
        """Block until the run has ended, and return it; ``on_progress(run)`` is called after each change.

        Raises :class:`ServerAwayError` if no server answers for ``patience_s`` seconds.
        """
        return self._wait(_run(run_id), on_progress, patience_s)

    def simulate(
        self,
        dataset_id: str,
        recording: str,
        *,
        division: str = "11",
        genome: Mapping[str, float] | None = None,
        accuracy_mm: float | None = None,
        outputs: bool | Sequence[str] = False,
        effects: Sequence[str] = (),
    ) -> a.Simulation:
        """Simulate one recording of a wing; genes not named in ``genome`` keep their nominal value.

        ``division``: number of rigid bodies that represent the wing (4, 11, 24), or that of each strip ("3,3,3,2").
        ``accuracy_mm``: largest error of a simulated marker, 0.02 to 1; None means 0.1. ``effects``: names of effects
        to include. ``outputs`` requests loads over the beat: True for all, or some of motors, air, strips, sections,
        connectors, power, energy, averages.
        """
        loads = outputs if isinstance(outputs, bool) else list(outputs)
        wing = {"division": division, "accuracy_mm": accuracy_mm, "outputs": loads}
        body = _simulation(dataset_id, recording, genome, effects, **wing)
        return cast(a.Simulation, self._simulated("POST", "/v1/simulations", json=body))

    def simulate_forces(
        self,
        dataset_id: str,
        recording: str,
        *,
        genome: Mapping[str, float] | None = None,
        preset: str = "proposed",
        without: Sequence[str] = (),
        low_pass_hz: float | None = None,
        peel_width_beats: float = 0.0,
        effects: Sequence[str] = (),
    ) -> f.ForceSimulation:
        """Compute the forces of one recording of a vehicle; genes not named in ``genome`` keep their nominal value.

        ``preset`` names a model and ``without`` the terms to omit from it, see :meth:`models`; ``effects``: names of
        effects to include. ``low_pass_hz`` is the cut-off of the filter for recorded and modelled forces: None is 3.2
        times the flap frequency, 0 no filter. The end of the peel (the separation of the wings) is smoothed over
        ``peel_width_beats``.
        """
        model = {"preset": preset, "without": list(without), "peel_width_beats": peel_width_beats}
        body = _simulation(dataset_id, recording, genome, effects, low_pass_hz=low_pass_hz, **model)
        return cast(f.ForceSimulation, self._simulated("POST", "/v1/simulations", json=body))

    def loads_under(
        self,
        dataset_id: str,
        recording: str,
        *,
        condition: Mapping[str, float] | None = None,
        division: str = "11",
        genome: Mapping[str, float] | None = None,
        accuracy_mm: float | None = None,
        outputs: Sequence[str] | None = None,
        effects: Sequence[str] = (),
    ) -> Loads:
        """Simulate the loads on a wing over a beat, under the condition of a recording as changed by ``condition``.

        Keys of ``condition``: flap_frequency_hz, phase_lag_deg, pressure_mbar, temperature_c, airspeed_m_s,
        angle_of_attack_deg. The other arguments are as in :meth:`simulate`; ``outputs``: None for all loads.
        """
        loads = True if outputs is None else list(outputs)
        wing = {"division": division, "accuracy_mm": accuracy_mm, "outputs": loads}
        body = _simulation(dataset_id, recording, genome, effects, condition=dict(condition or {}), **wing)
        return cast(Loads, self._simulated("POST", "/v1/loads", json=body))


def _simulation(
    dataset_id: str, recording: str, genome: Mapping[str, float] | None, effects: Sequence[str], **settings: Any
) -> dict[str, Any]:
    """Return the JSON body of a request for a simulation, without those ``settings`` that are None."""
    model = {"genome": dict(genome or {}), "effects": list(effects)}
    return given(dataset_id=dataset_id, recording=recording, **model, **settings)


def _run(run_id: str) -> str:
    return f"/v1/runs/{part(run_id)}"
