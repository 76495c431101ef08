"""The client's calls about diagnoses."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

from wingfit.client import answers as a
from wingfit.client.diagnosis_answers import Diagnosis
from wingfit.client.export_answers import Format
from wingfit.client.follow_job import Watching
from wingfit.client.transport import OnBytes, given, part

OnDiagnosis = Callable[[Diagnosis], None]


class DiagnosisCalls(Watching):
    """Submits and follows diagnoses, and fetches their findings."""

    def submit_diagnosis(self, dataset_id: str | None = None, *, run_id: str | None = None, **spec: Any) -> Diagnosis:
        """Submit a diagnosis of a dataset, or of a run (from its best genome, with its settings).

        ``spec``: seed, recordings, genes, fixed, effects, suspects, refine, refits, name; of a wing also division,
        bounds_factor, accuracy_mm; of a vehicle preset, without, axes, low_pass_hz, peel_width_beats. Omitted
        settings are those of the run, without a run the server's defaults.
        """
        body = given(dataset_id=dataset_id, run_id=run_id, **spec)
        return cast(Diagnosis, self._json("POST", "/v1/diagnoses", json=body, key=str(uuid.uuid4())))

    def diagnoses(
        self, *, dataset_id: str | None = None, run_id: str | None = None, state: str | None = None
    ) -> list[Diagnosis]:
        """List all diagnoses, newest first, optionally of one dataset, of one run or in one state."""
        found = self._all("/v1/diagnoses", dataset_id=dataset_id, run_id=run_id, state=state)
        return cast(list[Diagnosis], found)

    def diagnosis(self, diagnosis_id: str) -> Diagnosis:
        """Fetch one diagnosis with its progress."""
        return cast(Diagnosis, self._json("GET", _path(diagnosis_id)))

    def finding(self, diagnosis_id: str) -> dict[str, Any]:
        """Fetch the finding of a diagnosis; its schema is at /v1/schemas/finding."""
        return cast(dict[str, Any], self._json("GET", f"{_path(diagnosis_id)}/finding"))

    def export_diagnosis(
        self,
        diagnosis_id: str,
        format: Format,  # noqa: A002
        path: str | Path,
        *,
        on_bytes: OnBytes | None = None,
    ) -> Path:
        """Write a diagnosis that has succeeded to ``path``, as :meth:`Client.download` does.

        ``format``: json for all of it, csv for its ranking, netcdf for its maps and its misfit to every recording.
        """
        return self._export(_path(diagnosis_id), format, Path(path), diagnosis_id, on_bytes)

    def report(self, diagnosis_id: str) -> str:
        """Fetch the report: one HTML file without external resources."""
        return self._call("GET", f"{_path(diagnosis_id)}/report").text

    def cancel_diagnosis(self, diagnosis_id: str) -> Diagnosis:
        """Stop a diagnosis permanently."""
        return cast(Diagnosis, self._json("POST", f"{_path(diagnosis_id)}/cancel"))

    def delete_diagnosis(self, diagnosis_id: str) -> None:
        """Delete a diagnosis that has ended, with its finding."""
        self._call("DELETE", _path(diagnosis_id))

    def diagnosis_events(
        self, diagnosis_id: str, *, last_event_id: str | None = None, patience_s: float = 60.0
    ) -> Iterator[a.Event]:
        """Yield the server-sent events of a diagnosis until its final state, as :meth:`Client.events` of a run."""
        return self._events(_path(diagnosis_id), last_event_id, patience_s)

    def wait_for_diagnosis(
        self, diagnosis_id: str, on_progress: OnDiagnosis | None = None, *, patience_s: float = 60.0
    ) -> Diagnosis:
        """Block until the diagnosis has ended and return it; ``on_progress`` gets it after each change."""
        return self._wait(_path(diagnosis_id), on_progress, patience_s)


def _path(diagnosis_id: str) -> str:
    return f"/v1/diagnoses/{part(diagnosis_id)}"
