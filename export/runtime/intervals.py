"""Intervals of predictions from the covariance of the parameters: the delta method.

The standard error of a prediction y is sqrt(g^T S g), with the covariance S of the estimates and the derivatives g of y
with respect to them, by central differences; an interval of 95 % is y +- 1.96 standard errors. It contains what the
uncertain parameters change, but neither the noise of an instrument nor physics that the model does not have.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from wingfit.export.runtime.parts import Calibrated, Parameter
from wingfit.records.dataset import Condition

Array = npt.NDArray[np.float64]
STEP = 0.1  # of a standard error: of a finite difference
LARGEST_STEP = 1e-3  # of the range between the bounds


def standard_normal(level: float) -> float:
    """Return half the width of an interval of probability ``level`` in standard errors; ValueError outside (0, 1)."""
    if not 0.0 < level < 1.0:
        raise ValueError(f"level is {level:g}; it must lie between 0 and 1, such as 0.95")
    return NormalDist().inv_cdf(0.5 + level / 2)


def gene_covariance(calibrated: Calibrated, condition: Condition) -> tuple[list[int], Array]:
    """Return the indices [F] of the uncertain parameters, and the covariance [F, F] of their values at ``condition``.

    The scatter of single conditions about a law is part of it.
    """
    known = calibrated.covariance
    if known is None:
        return [], np.zeros((0, 0))
    factor = {"": 1.0, ".per_hz": condition.flap_frequency, ".per_rad": condition.angle_of_attack}
    places = [k for k, one in enumerate(calibrated.parameters) if one.name in known.names]
    to_values = np.zeros((len(places), len(known.names)))
    for row, k in enumerate(places):
        for ending, weight in factor.items():
            name = calibrated.parameters[k].name + ending
            if name in known.names:
                to_values[row, known.names.index(name)] = weight
    matrix = np.array(known.matrix)
    scatter = np.diag([calibrated.parameters[k].scatter ** 2 for k in places])
    return places, np.asarray(to_values @ matrix @ to_values.T + scatter)


def covariance_of_values(calibrated: Calibrated, places: Sequence[int]) -> tuple[list[int], Array]:
    """Return the indices [F] in ``places`` of the uncertain parameters, and the covariance [F, F] of their values.

    ``places``: indices of parameters. For models without slopes.
    """
    known = calibrated.covariance
    if known is None:
        return [], np.zeros((0, 0))
    names = [calibrated.parameters[k].name for k in places]
    uncertain = [k for k, name in enumerate(names) if name in known.names]
    rows = [known.names.index(names[k]) for k in uncertain]
    return uncertain, np.array(known.matrix)[np.ix_(rows, rows)]


def with_errors(
    simulate: Callable[[Array], Array], calibrated: Calibrated, condition: Condition, genome: npt.ArrayLike
) -> tuple[Array, Array | None]:
    """Return ``simulate`` at ``genome`` [G] under a condition, and standard errors; as :func:`with_covariance`."""
    places, covariance = gene_covariance(calibrated, condition)
    bounds = calibrated.parameters
    return with_covariance(simulate, np.asarray(genome, float), places, covariance, bounds)


def with_covariance(
    simulate: Callable[[Array], Array], base: Array, places: Sequence[int], covariance: Array,
    parameters: Sequence[Parameter],
) -> tuple[Array, Array | None]:  # fmt: skip
    """Return ``simulate`` at ``base`` [G], and the standard errors of its numbers; None if nothing is uncertain.

    ``simulate`` returns an array [B, ...] for genomes [B, G]; the parts of the answer have its shape without B.
    ``covariance`` [F, F] is that of the values at ``places`` [F]; ``parameters`` [G] have the bounds.
    """
    if not len(places):
        return simulate(base[None])[0], None
    steps = [
        _steps(parameters[k], float(base[k]), float(np.sqrt(covariance[row, row]))) for row, k in enumerate(places)
    ]
    batch = np.tile(base, (1 + 2 * len(places), 1))
    for row, (k, (down, up)) in enumerate(zip(places, steps, strict=True)):
        batch[1 + 2 * row, k], batch[2 + 2 * row, k] = base[k] - down, base[k] + up
    found = simulate(batch)
    widths = np.array([down + up for down, up in steps])
    slopes = (found[2::2] - found[1::2]) / np.maximum(widths, 1e-300).reshape(-1, *[1] * (found.ndim - 1))
    slopes[widths == 0.0] = 0.0
    variance = np.einsum("f...,fg,g...->...", slopes, covariance, slopes)
    return found[0], np.sqrt(np.maximum(variance, 0.0))


def _steps(parameter: Parameter, value: float, error: float) -> tuple[float, float]:
    """Return how far a finite difference moves down and up, within the bounds of the parameter."""
    step = min(STEP * error, LARGEST_STEP * (parameter.upper - parameter.lower))
    return min(step, value - parameter.lower), min(step, parameter.upper - value)
