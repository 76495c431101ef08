"""Methods of the client that list datasets, runs and diagnoses, and change their names and notes."""

from __future__ import annotations

from typing import cast

from wingfit.client import answers as a
from wingfit.client.diagnosis_answers import Diagnosis
from wingfit.client.lists.answers import DatasetSort, DiagnosisSort, JobGroup, Order, RunSort
from wingfit.client.transport import Transport, given, part


class ListCalls(Transport):
    """Base class of the client: lists, and changes of names and notes.

    Of all lists: ``q`` is a part of the name or of the notes, or a whole id; ``sort`` names the order, and ``order`` is
    "asc" or "desc" (None: newest first, or the smallest first). Items without a value come last.
    """

    def datasets(
        self,
        *,
        kind: a.Kind | None = None,
        q: str | None = None,
        sort: DatasetSort | None = None,
        order: Order | None = None,
    ) -> list[a.Dataset]:
        """List all datasets, newest first unless sorted otherwise; only those of a ``kind`` or with ``q`` if given."""
        return cast(list[a.Dataset], self._all("/v1/datasets", kind=kind, q=q, sort=sort, order=order))

    def runs(
        self,
        *,
        dataset_id: str | None = None,
        state: str | None = None,
        badge: a.FitBadge | None = None,
        q: str | None = None,
        sort: RunSort | None = None,
        order: Order | None = None,
    ) -> list[a.Run]:
        """List all runs, newest first unless sorted otherwise.

        Only those of ``dataset_id``, in ``state`` (e.g. "RUNNING"), whose model fits as ``badge`` says, or with ``q``,
        if given.
        """
        filters = {"dataset_id": dataset_id, "state": state, "badge": badge, "q": q}
        return cast(list[a.Run], self._all("/v1/runs", sort=sort, order=order, **filters))

    def diagnoses(
        self,
        *,
        dataset_id: str | None = None,
        run_id: str | None = None,
        state: str | None = None,
        badge: a.FitBadge | None = None,
        q: str | None = None,
        sort: DiagnosisSort | None = None,
        order: Order | None = None,
    ) -> list[Diagnosis]:
        """List all diagnoses, newest first unless sorted otherwise; filters as in :meth:`runs`, and of a run."""
        filters = {"dataset_id": dataset_id, "run_id": run_id, "state": state, "badge": badge, "q": q}
        return cast(list[Diagnosis], self._all("/v1/diagnoses", sort=sort, order=order, **filters))

    def run_groups(self, *, state: str | None = None, q: str | None = None) -> list[JobGroup]:
        """Count the runs of each dataset; that of the newest run comes first. Filters as in :meth:`runs`."""
        return cast(list[JobGroup], self._all("/v1/runs/groups", state=state, q=q))

    def diagnosis_groups(self, *, state: str | None = None, q: str | None = None) -> list[JobGroup]:
        """Count the diagnoses of each dataset; that of the newest comes first. Filters as in :meth:`runs`."""
        return cast(list[JobGroup], self._all("/v1/diagnoses/groups", state=state, q=q))

    def update_dataset(self, dataset_id: str, *, name: str | None = None, notes: str | None = None) -> a.Dataset:
        """Change the name or the notes of a dataset, and return it; None: it stays, empty notes: none."""
        return cast(a.Dataset, self._edited("datasets", dataset_id, name, notes))

    def update_run(self, run_id: str, *, name: str | None = None, notes: str | None = None) -> a.Run:
        """Change the name or the notes of a run, and return it; None: it stays, empty notes: none."""
        return cast(a.Run, self._edited("runs", run_id, name, notes))

    def update_diagnosis(self, diagnosis_id: str, *, name: str | None = None, notes: str | None = None) -> Diagnosis:
        """Change the name or the notes of a diagnosis, and return it; None: it stays, empty notes: none."""
        return cast(Diagnosis, self._edited("diagnoses", diagnosis_id, name, notes))

    def _edited(self, kind: str, row_id: str, name: str | None, notes: str | None) -> object:
        return self._json("PATCH", f"/v1/{kind}/{part(row_id)}", json=given(name=name, notes=notes))
