"""The best genome of a run so far."""

from __future__ import annotations

from wingfit.client.answers import GenomeInfo
from wingfit.records import SeriesDataset, wing_or_vehicle
from wingfit.service.container import Service
from wingfit.service.http.problems import conflict
from wingfit.service.rigs import rig_runs
from wingfit.service.rigs.stored_rig import rig_of
from wingfit.service.runs import views
from wingfit.service.storage import store
from wingfit.service.storage.tables import RunRow


def best(row: RunRow) -> dict[str, float]:
    """Return the best genome of a run so far (gene name to value); raise a 409 before the first generation."""
    if row.genome is None:
        raise conflict("no generation has finished yet", state=row.state)
    return row.genome


def standing(service: Service, row: RunRow) -> GenomeInfo:
    """Return, as the JSON answer, every gene with its nominal value and its value in the best genome so far.

    Values are final, with standard errors, once the run has a result. Raises a 409 before the first generation.
    """
    if row.result is not None:
        return GenomeInfo(genes=row.result["genes"], final=True)
    spec, dataset = store.spec(row), service.datasets.get(row.dataset_id)
    if isinstance(dataset, SeriesDataset) and row.rig is not None:
        genes = rig_runs.genes(spec, rig_of(row.rig), dataset, best(row))
    else:
        genes = service.engine.genes(spec, wing_or_vehicle(dataset), best(row))
    return GenomeInfo(genes=[views.gene(gene) for gene in genes], final=False)
