"""The result of a calibration on forces: coefficients for each condition, a global model, how well each fits.

Plain data in SI units, forces in N, which are computed in :mod:`wingfit.calibration.forces.estimation` and
:mod:`wingfit.calibration.forces.agreement`. A source says whose coefficients a model has: the nominal ones, those
fitted to one recording ("local") or to several together ("joint"), those of the global model, or the "average" of the
local ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from wingfit.calibration.result import GeneResult
from wingfit.records import Condition
from wingfit.records.array_types import Array
from wingfit.sim.atmosphere import density

Source = Literal["nominal", "local", "joint", "global", "average"]
Quantity = Literal["lift", "drag", "x", "z"]


@dataclass(frozen=True)
class LocalEstimate:
    """Maximum-likelihood estimate on one recording, or on several together (Armanini et al. 2016, Eq. 22).

    ``name`` is that of the stage, ``values`` are the F free genes by name. ``standard_errors`` (in the units of the
    values) are Cramer-Rao bounds that account for coloured residuals; ``correlation`` [F, F] is in the order of
    ``values``. ``noise`` is the estimated covariance R (N^2) of the axes, one matrix per recording, with variance 1 for
    an axis that is not fitted; ``cost`` is J of Eq. 22 at the values. ``remarks`` name genes that are not identifiable.
    """

    name: str
    recordings: tuple[str, ...]
    values: Mapping[str, float]
    standard_errors: Mapping[str, float]
    correlation: tuple[tuple[float, ...], ...]
    noise: tuple[tuple[tuple[float, ...], ...], ...]
    cost: float
    converged: bool
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class GlobalGene:
    """One coefficient as a function of the condition (Eq. 23): constant + per_hz f + per_rad theta_b.

    f is the flap frequency (Hz), theta_b the body pitch (rad); the slopes of a constant coefficient are 0.

    Attributes:
        scatter: standard deviation of the local coefficients about this function beyond their standard errors; None if
            the conditions are too few, and all have the same weight.
        largest_error: largest relative difference from a local estimate.
        left_out_error: largest relative difference from a local estimate that was left out of the fit; None with too
            few conditions.
    """

    name: str
    constant: float
    per_hz: float
    per_rad: float
    scatter: float | None
    largest_error: float
    left_out_error: float | None


@dataclass(frozen=True)
class GlobalModel:
    """Coefficients as functions of flap frequency and body pitch, and the conditions to which they were fitted.

    ``recordings`` are the names of the fitted recordings, ``conditions`` those under which they were made.
    """

    genes: tuple[GlobalGene, ...]
    recordings: tuple[str, ...]
    conditions: tuple[Condition, ...]
    remarks: tuple[str, ...] = ()

    @property
    def frequency_range(self) -> tuple[float, float]:
        """Smallest and largest flap frequency, Hz."""
        return _range([c.flap_frequency for c in self.conditions])

    @property
    def pitch_range(self) -> tuple[float, float]:
        """Smallest and largest body pitch, rad."""
        return _range([c.angle_of_attack for c in self.conditions])

    @property
    def airspeed_range(self) -> tuple[float, float]:
        """Smallest and largest airspeed, m/s."""
        return _range([c.airspeed for c in self.conditions])

    @property
    def density_range(self) -> tuple[float, float]:
        """Smallest and largest density of the air, kg/m^3."""
        return _range([density(c.pressure, c.temperature) for c in self.conditions])


def _range(values: list[float]) -> tuple[float, float]:
    return min(values), max(values)


@dataclass(frozen=True)
class Agreement:
    """How one model (``source``) agrees with one recording in one quantity; forces in N.

    RMS difference ``rmse`` and Pearson's correlation are over all samples of the whole beats; ``rmse_percent`` is
    relative to the range (largest minus smallest) of the recorded mean beat; means are over whole beats. For a constant
    force, percentage and correlation are NaN.
    """

    recording: str
    source: Source
    quantity: Quantity
    rmse: float
    rmse_percent: float
    correlation: float
    mean_recorded: float
    mean_modelled: float


@dataclass(frozen=True)
class ForceResult:
    """Outcome of a calibration on forces.

    ``left_out`` has, for each fitted recording, agreements of a global model that was fitted without it. ``held_out``
    names the recordings that were never fitted. ``before`` (nominal genome) and ``after`` are RMS differences in N of
    the fitted axes on the fitted recordings, ``held_out_before`` and ``held_out_after`` on the held-out ones (or None).
    ``noise`` is the RMS, over all recordings, of what differs from beat to beat on these axes; None with too few beats.
    """

    genes: tuple[GeneResult, ...]
    estimates: tuple[LocalEstimate, ...]
    global_model: GlobalModel | None
    agreements: tuple[Agreement, ...]
    left_out: tuple[Agreement, ...]
    held_out: tuple[str, ...]
    before: float
    after: float
    held_out_before: float | None
    held_out_after: float | None
    noise: float | None = None
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class ForceComparison:
    """Recorded and modelled forces of one recording over the beat, and their power spectra.

    ``phase`` [n] is t*, the time in beats, in [0, 1); ``recorded`` and ``modelled`` are the mean beats [n] in N, by
    quantity; ``spread`` [n] is the standard deviation (N) between recorded beats. ``frequency`` [m] in Hz; spectra [m]
    in N^2/Hz, by quantity.
    """

    recording: str
    source: Source
    phase: Array
    recorded: Mapping[Quantity, Array]
    spread: Mapping[Quantity, Array]
    modelled: Mapping[Quantity, Array]
    frequency: Array
    recorded_spectrum: Mapping[Quantity, Array]
    modelled_spectrum: Mapping[Quantity, Array]
    remarks: tuple[str, ...] = ()
