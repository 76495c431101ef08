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
    """Raised if a dataset has an estimate of a gene that its model does not have, or one that cannot be right."""


@dataclass(frozen=True)
class Gene:
    """One parameter that a calibration may search, bounded by ``lower`` and ``upper``, in ``unit``.

    ``nominal`` is its value without a calibration. ``scale`` says how a search spreads its values between the bounds:
    evenly ("linear") or evenly in the logarithm ("log"). ``share_of`` names a group of genes whose values are weights:
    the model divides each by the sum of its group, so that these shares of a total (the lift of a strip,
    by quarters of its chord) always add up to one (van der Grinten's thesis, Eqs. 12-13). None: the gene is no weight.
    """

    name: str
    unit: str
    nominal: float
    lower: float
    upper: float
    scale: Scale = "linear"
    description: str = ""
    share_of: str | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.lower) and math.isfinite(self.upper)):
            raise ValueError(
                f"gene '{self.name}': its bounds are {self.lower} and {self.upper}; give finite ones, since a search "
                "draws values between them"
            )
        if not self.lower < self.upper:
            raise ValueError(f"gene '{self.name}': lower bound {self.lower} must be below upper bound {self.upper}")
        if self.scale == "log" and self.lower <= 0:
            message = f"a log-scaled gene needs a positive lower bound, got {self.lower} {self.unit}"
            raise ValueError(f"gene '{self.name}': {message}")
        self.check(self.nominal)

    def check(self, value: float) -> None:
        """Raise ValueError, which names value, bounds and unit, if ``value`` is not finite or outside the bounds."""
        if not (math.isfinite(value) and self.lower <= value <= self.upper):
            unit = "" if self.unit == "1" else f" {self.unit}"
            bounds = f"[{self.lower:g}, {self.upper:g}]{unit}"
            raise ValueError(f"gene '{self.name}' is {value:g}{unit}; it must lie in {bounds}")

    def to_unit(self, value: ArrayLike) -> Float[Array, "*B"]:
        """Map values (in ``unit``, any shape) from [lower, upper] to [0, 1], logarithmically for a log-scaled gene."""
        v = np.asarray(value, float)
        if self.scale == "log":
            return np.asarray(np.log(v / self.lower) / math.log(self.upper / self.lower))
        return np.asarray((v - self.lower) / (self.upper - self.lower))

    def from_unit(self, u: ArrayLike) -> Float[Array, "*B"]:
        """Map ``u`` (any shape) from [0, 1] to values between the bounds, the inverse of :meth:`to_unit`; clipped."""
        x = np.asarray(u, float)
        if self.scale == "log":
            value = self.lower * np.exp(x * math.log(self.upper / self.lower))
        else:
            value = self.lower + x * (self.upper - self.lower)
        return np.asarray(np.clip(value, self.lower, self.upper))


@dataclass(frozen=True)
class Genome:
    """One value for each gene, in the order of ``genes``; ValueError if one lies outside the bounds of its gene."""

    genes: tuple[Gene, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.genes) != len(self.values):
            raise ValueError(f"a genome of {len(self.genes)} genes needs as many values, got {len(self.values)}")
        for gene, value in zip(self.genes, self.values, strict=True):
            gene.check(value)

    @classmethod
    def nominal(cls, genes: Sequence[Gene]) -> Genome:
        """Return the genome in which every gene has its nominal value."""
        return cls(tuple(genes), tuple(gene.nominal for gene in genes))

    def __getitem__(self, name: str) -> float:
        return self.as_dict()[name]

    def as_dict(self) -> dict[str, float]:
        """Return the values by name of the gene."""
        return {gene.name: value for gene, value in zip(self.genes, self.values, strict=True)}

    def replace(self, values: Mapping[str, float]) -> Genome:
        """Return a genome with ``values`` (by name) changed; ValueError for an unknown name or an impossible value."""
        known = self.as_dict()
        unknown = sorted(set(values) - set(known))
        if unknown:
            raise ValueError(f"unknown gene {unknown[0]!r}; the model has {', '.join(known)}")
        merged = known | {name: float(value) for name, value in values.items()}
        return Genome(self.genes, tuple(merged[gene.name] for gene in self.genes))

    def normalised(self) -> dict[str, float]:
        """Return the values that the model uses, by gene name: weights (``share_of``) divided by their group's sum."""
        sums: dict[str, float] = {}
        pairs = list(zip(self.genes, self.values, strict=True))
        for gene, value in pairs:
            if gene.share_of:
                sums[gene.share_of] = sums.get(gene.share_of, 0.0) + value
        return {gene.name: value / sums[gene.share_of] if gene.share_of else value for gene, value in pairs}
