"""Genes (named, bounded parameters of a model) and genomes (their values in a declared order)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from wingfit.records.array_types import Array, ArrayLike, Float

Scale = Literal["log", "linear"]


class EstimateError(ValueError):
    """An estimate of the dataset that the model refuses: of an unknown gene, or outside the gene's bounds."""


@dataclass(frozen=True)
class Gene:
    """One parameter that a calibration may search, bounded by ``lower`` and ``upper``, in ``unit``.

    ``nominal`` is its value without a calibration; ``scale`` ("linear", "log") spreads a search over the bounds.
    ``share_of`` names a group whose values are weights: the model divides each by the sum of its group, so
    that the shares sum to one for every genome (thesis Eqs. 12-13).
    """

    name: str
    unit: str
    nominal: float
    lower: float
    upper: float
    scale: Scale
    description: str
    share_of: str | None = None

    def __post_init__(self) -> None:
        if not self.lower < self.upper:
            raise ValueError(f"gene '{self.name}': lower bound {self.lower} must be below upper bound {self.upper}")
        if self.scale == "log" and self.lower <= 0:
            message = f"a log-scaled gene needs a positive lower bound, got {self.lower} {self.unit}"
            raise ValueError(f"gene '{self.name}': {message}")
        self.check(self.nominal)

    def check(self, value: float) -> None:
        """Raise ValueError naming the value, the limits and the unit when ``value`` is not admissible."""
        if not (math.isfinite(value) and self.lower <= value <= self.upper):
            unit = "" if self.unit == "1" else f" {self.unit}"
            bounds = f"[{self.lower:g}, {self.upper:g}]{unit}"
            raise ValueError(f"gene '{self.name}' is {value:g}{unit}; it must lie in {bounds}")

    def to_unit(self, value: ArrayLike) -> Float[Array, "*B"]:
        """Map values between the bounds to [0, 1], logarithmically for a log-scaled gene."""
        v = np.asarray(value, float)
        if self.scale == "log":
            return np.asarray(np.log(v / self.lower) / math.log(self.upper / self.lower))
        return np.asarray((v - self.lower) / (self.upper - self.lower))

    def from_unit(self, u: ArrayLike) -> Float[Array, "*B"]:
        """Inverse of :meth:`to_unit`, clipped to the bounds."""
        x = np.asarray(u, float)
        if self.scale == "log":
            value = self.lower * np.exp(x * math.log(self.upper / self.lower))
        else:
            value = self.lower + x * (self.upper - self.lower)
        return np.asarray(np.clip(value, self.lower, self.upper))


@dataclass(frozen=True)
class Genome:
    """Values of genes, in the order of ``genes``."""

    genes: tuple[Gene, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.genes) != len(self.values):
            raise ValueError(f"a genome of {len(self.genes)} genes needs as many values, got {len(self.values)}")
        for gene, value in zip(self.genes, self.values, strict=True):
            gene.check(value)

    @classmethod
    def nominal(cls, genes: Sequence[Gene]) -> Genome:
        """The genome of all nominal values."""
        return cls(tuple(genes), tuple(gene.nominal for gene in genes))

    def __getitem__(self, name: str) -> float:
        return self.as_dict()[name]

    def as_dict(self) -> dict[str, float]:
        """Values by gene name."""
        return {gene.name: value for gene, value in zip(self.genes, self.values, strict=True)}

    def replace(self, values: Mapping[str, float]) -> Genome:
        """Return a genome with the named values changed; an unknown name raises ValueError with the known ones."""
        known = self.as_dict()
        unknown = sorted(set(values) - set(known))
        if unknown:
            raise ValueError(f"unknown gene {unknown[0]!r}; the model has {', '.join(known)}")
        merged = known | {name: float(value) for name, value in values.items()}
        return Genome(self.genes, tuple(merged[gene.name] for gene in self.genes))

    def normalised(self) -> dict[str, float]:
        """Values by name, with every share group divided by its sum: the values that the model uses."""
        sums: dict[str, float] = {}
        pairs = list(zip(self.genes, self.values, strict=True))
        for gene, value in pairs:
            if gene.share_of:
                sums[gene.share_of] = sums.get(gene.share_of, 0.0) + value
        return {gene.name: value / sums[gene.share_of] if gene.share_of else value for gene, value in pairs}
