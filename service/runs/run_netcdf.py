"""A run as NetCDF: its history, its genes, and every recording together with its simulation with the best genome.

Layout: the root group has the history (dimension ``generation``) and the genes (dimension ``gene``); each group
``recordings/<name>`` has marker tracks (``time, marker, axis``) or forces (``quantity, phase``; modelled forces also
``source``: where the coefficients come from). A run on series has groups ``curves/1, 2, ...`` instead, the curves of
its result over ``time``. Numbers and names are those of the API. The file is made in memory, one recording at a time;
it takes some hundred bytes per generation and twice the size of the dataset.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from wingfit.client.answers import CONDITION, GenomeInfo
from wingfit.client.force_answers import ByQuantity, Forces
from wingfit.records import Dataset, Recording, SeriesDataset
from wingfit.records.files.folder import RECORDINGS
from wingfit.service.container import Service
from wingfit.service.http.problems import ProblemError
from wingfit.service.outcomes import coefficient_source, force_views
from wingfit.service.runs import best_genome, views
from wingfit.service.runs import netcdf_variables as nc
from wingfit.service.runs.exports import Exported, blocks, request
from wingfit.service.storage import store
from wingfit.service.storage.database import Database
from wingfit.service.storage.tables import RunRow

Json = dict[str, Any]
AXES = "xyz"
TRACK_PHASE = "phase of the beat, zero where the reference markers cross the horizontal on the upstroke"
FORCE_PHASE = "phase of the beat, zero where the wings are closest and begin to open"
GENE_NUMBERS = (
    ("nominal", "see gene_unit", "nominal value"),
    ("best", "see gene_unit", "best value so far"),
    ("lower", "see gene_unit", "lower bound"),
    ("upper", "see gene_unit", "upper bound"),
    ("standard_error", "see gene_unit", "standard error of the best value"),
    ("standard_error_percent", "percent", "standard error, of the best value"),
)


def file(service: Service, exported: Exported[RunRow], genome: GenomeInfo, gone: Callable[[], bool]) -> bytes:
    """Return the bytes of the NetCDF file; ``genome``: the genes as in the JSON answer.

    ``gone()`` says whether the client has hung up; the next recording is then not simulated, and a 503 raised.
    """
    dataset = service.datasets.get(exported.row.dataset_id)

    def write(root: Any) -> None:
        root.dimensions = {"generation": exported.row.generations, "gene": len(genome["genes"])}
        _history(root, service.database, exported.row)
        _genes(root, genome["genes"])
        if isinstance(dataset, SeriesDataset):  # whose simulation may be elsewhere
            _curves(root, exported.row)
        else:
            _recordings(root, service, exported.row, dataset, gone)

    row = exported.row
    model = {"tracks": "flexible wing", "forces": "blade-element model"}.get(row.kind) or row.rig_name or ""
    of_run = {"title": f"calibration {row.name}", "request": json.dumps(request(row))}
    return nc.made(write, nc.provenance(row, exported.dataset, model, exported.at) | of_run)


# By kind of run: unit of sums of squares, then name and unit of the misfit.
MISFITS = {
    "tracks": ("m2", ("best_mm", "mm")),
    "forces": ("N2", ("best_mn", "mN")),
    "series": (nc.NO_UNIT, ("best_percent", "percent")),
}


def _history(root: Any, database: Database, row: RunRow) -> None:
    along = ("generation",)
    square, misfit = MISFITS[row.kind]
    counts = {
        "sequence": "number of the generation over all stages",
        "generation": "number of the generation in its stage",
        "evaluations": "individuals evaluated since the run began",
        "failed": "individuals of the generation that failed",
    }
    reals = {
        "best": (square, "fitness of the best individual"),
        "mean": (square, "mean fitness of the individuals that did not fail; of Gauss-Newton that of the iteration"),
        "diversity": (nc.NO_UNIT, "diversity of the generation; of Gauss-Newton its largest step"),
        misfit[0]: (misfit[1], "misfit of the best individual"),
        "elapsed_seconds": ("s", "computing time since the run began"),
    }
    # The variable "generation" would be the coordinate of the dimension of that name.
    names = {"generation": "generation_in_stage"}
    series = {name: nc.numbers(root, name, along, *said) for name, said in reals.items()}
    for name, said in counts.items():
        series[name] = nc.numbers(root, names.get(name, name), along, nc.NO_UNIT, said, kind="i8")
    stage = nc.texts(root, "stage", "generation", "stage of the search")
    reasons = nc.texts(root, "reasons", "generation", "why individuals failed")
    filled = 0
    for block in blocks(database, row):
        here = slice(filled, filled := filled + len(block))
        for name, variable in series.items():
            variable[here] = nc.or_nan(getattr(one, name) for one in block)
        stage[here] = nc.text_array(one.stage for one in block)
        reasons[here] = nc.text_array("; ".join(one.reasons) for one in block)


def _genes(root: Any, genes: Any) -> None:
    for name, meaning in (("", "gene"), ("_unit", "unit of the gene's values"), ("_description", "what the gene is")):
        nc.texts(root, f"gene{name}", "gene", meaning, (gene[name.removeprefix("_") or "name"] for gene in genes))
    for name, units, said in GENE_NUMBERS:
        values = nc.or_nan(gene.get(name) for gene in genes)
        nc.numbers(root, f"gene_{name}", ("gene",), units, said, values)
    nc.flags(root, "gene_searched", "gene", "whether it was searched", (gene["searched"] for gene in genes))
    nc.flags(
        root, "gene_identifiable", "gene", "whether the data determine it", (gene["identifiable"] for gene in genes)
    )


def _curves(root: Any, row: RunRow) -> None:
    """Write the curves of the result of a run on series into ``root``, a group for each; nothing before it has one."""
    models = {"nominal": "simulated with the nominal genome", "best": "simulated with the best genome"}
    for number, one in enumerate((row.result or {}).get("curves", ()), 1):
        nc.curve(root.create_group(f"curves/{number}"), one, one["time_s"], models)


def _recordings(root: Any, service: Service, row: RunRow, dataset: Dataset, gone: Callable[[], bool]) -> None:
    found = coefficient_source.estimates(service, row, dataset) if row.kind == "forces" else {}
    for recording in dataset.recordings:
        if gone():
            raise ProblemError(503, "unavailable", "the caller has hung up; ask again")
        group = root.create_group(f"{RECORDINGS}/{recording.name}")
        described: Any = views.recording(recording, recording.name in dataset.held_out)
        held_out = {"held_out": "yes" if described["held_out"] else "no"}
        nc.describe(group, held_out | {"rig": described["rig"]} | {name: described[name] for name in CONDITION})
        if row.kind == "tracks":
            _tracks(group, service, row, dataset, recording)
        else:
            _forces(group, service, row, dataset, recording, found)


def _tracks(group: Any, service: Service, row: RunRow, dataset: Dataset, recording: Recording) -> None:
    how: Json
    group.dimensions = {"time": len(recording.times), "marker": len(recording.markers), "axis": len(AXES)}
    nc.texts(group, "marker", "marker", "marker", recording.markers)
    nc.texts(group, "axis", "axis", "axis of the wing frame: x aft, y outboard, z up", AXES)
    nc.numbers(group, "time_s", ("time",), "s", "time of the frame", recording.times)
    along, where = ("time", "marker", "axis"), {"coordinates": "time_s phase"}
    recorded = views.track_mm(recording.positions)
    nc.numbers(group, "recorded_mm", along, "mm", "recorded position", recorded, **where)
    phase, simulated = np.full(len(recording.times), np.nan), np.full(recorded.shape, np.nan)
    try:
        found = service.engine.compare(store.spec(row), dataset, best_genome.best(row), recording.name)
    except ValueError as error:
        how = {"comment": f"the simulation failed: {error}"}
    else:
        phase, simulated = views.tidy_phase(found.phase), views.track_mm(found.simulated)
        solved = views.numerics(found)
        how = {name: np.nan if value is None else value for name, value in solved.items()}
    nc.numbers(group, "phase", ("time",), nc.NO_UNIT, TRACK_PHASE, phase)
    nc.numbers(group, "simulated_mm", along, "mm", "position simulated with the best genome", simulated, **where, **how)


def _forces(
    group: Any,
    service: Service,
    row: RunRow,
    dataset: Dataset,
    recording: Recording,
    found: coefficient_source.Estimates,
) -> None:
    beats: dict[str, Forces] = {}
    comments = []
    for source, make in coefficient_source.offered(service, row, dataset, recording.name, found).items():
        try:
            chosen = make()
            compared = service.engine.forces(store.spec(row), dataset, chosen.genome, recording.name, source)
        except ValueError as error:
            comments.append(f"{source}: the simulation failed: {error}")
            continue
        beats[source] = force_views.forces(compared)
        comments += [f"{source}: {remark}" for remark in (*chosen.remarks, *compared.remarks)]
    if beats:
        _beats(group, beats)
    if comments:
        nc.describe(group, {"comment": "\n".join(comments)})


def _beats(group: Any, beats: dict[str, Forces]) -> None:
    """Write the recorded and modelled forces of one recording; ``beats``: forces by source of their coefficients."""
    first = next(iter(beats.values()))
    quantities, phase = tuple(first["recorded_n"]), first["phase"]
    group.dimensions = {"source": len(beats), "quantity": len(quantities), "phase": len(phase)}
    nc.texts(group, "source", "source", "where the coefficients are from", beats)
    nc.texts(group, "quantity", "quantity", "force of the wings on the body: of the stream, or body axes", quantities)
    nc.numbers(group, "phase", ("phase",), nc.NO_UNIT, FORCE_PHASE, phase)

    def series(named: ByQuantity) -> list[list[float]]:
        missing = [np.nan] * len(phase)
        return [named.get(quantity, missing) for quantity in quantities]

    along = ("quantity", "phase")
    nc.numbers(group, "recorded_n", along, "N", "recorded force, mean beat", series(first["recorded_n"]))
    nc.numbers(
        group,
        "standard_deviation_n",
        along,
        "N",
        "standard deviation between beats",
        series(first["standard_deviation_n"]),
    )
    modelled = [series(beat["modelled_n"]) for beat in beats.values()]
    nc.numbers(group, "modelled_n", ("source", *along), "N", "modelled force", modelled)
