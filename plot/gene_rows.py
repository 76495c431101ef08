"""Estimated genes with intervals and bounds, from any result or finding."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from wingfit.plot.curves import finding_data

OF_A_FINDING = 0.9  # the level of its intervals


@dataclasses.dataclass(frozen=True)
class Point:
    """An estimate with the ends of its interval: infinite where the data do not bound it, None if it is not known."""

    label: str
    value: float
    low: float | None
    high: float | None


@dataclasses.dataclass(frozen=True)
class GeneRow:
    """A gene in ``unit`` with one estimate, or one of each recording; ``bounds`` and ``nominal`` None if unknown."""

    title: str
    unit: str
    points: Sequence[Point]
    bounds: tuple[float, float] | None
    nominal: float | None


@dataclasses.dataclass(frozen=True)
class GeneRows:
    """Rows of genes, and the level of the intervals if the source states it, else None."""

    rows: Sequence[GeneRow]
    level: float | None = None


def gene_rows(source: object, errors: float) -> GeneRows:
    """Return the estimated genes of ``source`` with intervals of ± ``errors`` standard errors, or those it states.

    Raises:
        TypeError: ``source`` is neither the result of a calibration nor a finding.
    """
    keys = set(source) if isinstance(source, Mapping) else set(getattr(source, "__dict__", {}))
    if "hypotheses" in keys:
        return _of_finding(finding_data(source))
    if "genes" not in keys:
        raise TypeError(
            f"{type(source).__name__} has no estimated genes; give the result of a calibration or a finding"
        )
    genes = [_plain(gene) for gene in _get(source, "genes")]
    if "estimates" in keys:
        return GeneRows(_of_estimates([_plain(one) for one in _get(source, "estimates")], genes, errors))
    return GeneRows([_of_gene(gene, errors) for gene in genes if gene["searched"]])


def _of_finding(finding: Mapping[str, Any]) -> GeneRows:
    genes = [gene for gene in finding["genes"] if gene["off"] is not None or "." in gene["name"]] or finding["genes"]
    rows = []
    for gene in genes:
        value, unit = gene["value"], _unit(gene["unit"])
        low, high = (end if value[key] is None else value[key] for key, end in (("low", -math.inf), ("high", math.inf)))
        point = Point(gene["name"], value["value"], low, high)
        rows.append(GeneRow(_title(gene["name"], unit, gene["description"]), unit, [point], None, gene["off"]))
    return GeneRows(rows, OF_A_FINDING)


def _of_gene(gene: Mapping[str, Any], errors: float) -> GeneRow:
    unit = _unit(gene["unit"])
    error = _error(gene)
    if error is None and gene["identifiable"] is False:
        error = math.inf  # JSON has no infinity
    point = _point("best", gene["best"], error, errors)
    bounds = (gene["lower"], gene["upper"])
    return GeneRow(_title(gene["name"], unit, gene["description"]), unit, [point], bounds, gene["nominal"])


def _of_estimates(
    estimates: Sequence[Mapping[str, Any]], genes: Sequence[Mapping[str, Any]], errors: float
) -> list[GeneRow]:
    """Return one row for each coefficient of a vehicle, with the estimate on each recording."""
    known = {gene["name"]: gene for gene in genes}
    points: dict[str, list[Point]] = {}
    for estimate in estimates:
        for name, value, error in _coefficients(estimate):
            points.setdefault(name, []).append(_point(estimate["name"], value, error, errors))
    rows = []
    for name, found in points.items():
        gene = known.get(name)
        unit = _unit(gene["unit"]) if gene else ""
        bounds = (gene["lower"], gene["upper"]) if gene else None
        title = _title(name, unit, gene["description"] if gene else "")
        rows.append(GeneRow(title, unit, found, bounds, gene["nominal"] if gene else None))
    return rows


def _coefficients(estimate: Mapping[str, Any]) -> list[tuple[str, float, float | None]]:
    if "coefficients" in estimate:  # an answer of the server
        return [(one["name"], one["value"], one["standard_error"]) for one in estimate["coefficients"]]
    return [(name, value, estimate["standard_errors"].get(name)) for name, value in estimate["values"].items()]


def _error(gene: Mapping[str, Any]) -> float | None:
    """Return the standard error of a gene in its unit; the library and the server name it differently."""
    if "absolute_error" in gene:
        return gene["absolute_error"]  # type: ignore[no-any-return]
    if gene.get("standard_error") is not None:
        return gene["standard_error"]  # type: ignore[no-any-return]
    relative = gene.get("standard_error_percent")
    return None if relative is None else abs(gene["best"]) * relative / 100


def _point(label: str, value: float, error: float | None, errors: float) -> Point:
    if error is None:
        return Point(label, value, None, None)
    return Point(label, value, value - errors * error, value + errors * error)


def _title(name: str, unit: str, description: str) -> str:
    about = f": {description}" if description else ""
    return f"{name}{f', {unit}' if unit else ''}{about}"


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def _get(source: object, name: str) -> Any:
    return source[name] if isinstance(source, Mapping) else getattr(source, name)


def _plain(one: object) -> Mapping[str, Any]:
    return one if isinstance(one, Mapping) else vars(one)
