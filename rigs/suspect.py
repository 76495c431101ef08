"""A suspect: an effect that may be missing in a model, and that a diagnosis can add to it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from wingfit.records import Gene
from wingfit.records.name_lists import refuse_no_mapping, refuse_text

Family = Literal["structure", "inertia", "actuation", "aerodynamics", "measurement", "physics", "input"]
TYPICAL_PART = 0.2  # of the larger bound: size of an effect whose typical size is not stated


@dataclass(frozen=True)
class Suspect:
    """An effect that may be missing in the model: physics, or a fault of the measurement, that can be added to it.

    Attributes:
        name: identifier with which the effect is added to a model.
        title: display name; the name if not given.
        family: kind of physics, "input" for a fault of an input, or "measurement".
        genes: the genes that the effect adds to the model; with all size genes at zero the effect is exactly off.
        size_genes: names of those of ``genes`` that say how strong the effect is; if not given, those that are zero in
            the nominal model.
        typical: value of each of ``genes`` for an effect as strong as in practice; those not given are TYPICAL_PART of
            the larger bound for a size, else nominal.
        source: reference of its law.
        signature: what the effect looks like in a recording, as text for the user.
        location_genes: names of the genes that give its location along "span" and "chord" (0 to 1); empty if it has
            none.
        confused_with: names of suspects that look similar in a recording.
        candidate_shapes: values of the shape genes (:attr:`shape_genes`), a tuple for each trial of the score test;
            empty means that the score test spreads its own trials.
        positions: values that a size gene can have besides zero, by its name, where it is a choice rather than an
            amount (a wrong sign): a fit that ends between them is no hypothesis.
        descriptive: whether it describes how parameters differ between recordings, but not why; then it is no more
            probable than a mechanism with which it may be confused, and which leaves little more.
    """

    name: str
    title: str = ""
    family: Family = "physics"
    genes: tuple[Gene, ...] = ()
    size_genes: tuple[str, ...] = ()
    typical: Mapping[str, float] = field(default_factory=dict)
    source: str = ""
    signature: str = ""
    location_genes: Mapping[Literal["span", "chord"], str] = field(default_factory=dict)
    confused_with: tuple[str, ...] = ()
    candidate_shapes: tuple[tuple[float, ...], ...] = ()
    positions: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    descriptive: bool = False

    def __post_init__(self) -> None:
        refuse_text(self, "size_genes", "confused_with")
        refuse_no_mapping(self, "typical", "location_genes", "positions")
        genes = tuple(self.genes)
        if not genes:
            raise ValueError(f"suspect {self.name!r} has no gene; give at least one that switches it off at zero")
        sizes = self.size_genes or tuple(gene.name for gene in genes if gene.nominal == 0.0)
        unknown = sorted({*sizes, *self.typical, *self.positions} - {gene.name for gene in genes})
        if unknown:
            raise ValueError(
                f"suspect {self.name!r} has no gene {unknown[0]!r}; it has {', '.join(g.name for g in genes)}"
            )
        if not sizes:
            raise ValueError(f"suspect {self.name!r} has no size gene: one whose nominal value, zero, switches it off")
        for gene in genes:
            if gene.name in sizes and gene.nominal != 0.0:
                raise ValueError(
                    f"size gene {gene.name!r} of suspect {self.name!r} must be 0 when off, not {gene.nominal:g}"
                )
        shapes = len(genes) - len(sizes)
        for row in self.candidate_shapes:
            if len(row) != shapes:
                raise ValueError(
                    f"suspect {self.name!r}: candidate_shapes has a row of {len(row)} values; each needs {shapes}, one "
                    "for each gene that is no size"
                )
        values = {gene.name: _typical(gene) if gene.name in sizes else gene.nominal for gene in genes}
        for name, value in (
            ("title", self.title or self.name.replace("_", " ")),
            ("genes", genes),
            ("size_genes", tuple(sizes)),
            ("typical", values | dict(self.typical)),
        ):
            object.__setattr__(self, name, value)

    @property
    def shape_genes(self) -> tuple[str, ...]:
        """Names of the genes that are not sizes, such as the location."""
        return tuple(gene.name for gene in self.genes if gene.name not in self.size_genes)


def _typical(gene: Gene) -> float:
    return TYPICAL_PART * (gene.upper if gene.upper >= -gene.lower else gene.lower)
