"""Checks that requests for runs, simulations and diagnoses share."""

from __future__ import annotations

from wingfit.calibration.search import CalibrationSpec
from wingfit.records import Dataset, EstimateError
from wingfit.service.http.problems import ErrorItem, error_item, invalid
from wingfit.service.runs.engine import Engine
from wingfit.service.runs.spec_views import unknown_genes


def gene_names(engine: Engine, spec: CalibrationSpec, dataset: Dataset) -> tuple[str, ...]:
    """Return the names of the genes of the requested model; raise a 422 if there is no such model for ``dataset``."""
    try:
        return engine.gene_names(spec, dataset)
    except EstimateError as error:
        place = f"dataset.{'wing' if dataset.kind == 'tracks' else 'vehicle'}.estimates"
        raise invalid("the dataset's estimates do not fit", [error_item(place, None, str(error))]) from None
    except ValueError as error:
        tracks = dataset.kind == "tracks"
        where, value = ("body.division", spec.division) if tracks else ("body.without", ", ".join(spec.without))
        raise invalid("there is no such model", [error_item(where, value, str(error))]) from None


def refuse_unknown(spec: CalibrationSpec, dataset: Dataset, known_genes: tuple[str, ...]) -> None:
    """Raise a 422 for recordings that the dataset does not have, and genes not in ``known_genes``, the model's."""
    genes = [(f"body.genes.{place}", name) for place, name in enumerate(spec.genes)]
    genes += [(f"body.fixed.{name}", name) for name in spec.fixed]
    recordings = tuple(recording.name for recording in dataset.recordings)
    if faults := [*_unknown_recordings(spec.recordings, recordings), *unknown_genes(genes, known_genes)]:
        raise invalid("the request names what does not exist", faults)


def _unknown_recordings(names: tuple[str, ...], known: tuple[str, ...]) -> list[ErrorItem]:
    """Return an error item for each of the requested ``names`` that is not in ``known``, the dataset's recordings.

    Only the first item lists the known names.
    """
    unknown = [(place, name) for place, name in enumerate(names) if name not in known]
    remedies = [f"known are {', '.join(known)}", *["see those named above"] * len(unknown)]
    return [
        error_item(f"body.recordings.{place}", name, f"unknown; {remedy}")
        for (place, name), remedy in zip(unknown, remedies, strict=False)
    ]
