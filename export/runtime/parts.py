"""The parts of a calibrated model that every format carries: parameters, covariance, ranges, provenance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from wingfit.records.dataset import Condition

Origin = Literal["run", "diagnosis"]
# Fields of a condition, in which a model holds within the range of its recordings, with their units.
CONDITION_UNITS: Mapping[str, str] = {
    "flap_frequency": "Hz", "phase_lag": "rad", "pressure": "Pa", "temperature": "K", "airspeed": "m/s",
    "angle_of_attack": "rad", "gravity": "m/s^2",
}  # fmt: skip


@dataclass(frozen=True)
class Parameter:
    """A gene of the model under a condition: value + per_hz f + per_rad theta, limited to [lower, upper], in ``unit``.

    f is the flap frequency (Hz), theta the angle of attack or body pitch (rad); both slopes are 0 unless the model is
    the global one of a vehicle (Armanini et al. 2016, Eq. 23). ``estimated``: whether recordings determined it.
    ``scatter``: standard deviation of the values under single conditions about this law, beyond their own errors.
    """

    name: str
    unit: str
    description: str
    value: float
    lower: float
    upper: float
    estimated: bool
    per_hz: float = 0.0
    per_rad: float = 0.0
    scatter: float = 0.0

    def at(self, condition: Condition) -> float:
        """Return the value under ``condition``, within the bounds."""
        law = self.value + self.per_hz * condition.flap_frequency + self.per_rad * condition.angle_of_attack
        return min(max(law, self.lower), self.upper)


@dataclass(frozen=True)
class Covariance:
    """Covariance [F, F] of the estimates ``names``: a parameter "C_l", or its slopes "C_l.per_hz", "C_l.per_rad".

    The unit of an entry is the product of the units of both estimates.
    """

    names: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class FittedRange:
    """From ``low`` to ``high``, in ``unit``, the fitted recordings span the field ``name`` of their conditions.

    ``name`` is one of :data:`CONDITION_UNITS` or, of any other rig, the name of a setting.
    """

    name: str
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class FittedRecording:
    """One recording to which the model was fitted; ``condition`` is None, with ``settings``, for any other rig."""

    name: str
    condition: Condition | None
    settings: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Provenance:
    """Where a model comes from.

    Attributes:
        origin: "run" or "diagnosis", with its ``id`` and ``name``.
        dataset: name of the dataset, with the SHA-256 ``dataset_sha256`` of the uploaded file ("" if unknown).
        wingfit_version: of the program that writes the model; ``commit``: of its source, "" if unknown.
        seed: of the random generators of the calibration.
        created_at: date and time of the export (RFC 3339, UTC).
        source: what the values are, such as "global model of 8 recordings".
    """

    origin: Origin
    id: str
    name: str
    dataset: str
    dataset_sha256: str
    wingfit_version: str
    commit: str
    seed: int
    created_at: str
    source: str


@dataclass(frozen=True)
class Calibrated:
    """What an exported simulation carries of its calibrated model; see wingfit's ``export.calibrated_model``.

    ``misfit`` and ``noise`` in ``misfit_unit``; None if unknown.
    """

    name: str
    parameters: tuple[Parameter, ...]
    covariance: Covariance | None
    ranges: tuple[FittedRange, ...]
    recordings: tuple[FittedRecording, ...]
    provenance: Provenance
    misfit: float | None
    noise: float | None
    misfit_unit: str
    remarks: tuple[str, ...] = ()
