"""The functions of `wingfit.calibration` that the service calls, in a class that tests can replace by a fast stub."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from wingfit.calibration import result, search, summary
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.forces import estimation
from wingfit.calibration.forces.agreement import agreements
from wingfit.calibration.forces.estimation import Prediction
from wingfit.calibration.forces.result import Agreement, ForceComparison, ForceResult, GlobalModel, Source
from wingfit.calibration.preparation import as_fitted
from wingfit.calibration.problem import base_genome
from wingfit.calibration.result import Comparison, GeneResult, Result
from wingfit.calibration.search import CalibrationSpec, Generation
from wingfit.calibration.spec import vehicle_model, wing_model
from wingfit.checks import Mistake, check_archive, examine
from wingfit.checks.load import Checked, refuse
from wingfit.records import AnyDataset, Condition, Dataset, Recording, load_archive
from wingfit.sim.wing.loads import simulate_outputs
from wingfit.sim.wing.outputs import Outputs


class Engine:
    """Calibrates and simulates the flexible wing (datasets of marker tracks) and vehicles (datasets of forces).

    ``spec`` describes model, method and settings; ``genome`` maps names of genes (model parameters) to values. Methods
    raise a ValueError with a message for the user if a request cannot be fulfilled.
    """

    def load(self, data: bytes, filename: str) -> AnyDataset:
        """Parse ``data``, an uploaded zip called ``filename``; DatasetError says where it is malformed."""
        return load_archive(data, filename)

    def load_checked(self, data: bytes, filename: str) -> Checked:
        """Parse and check an uploaded zip; DatasetError also lists mistakes that are certain, others are returned."""
        return check_archive(data, filename)

    def examine(self, dataset: AnyDataset) -> tuple[Mistake, ...]:
        """Return the likely mistakes in ``dataset``; DatasetError if one is certain."""
        found = examine(dataset)
        refuse(found)
        return found

    def check(self, spec: CalibrationSpec, dataset: Dataset) -> CalibrationSpec:
        """Return ``spec`` with every default filled in; raise ValueError if it does not fit ``dataset``."""
        return search.prepare(spec, dataset).spec

    def gene_names(self, spec: CalibrationSpec, dataset: Dataset) -> tuple[str, ...]:
        """Return the names of the model's genes; ValueError for an impossible discretisation or an unknown term."""
        return tuple(gene.name for gene in search.model_for(dataset, spec).genes)

    def genome(self, spec: CalibrationSpec, dataset: Dataset, values: Mapping[str, float]) -> dict[str, float]:
        """Return the nominal genome with ``values`` (by gene name) changed; ValueError for a value out of bounds."""
        return base_genome(search.model_for(dataset, spec), values).as_dict()

    def genes(self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float]) -> tuple[GeneResult, ...]:
        """Return all genes with nominal value, bounds, and their value in ``genome`` as the best value so far.

        Standard errors are None, because they are known only at the end of the search.
        """
        ready = search.prepare(spec, dataset)
        model, searched = ready.model, ready.searched
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
        """Search stage by stage and yield each finished generation; continue from ``checkpoint`` unless it is None."""
        return search.calibrate(spec, dataset, evaluator, checkpoint)

    def found(self, spec: CalibrationSpec, dataset: Dataset, checkpoint: dict[str, Any]) -> dict[str, dict[str, float]]:
        """Return the best genome of each stage so far (stage name, gene name, value), from ``checkpoint``."""
        return search.found(spec, dataset, checkpoint)

    def summarise(
        self, spec: CalibrationSpec, dataset: Dataset, evaluator: Evaluator, checkpoint: dict[str, Any]
    ) -> Result | ForceResult:
        """Evaluate the best genome of the search that ended with ``checkpoint`` on all recordings; return results."""
        return summary.summarise(spec, dataset, evaluator, checkpoint)

    def compare(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str
    ) -> Comparison:
        """Simulate the condition of ``recording`` with ``genome``; return recorded and simulated marker tracks."""
        return result.compare(spec, dataset, genome, recording)

    def loads(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: Recording
    ) -> Outputs:
        """Simulate the condition of ``recording`` with ``genome``; return loads, powers and energies over one beat."""
        model = wing_model(dataset, spec)
        return simulate_outputs(model, base_genome(model, genome).values, recording)

    def forces(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str, source: Source
    ) -> ForceComparison:
        """Compute the forces in the condition of ``recording`` with ``genome``, low-passed as in the calibration.

        ``source`` says where the genome comes from; it is only stored in the result.
        """
        return estimation.compare_forces(spec, dataset, recording, source, genome)

    def agreements(
        self, spec: CalibrationSpec, dataset: Dataset, genome: Mapping[str, float], recording: str
    ) -> tuple[Agreement, ...]:
        """Compute one recording's forces with ``genome``; return how well each quantity agrees with the recording."""
        model, record = vehicle_model(dataset, spec), as_fitted(spec, dataset.recording(recording))
        observed = model.observe([base_genome(model, genome).values], record)
        if observed.reasons[0] is not None:
            raise ValueError(f"the forces under {recording!r} cannot be computed: {observed.reasons[0]}")
        return agreements(record, observed.channels[0], "nominal")

    def predict(self, spec: CalibrationSpec, dataset: Dataset, law: GlobalModel, condition: Condition) -> Prediction:
        """Compute the forces in ``condition``, with the coefficients that the global model ``law`` gives for it."""
        return estimation.predict(spec, dataset, law, condition)
