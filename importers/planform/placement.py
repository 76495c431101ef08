"""Where the statements of the file and those of the user meet: scale, sides, origin."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.importers.options import UNITS
from wingfit.importers.planform.options import PAGE, SIDES, OutlineOptions
from wingfit.importers.planform.shapes import Drawn, Fact
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import Faults, fail

_AGREES = 0.01  # relative difference of a stated span from that of the file, at most
_HOW = "give the unit (--unit mm), the scale (--mm-per-unit 0.26), or the length from root to tip (--span-mm 210)"
MAX_SIZE, MIN_SIZE = 5.0, 1e-4  # m


@dataclass(frozen=True)
class Placement:
    """How the file lies in the wing: x_wing = aft_sign (p[aft] - zero[aft]) metres, y_wing with ``out`` likewise.

    ``out`` and ``aft`` are the coordinates (0 or 1) of the file along the span and the chord.
    """

    out: int
    out_sign: int
    aft: int
    aft_sign: int
    metres: float
    zero: tuple[float, float]

    def apply(self, points: Float[Array, "N 2"]) -> Float[Array, "N 2"]:
        """Return ``points`` of the file as x (aft), y (outboard) in the wing, m."""
        moved = (points - np.array(self.zero)) * self.metres
        return np.column_stack([self.aft_sign * moved[:, self.aft], self.out_sign * moved[:, self.out]])


def place(
    points: Float[Array, "N 2"], drawn: Drawn, options: OutlineOptions, file: str
) -> tuple[Placement, list[Fact]]:
    """Return how the outline ``points`` of the file lies in the wing, and who stated it.

    y is 0 at the root end of the outline and x at the point of the leading edge there, unless ``options.origin`` says
    where. DatasetError lists all options that are missing or contradict the file.
    """
    faults, facts = Faults(), list[Fact]()
    root = _side("--root", options.root, drawn, "the root", facts, faults)
    leading = _side("--leading-edge", options.leading_edge, drawn, "the leading edge", facts, faults)
    if root and leading and root[-1] == leading[-1]:
        message = f"is {options.leading_edge}, and the root is {options.root}; these must be at right angles"
        faults.add("--leading-edge", options.leading_edge, message)
    if options.hinge_mm is None:
        message = (
            "the flapping axis is not stated; give its distance inboard of the root end of the outline: --hinge-mm 20 "
            "(below 0 if the axis lies outboard of it)"
        )
        faults.add(file, None, message)
    span = float(np.ptp(points[:, "xy".index(root[-1])])) if root else None
    metres = _metres(drawn, options, span, file, facts, faults)
    faults.raise_any()
    if root is None or leading is None or metres is None:
        raise fail(file, None, "scale and sides are missing")
    out, aft = "xy".index(root[-1]), "xy".index(leading[-1])
    signs = (1 if root.startswith("low") else -1, 1 if leading.startswith("low") else -1)
    zero = options.origin or _corner(points, out, signs[0], aft, signs[1])
    _check_size(points, metres, file)
    if options.origin:
        facts.append(Fact("origin", f"{zero[0]:g}, {zero[1]:g} in the file", "user", "--origin"))
    else:
        facts.append(Fact("origin", "y = 0 at the root end, x = 0 at its leading edge", "convention", "--origin"))
    return Placement(out, signs[0], aft, signs[1], metres, zero), facts


def _side(option: str, side: str | None, drawn: Drawn, what: str, facts: list[Fact], faults: Faults) -> str | None:
    """Return the side as low-x, high-x, low-y or high-y; add a fault if it is not stated or means nothing here."""
    if option == "--leading-edge" and drawn.aft:
        found = "low-x" if drawn.aft == "high-x" else "high-x"
        facts.append(Fact("leading edge", found, "file", "columns of the stations"))
        if side is not None and side != found:
            faults.add(option, side, f"is {side}, but the columns of the stations say {found}; leave it out")
        return found
    sides = "left, right, top or bottom" if drawn.y_up is not None else "low-x, high-x, low-y or high-y"
    if drawn.aft:
        sides = "low-y or high-y (y: span)"
    if side is None:
        faults.add(option, None, f"the side of {what} is not stated; give it: {option} ({sides})")
        return None
    if side in SIDES:
        found = SIDES[side]
    elif drawn.y_up is None:
        faults.add(option, side, f"is {side}, but a table does not say where y points; give low-y or high-y")
        return None
    else:
        found = "high-y" if (side == "top") == drawn.y_up else "low-y"
    if drawn.aft and found[-1] == "x":
        faults.add(option, side, f"is {side}; for stations the root is at low-y or high-y (y: span)")
        return None
    facts.append(Fact(what.removeprefix("the "), side, "user", option))
    return found


def _metres(
    drawn: Drawn, options: OutlineOptions, span: float | None, file: str, facts: list[Fact], faults: Faults
) -> float | None:
    """Return the metres per unit of the file; add a fault if nobody states them or if statements contradict."""
    given = _given_metres(drawn, options, span, file, facts, faults)
    if drawn.unit is None:
        if given is None and not any(value is not None for value in options.scales.values()):
            page = (
                f"; on the page a unit is {drawn.page.text}: if that is the real size, --unit page"
                if drawn.page
                else ""
            )
            faults.add(file, None, f"states no scale; {_HOW}{page}")
        return given
    if given is not None and abs(given / drawn.unit.metres - 1) > _AGREES:
        option = next(option for option, value in options.scales.items() if value is not None)
        message = (
            f"makes a unit of the file {given * 1e3:.4g} mm, but the file states {drawn.unit.text} "
            f"({drawn.unit.where}); leave it out, or correct the file"
        )
        faults.add(option, options.scales[option], message)
    facts[:] = [fact for fact in facts if fact.fact != "scale"]
    facts.append(Fact("scale", drawn.unit.text, "file", drawn.unit.where))
    return drawn.unit.metres


def _given_metres(
    drawn: Drawn, options: OutlineOptions, span: float | None, file: str, facts: list[Fact], faults: Faults
) -> float | None:
    if options.unit == PAGE:
        if drawn.page is None:
            message = f"{file} states no size of its page in mm, cm, in or pt (width, height, viewBox); {_HOW}"
            faults.add("--unit", PAGE, message)
            return None
        facts.append(Fact("scale", f"{drawn.page.text} per unit", "user", "--unit page"))
        return drawn.page.metres
    if options.unit is not None:
        facts.append(Fact("scale", options.unit, "user", "--unit"))
        return UNITS[options.unit][0] / UNITS[options.unit][1]
    if options.mm_per_unit is not None:
        facts.append(Fact("scale", f"{options.mm_per_unit:g} mm per unit", "user", "--mm-per-unit"))
        return options.mm_per_unit * 1e-3
    if options.span_mm is None or not span:
        return None
    facts.append(Fact("scale", f"{options.span_mm:g} mm from root end to tip", "user", "--span-mm"))
    return options.span_mm * 1e-3 / span


def _corner(points: Float[Array, "N 2"], out: int, out_sign: int, aft: int, aft_sign: int) -> tuple[float, float]:
    """Return the foremost of the innermost points of the outline: the leading edge at the root end."""
    inboard = out_sign * points[:, out]
    innermost = points[inboard <= inboard.min() + 1e-9 * np.ptp(inboard)]
    corner = innermost[np.argmin(aft_sign * innermost[:, aft])]
    return float(corner[0]), float(corner[1])


def _check_size(points: Float[Array, "N 2"], metres: float, file: str) -> None:
    size = float(np.ptp(points, axis=0).max()) * metres
    if not MIN_SIZE * 5 <= size <= MAX_SIZE:
        message = (
            f"the outline is {size:.3g} m long; it must lie in [{MIN_SIZE * 5:g}, {MAX_SIZE:g}] m: check the scale "
            f"({metres * 1e3:.4g} mm per unit of the file)"
        )
        raise fail(file, size, message)
