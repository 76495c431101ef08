"""Conditions that could be recorded next: between those recorded, and a little beyond where a rig can surely go."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from wingfit.records import Condition, Recording, RigLimits
from wingfit.records.array_types import Array

MAX_BETWEEN = 32  # candidates within the recorded range
MAX_BEYOND = 16  # candidates outside of it
LEVEL_TOLERANCE = 0.05  # of the range of a variable: values nearer than that count as one setting
SLOWER = 0.8  # of the lowest flap frequency; a higher one than recorded could break a wing
WIND = (0.5, 1.5)  # of the lowest and of the highest airspeed
TILT = np.radians(20.0)  # of the least and of the largest angle of attack
AMBIENT_PA = 101_325.0  # an open chamber


def candidate_conditions(recordings: Sequence[Recording], limits: RigLimits | None = None) -> tuple[Condition, ...]:
    """Return conditions that the rigs of ``recordings`` did not run, at most MAX_BETWEEN + MAX_BEYOND, far apart.

    The first are combinations of the flap frequencies and phase lags of a rig, and their midpoints, with every air
    stream (pressure, airspeed, angle of attack). The others go beyond what was recorded: a slower beat, less and more
    wind, another angle of attack, and a chamber at ambient pressure; the user knows whether the rig allows them. Where
    ``limits`` of the rig are stated, they go up to these instead, and no condition is outside. None in free flight,
    where the vehicle and not the experimenter chooses the combinations.
    """
    stated = limits or RigLimits()
    recorded = [one.condition for one in recordings]
    between, beyond = list[Condition](), list[Condition]()
    for rig in dict.fromkeys(one.rig for one in recordings if one.rig != "free_flight"):
        ran = [one.condition for one in recordings if one.rig == rig]
        between += [one for one in _combinations(ran) if stated.allow(one)]
        beyond += [one for one in _beyond(ran, stated) if settings_beyond(one, ran) and stated.allow(one)]
    near = list(_farthest_first(between, recorded, MAX_BETWEEN))
    return (*near, *_farthest_first(beyond, [*recorded, *near], MAX_BEYOND, ran=recorded))


def settings_beyond(condition: Condition, recorded: Sequence[Condition]) -> tuple[str, ...]:
    """Return the settings of ``condition`` that lie outside of the range of all that were ``recorded``, in words."""
    names = {"flap frequency": "flap_frequency", "phase lag": "phase_lag", "pressure": "pressure",
             "airspeed": "airspeed", "angle of attack": "angle_of_attack"}  # fmt: skip
    found = list[str]()
    for words, name in names.items():
        ran, own = [getattr(one, name) for one in recorded], getattr(condition, name)
        room = 1e-9 * max(abs(own), 1.0)
        if not min(ran) - room <= own <= max(ran) + room:
            found.append(words)
    return tuple(found)


def _beyond(ran: Sequence[Condition], limits: RigLimits) -> Iterator[Condition]:
    """Yield conditions outside of those that a rig ``ran``, combined with its frequencies and lags."""
    frequencies, lags = (_levels([getattr(c, name) for c in ran]) for name in ("flap_frequency", "phase_lag"))
    others, streams = limits.flap_frequency or (SLOWER * frequencies[0],), list(_streams_beyond(ran, limits))
    for lag in dict.fromkeys((*lags, *(limits.phase_lag or ()))):
        for f, stream in product(others, _streams(ran)):
            yield replace(stream, flap_frequency=f, phase_lag=lag)
        for f, stream in product((*others, *frequencies), streams):
            yield replace(stream, flap_frequency=f, phase_lag=lag)


def _streams_beyond(ran: Sequence[Condition], limits: RigLimits) -> Iterator[Condition]:
    """Yield air streams outside of those in ``ran``."""
    blown, still = [c for c in ran if c.airspeed > 0], [c for c in ran if c.airspeed == 0]
    if blown:
        speeds, angles = ([getattr(c, name) for c in blown] for name in ("airspeed", "angle_of_attack"))
        low, high = limits.airspeed or (WIND[0] * min(speeds), WIND[1] * max(speeds))
        tilted = max(min(angles) - TILT, -np.pi / 2), min(max(angles) + TILT, np.pi / 2)
        least, most = limits.angle_of_attack or tilted
        for speed, angle in product((low, *_levels(speeds), high), (least, *_levels(angles), most)):
            yield replace(blown[0], airspeed=speed, angle_of_attack=angle)
    if still and limits.pressure:
        for pressure in limits.pressure:
            yield replace(still[0], pressure=pressure)
    elif still and max(c.pressure for c in still) < 0.5 * AMBIENT_PA:
        yield replace(still[0], pressure=AMBIENT_PA)


def _combinations(ran: Sequence[Condition]) -> Iterator[Condition]:
    """Yield all combinations of the settings in ``ran``, the recorded conditions of one rig, and their midpoints."""
    frequencies, lags = (_levels([getattr(c, name) for c in ran]) for name in ("flap_frequency", "phase_lag"))
    for f, lag, stream in product(_with_midpoints(frequencies), _with_midpoints(lags), _streams(ran)):
        yield replace(stream, flap_frequency=f, phase_lag=lag)


def _streams(ran: Sequence[Condition]) -> list[Condition]:
    """Return conditions with different streams of air, and midpoints between neighbours (of pressure: geometric)."""
    names = ("pressure", "airspeed", "angle_of_attack")
    scales = dict.fromkeys(names, float) | {"pressure": _logarithm}
    levels = {name: _levels([getattr(c, name) for c in ran], scales[name]) for name in names}
    snapped = {tuple(_nearest(levels[name], getattr(c, name)) for name in names): c for c in ran}
    streams = [replace(c, **dict(zip(names, key, strict=True))) for key, c in sorted(snapped.items())]
    streams.sort(key=lambda c: (c.airspeed, c.pressure))
    for one, other in list(pairwise(streams)):
        half = {name: 0.5 * (getattr(one, name) + getattr(other, name)) for name in names}
        streams.append(replace(one, **half | {"pressure": float(np.sqrt(one.pressure * other.pressure))}))
    return streams


def _levels(values: Sequence[float], scale: Callable[[float], float] = float) -> list[float]:
    """Return the distinct settings among ``values``; of those that are nearly equal, the middle one.

    Nearly equal are values within LEVEL_TOLERANCE of their range, or of half the largest value if that is more, both
    measured on ``scale`` (a function of the value).
    """
    ordered = sorted(values)
    low, high = scale(ordered[0]), scale(ordered[-1])
    apart = LEVEL_TOLERANCE * max(high - low, 0.5 * abs(high))
    groups = [[ordered[0]]]
    for value in ordered[1:]:
        if scale(value) - scale(groups[-1][0]) > apart:
            groups.append([])
        groups[-1].append(value)
    return [group[len(group) // 2] for group in groups]


def _logarithm(pressure: float) -> float:
    """Return the logarithm of a ``pressure`` in Pa, at least 1 Pa: lower ones do not differ."""
    return float(np.log(max(pressure, 1.0)))


def _with_midpoints(levels: Sequence[float]) -> list[float]:
    """Return ``levels`` and the midpoints between neighbours."""
    return [*levels, *(0.5 * (one + other) for one, other in pairwise(levels))]


def _nearest(levels: Sequence[float], value: float) -> float:
    return min(levels, key=lambda level: abs(level - value))


def _farthest_first(
    candidates: Sequence[Condition], taken: Sequence[Condition], most: int, ran: Sequence[Condition] | None = None
) -> Iterator[Condition]:
    """Yield up to ``most`` of ``candidates``, each the farthest from all that are ``taken`` or selected already.

    Distances are relative to the range of ``ran``, the recorded conditions; by default those taken.
    """
    if not candidates:
        return
    scale = taken if ran is None else ran
    places, known = normalised(candidates, scale), normalised(taken, scale)
    near = np.linalg.norm(places[:, None] - known[None], axis=2).min(axis=1)
    for _ in range(most):
        k = int(np.argmax(near))
        if near[k] <= LEVEL_TOLERANCE:
            return
        yield candidates[k]
        near = np.minimum(near, np.linalg.norm(places - places[k], axis=1))


def normalised(conditions: Sequence[Condition], ran: Sequence[Condition]) -> Array:
    """Return frequency, lag, log pressure, airspeed, incidence of ``conditions`` [N, 5] over their range in ``ran``."""

    def numbers(some: Sequence[Condition]) -> Array:
        rows = [(c.flap_frequency, c.phase_lag, _logarithm(c.pressure), c.airspeed, c.angle_of_attack) for c in some]
        return np.array(rows, float)

    reach = np.ptp(numbers(ran), axis=0)
    return numbers(conditions) / np.where(reach > 0, reach, 1.0)
