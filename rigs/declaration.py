"""A rig without its simulation, as JSON: what a service must know of a rig that its user simulates elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictBool

from wingfit.records import Gene
from wingfit.records.array_types import Array
from wingfit.rigs.ports import Port
from wingfit.rigs.rig import Rig, required_rig
from wingfit.rigs.run import Run, SimulationError
from wingfit.rigs.suspect import Suspect

Name = Annotated[str, Field(min_length=1, max_length=200)]
Unit = Annotated[str, Field(max_length=50)]
Text = Annotated[str, Field(max_length=2000)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Units = Annotated[dict[Name, Unit], Field(max_length=200)]
MOST = 200  # genes, suspects or ports
Family = Literal["structure", "inertia", "actuation", "aerodynamics", "measurement", "physics", "input"]


class _Declared(BaseModel):
    model_config = ConfigDict(extra="forbid")


class GeneDeclaration(_Declared):
    """A gene: a parameter with bounds, in its unit; with the scale "log", a search spreads values in the logarithm."""

    name: Name
    unit: Unit
    nominal: Number
    lower: Number
    upper: Number
    scale: Literal["linear", "log"] = "linear"
    description: Text = ""
    share_of: Annotated[Name | None, Field(description="group of weights that are divided by their sum")] = None


Genes = Annotated[list[GeneDeclaration], Field(max_length=MOST)]


class SuspectDeclaration(_Declared):
    """An effect that may be missing; zero for all its size genes switches it off."""

    name: Name
    genes: Genes
    title: Text = ""
    family: Family = "physics"
    size_genes: Annotated[
        list[Name], Field(max_length=MOST, description="empty: those that are zero in the nominal model")
    ] = []
    typical: Annotated[dict[Name, Number], Field(max_length=MOST)] = {}
    source: Text = ""
    signature: Text = ""
    location_genes: Annotated[
        dict[Literal["span", "chord"], Name],
        Field(max_length=2, description="genes of the location of the effect"),
    ] = {}
    confused_with: Annotated[list[Name], Field(max_length=MOST)] = []
    candidate_shapes: Annotated[list[Annotated[list[Number], Field(max_length=MOST)]], Field(max_length=MOST)] = []
    positions: Annotated[dict[Name, Annotated[list[Number], Field(max_length=MOST)]], Field(max_length=MOST)] = {}
    descriptive: bool = False


class PortDeclaration(_Declared):
    """A coordinate of the rig at which laws may act, with its typical largest values."""

    name: Name
    coordinate_unit: Unit
    force_unit: Unit
    coordinate: Number
    rate: Number
    force: Number
    stiffness: Annotated[str, Field(max_length=200, description="gene of the spring that may have play")] = ""


class RigDeclaration(_Declared):
    """A rig whose simulation runs on its user's machine; see :class:`wingfit.Rig`."""

    name: Name
    genes: Genes
    channels: Annotated[Units, Field(min_length=1, description="unit of each channel that is simulated")]
    suspects: Annotated[list[SuspectDeclaration], Field(max_length=MOST)] = []
    recording_genes: Genes = []
    inputs: Units = {}
    settings: Units = {}
    ports: Annotated[list[PortDeclaration], Field(max_length=MOST)] = []
    faults: StrictBool = True
    description: Text = ""

    def rig(self) -> Rig:
        """Return the rig, whose simulation cannot be called here; ValueError where it contradicts itself."""
        return Rig(
            name=self.name,
            genes=_genes(self.genes),
            channels=self.channels,
            simulate=_elsewhere,
            suspects=[_suspect(one) for one in self.suspects],
            recording_genes=_genes(self.recording_genes),
            inputs=self.inputs,
            settings=self.settings,
            ports=[Port(**one.model_dump()) for one in self.ports],
            faults=self.faults,
            description=self.description,
        )


def declaration(rig: Rig) -> dict[str, Any]:
    """Return the :class:`RigDeclaration` of ``rig`` as JSON."""
    required_rig(rig)
    return {
        "name": rig.name,
        "genes": [_gene_json(gene) for gene in rig.genes],
        "channels": dict(rig.channels),
        "suspects": [_suspect_json(one) for one in rig.suspects],
        "recording_genes": [_gene_json(gene) for gene in rig.recording_genes],
        "inputs": dict(rig.inputs),
        "settings": dict(rig.settings),
        "ports": [asdict(port) for port in rig.ports],
        "faults": rig.faults,
        "description": rig.description,
    }


def _genes(declared: list[GeneDeclaration]) -> list[Gene]:
    return [Gene(**one.model_dump()) for one in declared]


def _suspect(declared: SuspectDeclaration) -> Suspect:
    return Suspect(
        **declared.model_dump(exclude={"genes", "size_genes", "confused_with", "candidate_shapes", "positions"}),
        genes=tuple(_genes(declared.genes)),
        size_genes=tuple(declared.size_genes),
        confused_with=tuple(declared.confused_with),
        candidate_shapes=tuple(tuple(one) for one in declared.candidate_shapes),
        positions={name: tuple(values) for name, values in declared.positions.items()},
    )


def _gene_json(gene: Gene) -> dict[str, Any]:
    return asdict(gene)


def _suspect_json(suspect: Suspect) -> dict[str, Any]:
    return {
        "name": suspect.name,
        "genes": [_gene_json(gene) for gene in suspect.genes],
        "title": suspect.title,
        "family": suspect.family,
        "size_genes": list(suspect.size_genes),
        "typical": dict(suspect.typical),
        "source": suspect.source,
        "signature": suspect.signature,
        "location_genes": dict(suspect.location_genes),
        "confused_with": list(suspect.confused_with),
        "candidate_shapes": [list(one) for one in suspect.candidate_shapes],
        "positions": {name: list(values) for name, values in suspect.positions.items()},
        "descriptive": suspect.descriptive,
    }


def _elsewhere(_genes: Mapping[str, float], _run: Run) -> dict[str, Array]:
    raise SimulationError("this rig is simulated on its user's machine, by 'wingfit drive'")
