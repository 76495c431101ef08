"""The calibrated parameters of a rig whose simulation is the user's own function, which is given to :meth:`load`."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from wingfit.export.runtime.conditions import OutsideRangeError
from wingfit.export.runtime.intervals import covariance_of_values, standard_normal, with_covariance
from wingfit.export.runtime.parts import Calibrated

Array = npt.NDArray[np.float64]
Simulate = Callable[[Mapping[str, float], Any], Mapping[str, Any]]


@dataclass(frozen=True)
class Series:
    """Simulated channels [T] by name, in the units of the rig, and their standard errors; None if not computed."""

    channels: dict[str, Array]
    errors: dict[str, Array] | None
    remarks: tuple[str, ...]

    def interval(self, channel: str, level: float = 0.95) -> tuple[Array, Array]:
        """Return the lower and upper ends [T] of the interval of ``channel``; ValueError without standard errors."""
        half = standard_normal(level)
        if self.errors is None:
            raise ValueError("there are no standard errors: the model has no covariance, or errors=False was given")
        return self.channels[channel] - half * self.errors[channel], self.channels[channel] + half * self.errors[
            channel
        ]


@dataclass(frozen=True)
class LoadedRig:
    """The user's simulation with the calibrated parameters."""

    simulate: Simulate
    calibrated: Calibrated

    def __call__(
        self, run: Any, *, recording: str = "", values: Mapping[str, float] | None = None, errors: bool = True,
        extrapolate: bool = False,
    ) -> Series:  # fmt: skip
        """Simulate ``run``, which is passed to the user's function; its ``settings`` must lie in the fitted range.

        ``recording``: the fitted recording whose own parameters (such as an initial angle) are taken; ``values``:
        parameters by name that replace calibrated ones. OutsideRangeError outside the range, unless ``extrapolate``;
        ValueError for an unknown name or an impossible value.
        """
        outside = self._outside(getattr(run, "settings", {}))
        if outside and not extrapolate:
            raise OutsideRangeError(f"{'; '.join(outside)}: the model was not fitted there; or give extrapolate=True")
        names, base, places = self._chosen(recording, values or {})

        def simulated(batch: Array) -> Array:
            found = [self.simulate(dict(zip(names, row, strict=True)), run) for row in batch.tolist()]
            return np.array([[np.asarray(one[channel], float) for channel in found[0]] for one in found])

        channels = list(self.simulate(dict(zip(names, base.tolist(), strict=True)), run))
        uncertain, covariance = covariance_of_values(self.calibrated, places) if errors else ([], np.zeros((0, 0)))
        bounds = [self.calibrated.parameters[k] for k in places]
        whole, error = with_covariance(simulated, base, uncertain, covariance, bounds)
        parts = None if error is None else dict(zip(channels, error, strict=True))
        remarks = tuple(f"extrapolated: {one}" for one in outside)
        return Series(dict(zip(channels, whole, strict=True)), parts, remarks)

    def _chosen(self, recording: str, values: Mapping[str, float]) -> tuple[list[str], Array, list[int]]:
        """Return names and values of what the function gets, and the index of each among the parameters."""
        names, base, places, changed = list[str](), list[float](), list[int](), dict(values)
        for k, one in enumerate(self.calibrated.parameters):
            name, bracket, owner = one.name.partition("[")
            if bracket and owner != f"{recording}]":
                continue
            names.append(name)
            places.append(k)
            value = changed.pop(name, one.value)
            if not (math.isfinite(value) and one.lower <= value <= one.upper):
                raise ValueError(
                    f"parameter {name} is {value}; it must lie in [{one.lower:g}, {one.upper:g}] {one.unit}"
                )
            base.append(value)
        own = {one.name.partition("[")[0] for one in self.calibrated.parameters} - set(names)
        for name in list(changed):
            if name not in own:
                raise ValueError(f"unknown parameter {name!r}; there are {', '.join(sorted({*names, *own}))}")
            names.append(name)
            places.append(next(k for k, p in enumerate(self.calibrated.parameters) if p.name.startswith(f"{name}[")))
            base.append(changed.pop(name))
            own.remove(name)
        if own:
            known = ", ".join(one.name for one in self.calibrated.recordings)
            raise ValueError(f"give {', '.join(sorted(own))} in values, or the recording that they are of ({known})")
        return names, np.array(base, float), places

    def _outside(self, settings: Mapping[str, float]) -> list[str]:
        found = []
        for one in self.calibrated.ranges:
            value = float(settings.get(one.name, math.nan))
            slack = 1e-9 * max(abs(one.low), abs(one.high))
            if not one.low - slack <= value <= one.high + slack:
                found.append(f"setting {one.name} {value:g} is outside [{one.low:g}, {one.high:g}] {one.unit}")
        return found
