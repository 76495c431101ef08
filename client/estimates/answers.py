"""JSON answers of the server about what is known of several genes together."""

from __future__ import annotations

from typing_extensions import TypedDict


class Correlations(TypedDict):
    """Correlation coefficients [F][F] of the estimates of ``genes``; null for genes whose error is not known."""

    genes: list[str]
    values: list[list[float | None]]


class GeneCovariance(TypedDict):
    """Covariance [F][F] of the estimates of the genes called ``names``; an entry has the product of both units."""

    names: list[str]
    matrix: list[list[float]]
