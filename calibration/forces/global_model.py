"""The global model: force coefficients as functions of the flight condition (Armanini et al. 2016, Eq. 23).

Coefficients in AFFINE are affine in flap frequency f (Hz) and body pitch theta_b (rad), all others are constant:

    C_g(f, theta_b) = constant + per_hz f + per_rad theta_b.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from wingfit.calibration.forces.result import GlobalGene, GlobalModel, LocalEstimate
from wingfit.records import Condition
from wingfit.records.array_types import Array, Mask
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.atmosphere import density

AFFINE = ("C_l", "C_F")
FEWEST = 4  # conditions: as many as the coefficients of the equation, and one more to test it
FREE_FOR_SCATTER = 3  # conditions beyond the coefficients of the equation, to estimate the scatter about it
SMALL = 0.05  # of the root mean square of a coefficient: errors of smaller values are relative to this
WEATHER = 0.05  # relative difference of air density without a warning: it differs by as much from day to day
COLLINEAR = 0.99  # correlation of frequency and pitch from which their slopes cannot be separated


@dataclass(frozen=True)
class GlobalValues:
    """Coefficients under one condition, by name; ``remarks`` warn if the condition is outside those fitted."""

    values: dict[str, float]
    remarks: tuple[str, ...]


@one_blas_thread
def fit_global(
    estimates: Sequence[LocalEstimate],
    conditions: Sequence[Condition],
    affine: Sequence[str] = AFFINE,
    *,
    weighted: bool = True,
) -> GlobalModel:
    """Fit Eq. 23 to ``estimates``, each from one recording under the condition with the same index in ``conditions``.

    Coefficients named in ``affine`` vary with the condition, others are means. The fit is by least squares, each local
    coefficient weighted by 1 / (its squared standard error + the squared scatter of local coefficients about the
    equation). The scatter is chosen so that the sum of weighted squared differences equals the degrees of freedom
    (Paule and Mandel 1982); without it, a condition with many beats would dominate the fit. With fewer than
    FREE_FOR_SCATTER more conditions than coefficients, or ``weighted`` False, all weights are equal.

    ValueError if the conditions are too few, or frequency and pitch cannot be separated.
    """
    if len(estimates) != len(conditions):
        raise ValueError(f"{len(estimates)} estimates need as many conditions, got {len(conditions)}")
    frequency = np.array([condition.flap_frequency for condition in conditions])
    pitch = np.array([condition.angle_of_attack for condition in conditions])
    _refuse_untellable(frequency, pitch)
    whole = np.stack([np.ones_like(frequency), frequency, pitch], axis=1)
    names = [name for name in estimates[0].values if all(name in estimate.values for estimate in estimates)]
    return GlobalModel(
        genes=tuple(_gene(name, estimates, whole if name in affine else whole[:, :1], weighted) for name in names),
        recordings=tuple(name for estimate in estimates for name in estimate.recordings),
        conditions=tuple(conditions),
        remarks=(*_few(len(estimates)), *_untold(names, estimates)),
    )


@one_blas_thread
def at(model: GlobalModel, condition: Condition) -> GlobalValues:
    """Evaluate the coefficients of ``model`` under ``condition``, with remarks if this is an extrapolation."""
    f, pitch = condition.flap_frequency, condition.angle_of_attack
    values = {gene.name: gene.constant + gene.per_hz * f + gene.per_rad * pitch for gene in model.genes}
    return GlobalValues(values, _extrapolation(model, condition))


def average(estimates: Sequence[LocalEstimate]) -> dict[str, float]:
    """Return the mean of the local coefficients, by name: the average model of Armanini et al. 2016."""
    return {name: float(np.mean([e.values[name] for e in estimates])) for name in estimates[0].values}


def _refuse_untellable(frequency: Array, pitch: Array) -> None:
    if len(frequency) < FEWEST:
        raise ValueError(
            f"a law in flap frequency and body pitch needs at least {FEWEST} conditions, got {len(frequency)}: "
            f"calibrate on more recordings, or use the average of the coefficients"
        )
    for name, unit, x in (("flap frequency", "Hz", frequency), ("body pitch", "rad", pitch)):
        if np.ptp(x) < 1e-6 * (1 + np.abs(x).max()):
            raise ValueError(
                f"the {name} is {x[0]:.4g} {unit} in all {len(x)} conditions, so its effect is not identifiable; "
                f"add a recording at another {name}, or use the average of the coefficients"
            )
    alike = float(np.corrcoef(frequency, pitch)[0, 1])
    if abs(alike) > COLLINEAR:
        raise ValueError(
            f"flap frequency and body pitch change together (correlation {alike:.3f}; at most {COLLINEAR:g} can be "
            f"separated): add a recording with the same frequency at another pitch, or use the average"
        )


def _few(conditions: int) -> tuple[str, ...]:
    if conditions >= 3 + FREE_FOR_SCATTER:
        return ()
    return (
        f"{conditions} conditions: the law's own scatter is not known, so every condition has the same weight; "
        f"from {3 + FREE_FOR_SCATTER} on they are weighted by their standard errors",
    )


def _untold(names: Sequence[str], estimates: Sequence[LocalEstimate]) -> tuple[str, ...]:
    """Return remarks on the coefficients ``names`` whose standard error is at least their size in every condition."""
    return tuple(
        f"{name} could not be identified in any condition; its dependence on frequency and pitch is not meaningful"
        for name in names
        if all(e.standard_errors[name] >= abs(e.values[name]) for e in estimates)
    )


def _gene(name: str, estimates: Sequence[LocalEstimate], design: Array, weighted: bool) -> GlobalGene:
    """Fit the equation of the coefficient ``name`` to n local estimates.

    ``design``: columns 1, f, theta_b [n, 3] of the n conditions or, for a constant coefficient, 1 [n, 1].
    """
    local = np.array([estimate.values[name] for estimate in estimates])
    errors = np.array([estimate.standard_errors[name] for estimate in estimates])
    identified = np.isfinite(errors)
    if identified.sum() < design.shape[1]:  # not identified: keep the assumed value
        identified = np.ones_like(identified)
    coefficients, scatter = _fit(design[identified], local[identified], errors[identified], weighted)
    off = np.abs(design @ coefficients - local) / _sizes(local)
    constant, per_hz, per_rad = (*coefficients.tolist(), 0.0, 0.0)[:3]
    left_out = [_left_out(int(k), design, local, errors, identified, weighted) for k in np.flatnonzero(identified)]
    seen = [error for error in left_out if error is not None]
    return GlobalGene(
        name,
        constant,
        per_hz,
        per_rad,
        scatter,
        float(off[identified].max()),
        max(seen) if len(seen) == len(left_out) else None,
    )


def _fit(design: Array, local: Array, errors: Array, weighted: bool) -> tuple[Array, float | None]:
    """Fit a coefficient's equation to its ``local`` estimates [n], one per condition, with standard ``errors`` [n].

    Returns the k numbers of the equation [k], and the scatter of the estimates about it beyond their errors (None if it
    cannot be estimated). ``design`` [n, k] has one row for each condition.
    """
    conditions, coefficients = design.shape
    if not weighted or conditions - coefficients < FREE_FOR_SCATTER or not np.isfinite(errors).all():
        return _weighted(design, local, np.ones(conditions)), None
    scatter2 = _scatter2(design, local, errors**2)
    return _weighted(design, local, errors**2 + scatter2), float(np.sqrt(scatter2))


def _weighted(design: Array, local: Array, variance: Array) -> Array:
    root = 1 / np.sqrt(variance)
    return np.asarray(np.linalg.lstsq(design * root[:, None], local * root, rcond=None)[0])


def _scatter2(design: Array, local: Array, variance: Array) -> float:
    """Return the squared scatter with which the weighted sum of squares equals the degrees of freedom; at least 0.

    ``design`` [n, k], ``local`` estimates [n] and their ``variance`` [n] as in :func:`_fit`.
    """
    freedom = design.shape[0] - design.shape[1]
    variance = np.maximum(variance, 1e-12 * float(np.mean(local**2)))

    def surplus(scatter2: float) -> float:
        total = variance + scatter2
        left = local - design @ _weighted(design, local, total)
        return float(np.sum(left**2 / total) - freedom)

    if surplus(0.0) <= 0:
        return 0.0
    above = float(np.sum((local - local.mean()) ** 2)) + float(variance.max())
    return float(scipy.optimize.brentq(surplus, 0.0, above, xtol=1e-12 * above))


def _left_out(k: int, design: Array, local: Array, errors: Array, identified: Mask, weighted: bool) -> float | None:
    """Return the relative error, in condition ``k``, of a coefficient's equation that was fitted to the others.

    None if the other conditions do not determine it. Arguments as in :func:`_fit`; only conditions at which
    ``identified`` [n] is True are fitted.
    """
    rest = identified.copy()
    rest[k] = False
    if rest.sum() < design.shape[1] or not _independent(design[rest]):
        return None
    found, _ = _fit(design[rest], local[rest], errors[rest], weighted)
    return float(abs(design[k] @ found - local[k]) / _sizes(local)[k])


def _sizes(local: Array) -> Array:
    """Return denominators [n] of relative errors: absolute values of ``local`` [n], at least SMALL times their RMS."""
    least = SMALL * float(np.sqrt(np.mean(local**2)))
    return np.maximum(np.abs(local), least if least > 0 else 1.0)


def _independent(design: Array) -> bool:
    scaled = (design[:, 1:] - design[:, 1:].mean(axis=0)) / np.maximum(np.ptp(design[:, 1:], axis=0), 1e-300)
    values = np.linalg.svd(scaled, compute_uv=False)
    return not len(values) or bool(values[-1] > np.sqrt((1 - COLLINEAR) / 2) * values[0])


def _extrapolation(model: GlobalModel, condition: Condition) -> tuple[str, ...]:
    """Return remarks if ``condition`` lies outside those to which ``model`` was fitted.

    Flap frequency, pitch, airspeed and air density are checked one by one; the last two are not in Eq. 23, but its
    coefficients hold only near the fitted ones. Frequency and pitch are also checked together, by the leverage
    x^T (X^T X)^-1 x: its largest value among the fitted conditions bounds an ellipse around them (hidden extrapolation:
    Montgomery, Peck and Vining 2012, section 3.8).
    """
    f, pitch = condition.flap_frequency, condition.angle_of_attack
    remarks = [
        *_outside("flap frequency", "Hz", f, model.frequency_range),
        *_outside("body pitch", "deg", pitch, model.pitch_range, scale=180 / np.pi),
    ]
    if not remarks and _leverage(model, f, pitch) > 1 + 1e-9:
        remarks.append(
            f"flap frequency {f:.4g} Hz and body pitch {np.degrees(pitch):.4g} deg are each within what was fitted, "
            f"but no fitted condition combines them like that: an extrapolation"
        )
    rho = density(condition.pressure, condition.temperature)
    remarks += _outside("airspeed", "m/s", condition.airspeed, model.airspeed_range)
    remarks += _outside("air density", "kg/m^3", rho, model.density_range, slack=WEATHER)
    return tuple(remarks)


def _outside(
    name: str, unit: str, value: float, fitted: tuple[float, float], *, scale: float = 1.0, slack: float = 0.0
) -> list[str]:
    """Return a remark if ``value`` is outside the range ``fitted``, widened by the fraction ``slack``; else [].

    ``value`` and ``fitted``, times ``scale``, are in ``unit``.
    """
    low, high = fitted
    if low * (1 - slack) - 1e-9 <= value <= high * (1 + slack) + 1e-9:
        return []
    return [
        f"{name} {scale * value:.4g} {unit} is outside [{scale * low:.4g}, {scale * high:.4g}] {unit}, "
        f"where the coefficients were fitted: an extrapolation"
    ]


def _leverage(model: GlobalModel, f: float, pitch: float) -> float:
    """Return the leverage of frequency ``f`` (Hz) and ``pitch`` (rad), relative to the largest fitted one."""
    conditions = np.array([[c.flap_frequency, c.angle_of_attack] for c in model.conditions])
    centre, spread = conditions.mean(axis=0), conditions.std(axis=0)
    fitted = (conditions - centre) / spread
    inner = np.linalg.inv(fitted.T @ fitted)
    x = (np.array([f, pitch]) - centre) / spread
    largest = float(np.einsum("ni,ij,nj->n", fitted, inner, fitted).max())
    return float(x @ inner @ x) / largest
