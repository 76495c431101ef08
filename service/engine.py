"""What the service needs of calibration, behind one seam: `WingEngine` is the real one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Protocol

from calibration import result, search
from calibration.evaluator import Evaluator
from calibration.problem import base_genome
from calibration.result import Comparison, GeneResult, Result
from calibration.search import CalibrationSpec, Generation
from records import Dataset, Recording, load_archive
from sim.flexible_wing import FlexibleWing
from sim.loads import simulate_outputs
from sim.outputs import Outputs


class Engine(Protocol):
    """Reads datasets, checks specifications, calibrates, judges; ValueError says what is wrong."""

    def load(self, data: bytes, filename: str) -> Dataset:
        """Parse an uploaded archive."""
        ...

    def check(self, spec: CalibrationSpec, dataset: Dataset) -> None:
        """Raise ValueError when ``spec`` does not fit ``dataset``."""
        ...

    def gene_names(self, spec: CalibrationSpec, dataset: Dataset) -> tuple[str, ...]:
        """Genes of the model; ValueError for an impossible division."""
        ...

    def genome(self, spec: CalibrationSpec, dataset: Dataset, values: Mapping[str, float]) -> dict[str, float]:
        """The nominal genome with ``values`` changed; ValueError for a value out of bounds."""
        ...

    def genes(self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float]) -> tuple[GeneResult, ...]:
        """Standing of the genes while the search runs."""
        ...

    def calibrate(
        self, spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None
    ) -> Iterator[Generation]:
        """Search, or go on from ``checkpoint``."""
        ...

    def summarise(
        self, spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, genome: Mapping[str, float]
    ) -> Result:
        """Judge the best genome on every recording."""
        ...

    def compare(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str
    ) -> Comparison:
        """Tracks of a genome over a recording."""
        ...

    def loads(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: Recording
    ) -> Outputs:
        """Loads, powers and energies of a genome under a recording's condition."""
        ...


class WingEngine:
    """Calibrates the flexible wing."""

    def load(self, data: bytes, filename: str) -> Dataset:
        """Parse an uploaded archive; DatasetError says where it is malformed."""
        return load_archive(data, filename)

    def check(self, spec: CalibrationSpec, dataset: Dataset) -> None:
        """Plan the calibration without running it."""
        search.plan(spec, dataset)

    def gene_names(self, spec: CalibrationSpec, dataset: Dataset) -> tuple[str, ...]:
        """Genes of the wing with this division."""
        return tuple(gene.name for gene in _model(spec, dataset).genes)

    def genome(self, spec: CalibrationSpec, dataset: Dataset, values: Mapping[str, float]) -> dict[str, float]:
        """The nominal genome of the wing with ``values`` changed."""
        return base_genome(_model(spec, dataset), values).as_dict()

    def genes(self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float]) -> tuple[GeneResult, ...]:
        """Standing of the genes while the search runs: no errors of estimation yet."""
        model = _model(spec, dataset)
        searched = {name for stage in search.plan(spec, dataset) for name in stage.free}
        nominal, best = base_genome(model).normalised(), base_genome(model, genome).normalised()
        return tuple(
            GeneResult(
                name=gene.name,
                unit=gene.unit,
                description=gene.description,
                nominal=nominal[gene.name],
                best=best[gene.name],
                lower=gene.lower,
                upper=gene.upper,
                searched=gene.name in searched,
                standard_error=None,
                identifiable=None,
            )
            for gene in model.genes
        )

    def calibrate(
        self, spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any] | None
    ) -> Iterator[Generation]:
        """Search genetically, stage by stage."""
        return search.calibrate(spec, dataset, evaluator, checkpoint)

    def summarise(
        self, spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, genome: Mapping[str, float]
    ) -> Result:
        """Judge the best genome on every recording."""
        return result.summarise(spec, dataset, evaluator, genome)

    def compare(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str
    ) -> Comparison:
        """Simulate one recording's condition."""
        return result.compare(spec, dataset, genome, recording)

    def loads(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: Recording
    ) -> Outputs:
        """Simulate one recording's condition for what acts inside the wing and on it."""
        model = _model(spec, dataset)
        return simulate_outputs(model, base_genome(model, genome).values, recording)


def _model(spec: CalibrationSpec, dataset: Dataset) -> FlexibleWing:
    return search.model_for(dataset, spec.division, spec.bounds_factor, spec.accuracy)
