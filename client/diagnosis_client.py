"""Methods of the client that submit, follow and fetch diagnoses."""

from __future__ import annotations

import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

from wingfit.client import answers as a
from wingfit.client.diagnosis_answers import Diagnosis, PartialFinding
from wingfit.client.export_answers import Format
from wingfit.client.follow_job import Watching
from wingfit.client.transport import OnBytes, given, part

OnDiagnosis = Callable[[Diagnosis], None]


class DiagnosisCalls(Watching):
    """Base class of the client: methods that submit and follow diagnoses, and fetch their findings."""

    def submit_diagnosis(self, dataset_id: str | None = None, *, run_id: str | None = None, **spec: Any) -> Diagnosis:
        """Submit a diagnosis of a dataset or of a run, and return it; a run gives its best genome and its settings.

        ``spec``: seed, recordings, genes, fixed, effects, suspects, refine, refits, exhaustive, name; for a wing also
        division, bounds_factor, accuracy_mm; for a vehicle also preset, without, axes, low_pass_hz, peel_width_beats.
        Omitted settings are those of the run, or have the server's defaults. For series also rig: the name of one that
        is installed on the server, or what :func:`wingfit.declaration` returns of yours, which :func:`wingfit.drive`
        then simulates.
        """
        body = given(dataset_id=dataset_id, run_id=run_id, **spec)
        return cast(Diagnosis, self._json("POST", "/v1/diagnoses", json=body, key=str(uuid.uuid4())))

    def diagnosis(self, diagnosis_id: str) -> Diagnosis:
        """Fetch one diagnosis with its progress."""
        return cast(Diagnosis, self._json("GET", _path(diagnosis_id)))

    def finding(self, diagnosis_id: str) -> dict[str, Any]:
        """Fetch the finding (result) of a diagnosis; its JSON schema is at /v1/schemas/finding."""
        return cast(dict[str, Any], self._json("GET", f"{_path(diagnosis_id)}/finding"))

    def partial_finding(self, diagnosis_id: str) -> PartialFinding | None:
        """Fetch what a running diagnosis knows so far; None before its nominal model is fitted, and after its end."""
        return cast(PartialFinding | None, self._json("GET", f"{_path(diagnosis_id)}/partial"))

    def export_diagnosis(
        self,
        diagnosis_id: str,
        format: Format,  # noqa: A002
        path: str | Path,
        *,
        on_bytes: OnBytes | None = None,
    ) -> Path:
        """Write a diagnosis that has succeeded to the file or into the folder ``path``; return the path of the file.

        ``format``: "json": the whole diagnosis; "csv": the ranking of the hypotheses; "netcdf": the misfit to every
        recording, and maps of the residual. ``on_bytes(received, total)`` is called during the transfer.
        """
        return self._export(_path(diagnosis_id), format, Path(path), diagnosis_id, on_bytes)

    def report(self, diagnosis_id: str) -> str:
        """Fetch the report on the finding of a diagnosis, as the text of one self-contained HTML file."""
        return self._call("GET", f"{_path(diagnosis_id)}/report").text

    def cancel_diagnosis(self, diagnosis_id: str) -> Diagnosis:
        """Stop a diagnosis permanently, within seconds, and return it as it is now."""
        return cast(Diagnosis, self._json("POST", f"{_path(diagnosis_id)}/cancel"))

    def delete_diagnosis(self, diagnosis_id: str) -> None:
        """Delete a diagnosis that has ended, with its finding."""
        self._call("DELETE", _path(diagnosis_id))

    def diagnosis_events(
        self, diagnosis_id: str, *, last_event_id: str | None = None, patience_s: float = 60.0
    ) -> Iterator[a.Event]:
        """Yield the server-sent events of a diagnosis until it ends; arguments and errors as in ``Client.events``."""
        return self._events(_path(diagnosis_id), last_event_id, patience_s)

    def wait_for_diagnosis(
        self, diagnosis_id: str, on_progress: OnDiagnosis | None = None, *, patience_s: float = 60.0
    ) -> Diagnosis:
        """Block until the diagnosis has ended, and return it; arguments and errors are those of ``Client.wait``."""
        return self._wait(_path(diagnosis_id), on_progress, patience_s)


def _path(diagnosis_id: str) -> str:
    return f"/v1/diagnoses/{part(diagnosis_id)}"
