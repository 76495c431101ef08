"""The best genome of a run so far."""

from __future__ import annotations

from wingfit.client.answers import GenomeInfo
from wingfit.service.container import Service
from wingfit.service.http.problems import conflict
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
    genes = service.engine.genes(store.spec(row), service.datasets.flapping(row.dataset_id), best(row))
    return GenomeInfo(genes=[views.gene(gene) for gene in genes], final=False)
