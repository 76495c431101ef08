"""Checks the numbers of a recording: order of times, number of samples, plausible units."""

from __future__ import annotations

import numpy as np

from wingfit.records import limits
from wingfit.records.array_types import Array, Float
from wingfit.records.dataset import STANDARD_GRAVITY, Recording
from wingfit.records.errors import Faults
from wingfit.records.series_checks import SHOWN, Locate, check_times
from wingfit.records.vehicle import Vehicle
from wingfit.records.wing import Wing

ABSURD = 1e6  # weights: in no unit is the weight so large a number


def check_numbers(
    recording: Recording, rig: Wing | Vehicle, where: str, at: Locate, faults: Faults, *, plausible: bool = True
) -> None:
    """Add a fault for each error in the times and values of ``recording``, a recording of ``rig``.

    In messages, ``where`` is the place of the recording and ``at(row)`` that of one row. ``plausible``: also check
    units and sampling; without it, only what nothing can be computed with.
    """
    times, values, frames = recording.times, recording.values, len(recording.times)
    quantity = "force" if isinstance(rig, Vehicle) else "position"
    check_frames(frames, where, faults)
    markers = len(recording.markers)
    if isinstance(rig, Wing) and not 1 <= markers <= limits.MAX_MARKERS:
        faults.add(where, markers, f"{markers} markers; it must be 1 to {limits.MAX_MARKERS}: add or remove some")
    increasing = check_times(times, at, faults)
    infinite = np.flatnonzero(np.isinf(values).any(axis=1))
    for row in infinite[:SHOWN]:
        faults.add(at(int(row)), "inf", f"a {quantity} is infinite; it must be finite, or missing")
    if infinite.size or not values.size:
        return
    if np.isnan(values).all():
        faults.add(where, None, f"there is no {quantity} at all; leave the recording out")
        return
    if not plausible:
        return
    if isinstance(rig, Wing):
        _check_positions(values, recording.markers, rig, where, faults)
    else:
        _check_forces(recording, rig, where, faults)
        if increasing and frames >= limits.MIN_FRAMES:
            _check_clock(recording, where, at, faults)


def check_frames(frames: int, where: str, faults: Faults, what: str = "frames") -> None:
    """Add a fault if a recording has too few or too many ``frames``, called ``what`` in the message."""
    if not limits.MIN_FRAMES <= frames <= limits.MAX_ROWS:
        message = f"{frames} {what}; it must be {limits.MIN_FRAMES} to {limits.MAX_ROWS}: record longer, or split it"
        faults.add(where, frames, message)


def _check_positions(
    values: Float[Array, "T C"], markers: tuple[str, ...], wing: Wing, where: str, faults: Faults
) -> None:
    """Add faults for markers farther than ``IMPLAUSIBLE_SPANS`` from the hinge: unit or frame are likely wrong."""
    hinge = (0.0, wing.hinge.y, wing.hinge.z)
    distance = _typical(values, hinge)
    limit = limits.IMPLAUSIBLE_SPANS * wing.span
    if distance > limit:
        far = distance / wing.span
        elsewhere = "feet, or a frame whose origin is elsewhere,"
        unit = "millimetres" if far > 100 else "centimetres" if far > 10 else elsewhere
        message = (
            f"positions are typically {distance:.4g} m from the hinge, of a wing with {wing.span:.4g} m span (limit "
            f"{limit:.4g} m); that looks like {unit} in columns named _m: convert to metres, in the wing frame"
        )
        faults.add(where, f"{distance:.4g}", message)
        return
    each = np.array([_typical(values[:, 3 * k : 3 * k + 3], hinge) for k in range(len(markers))])
    for k in np.flatnonzero(each > limit)[:SHOWN]:
        message = (
            f"marker {markers[k]} is typically {each[k]:.4g} m from the hinge, the others {distance:.4g} m (limit "
            f"{limit:.4g} m): convert it to metres, in the wing frame, or leave it out"
        )
        faults.add(where, f"{each[k]:.4g}", message)


def _typical(values: Float[Array, "T C"], hinge: tuple[float, float, float]) -> float:
    """Return the largest of three median distances (m) of ``values`` [T, 3 M] from ``hinge``: along x, y and z.

    0 if there are no values. The axes are treated one after the other, to save memory.
    """
    return max(_median_distance(values[:, axis::3], hinge[axis]) for axis in range(3))


def _median_distance(places: Float[Array, "T M"], origin: float) -> float:
    distances = np.abs(places - origin)
    known = distances[np.isfinite(distances)]
    return float(np.median(known, overwrite_input=True)) if known.size else 0.0


def _check_forces(recording: Recording, vehicle: Vehicle, where: str, faults: Faults) -> None:
    """Add a fault for forces far larger or smaller than the vehicle's weight: their unit is likely to be wrong.

    The axis with the larger RMS force is compared; the force along the other axis may be zero.
    """
    sizes = {}
    for name, axis in zip(recording.forces, recording.values.T, strict=True):
        found = axis[np.isfinite(axis)]
        if not found.size:
            faults.add(where, None, f"force_{name}_n has no value at all; remove the column")
            continue
        most = float(np.abs(found).max())  # squares of huge values would overflow
        sizes[f"force_{name}_n"] = most * float(np.sqrt(np.mean((found / (most or 1.0)) ** 2)))
    if not any(sizes.values()):
        which = " and ".join(sizes) + (" are" if len(sizes) > 1 else " is")
        faults.add(where, 0.0, f"{which} zero throughout; check the channel, or leave the recording out")
        return
    weight = STANDARD_GRAVITY * (vehicle.mass if recording.mass is None else recording.mass)
    largest, force = max(sizes.items(), key=lambda item: item[1])
    low, high = limits.NEGLIGIBLE_WEIGHTS * weight, limits.IMPLAUSIBLE_WEIGHTS * weight
    if not low <= force <= high:
        message = (
            f"{largest} is typically {force:.4g} N (root mean square), of a vehicle that weighs {weight:.4g} N; it "
            f"must lie in [{low:.4g}, {high:.4g}] N; that looks like {_unit(force / weight)} in columns named _n: "
            "convert to newtons, or check mass_kg"
        )
        faults.add(where, f"{force:.4g}", message)


def _unit(weights: float) -> str:
    """Name the likely unit of a force that, if its numbers are newtons, is ``weights`` times the vehicle's weight.

    In the right unit, the force is about as large as the weight.
    """
    if weights < 1:
        return "a much larger unit"
    if weights > ABSURD:
        return "no unit of force"
    gram_force, millinewtons = 1000 / STANDARD_GRAVITY, 1000.0  # in a newton
    halfway = np.sqrt(gram_force * millinewtons)
    return "gram-force (1 gf = 0.00980665 N)" if weights < halfway else "millinewtons (1 mN = 0.001 N)"


def _check_clock(recording: Recording, where: str, at: Locate, faults: Faults) -> None:
    """Add faults for uneven steps in time, less than a beat, too few samples per beat, or an impossible low-pass."""
    times, frequency, low_pass = recording.times, recording.condition.flap_frequency, recording.low_pass
    steps = np.diff(times)
    step = float(np.median(steps))
    uneven = np.flatnonzero(np.abs(steps - step) > limits.UNEVEN_STEPS * step) + 1
    for row in uneven[:SHOWN]:
        message = (
            f"time_s is {steps[row - 1]:.6g} s after the one above, typically {step:.6g} s; steps must be equal within "
            f"{100 * limits.UNEVEN_STEPS:g} %: write times with more digits, give lost samples a row with empty cells, "
            "or resample to an even clock"
        )
        faults.add(at(int(row)), float(times[row]), message)
    beats = frequency * float(times[-1] - times[0] + 1.5 * step)
    if beats < 1.0:
        message = (
            f"the times cover {frequency * (times[-1] - times[0] + step):.2f} beats of {1 / frequency:.4g} s; at least "
            "one whole beat is needed (two or more are better): record longer, or check flap_frequency_hz and time_s"
        )
        faults.add(where, None, message)
    if step * frequency * limits.MIN_SAMPLES_PER_BEAT > 1.0 + limits.UNEVEN_STEPS:
        message = (
            f"the sampling rate is {1 / step:.4g} Hz, {1 / (step * frequency):.3g} samples in a beat of "
            f"{1 / frequency:.4g} s; at least {limits.MIN_SAMPLES_PER_BEAT} are needed: give time_s in seconds, not "
            "milliseconds, check flap_frequency_hz, or record faster"
        )
        faults.add(where, f"{1 / step:.4g}", message)
    if low_pass is not None and low_pass.cutoff < frequency:
        message = (
            f"low_pass.cutoff_hz is {low_pass.cutoff:g} Hz, below the flap frequency, {frequency:g} Hz: such a "
            "filter removes the beat; check both, filter less, or omit low_pass if the values are not filtered"
        )
        faults.add(where, low_pass.cutoff, message)
    if low_pass is not None and low_pass.cutoff >= 0.5 / step:
        rule = f"it must be below half the sampling rate, {0.5 / step:.6g} Hz: check both, or omit low_pass"
        faults.add(where, low_pass.cutoff, f"low_pass.cutoff_hz is {low_pass.cutoff:g} Hz; {rule}")
