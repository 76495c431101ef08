"""Format numbers with units: millimetres, millinewtons, degrees, at most four digits."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

from wingfit.diagnosis.finding import UNCERTAIN, Finding, Hypothesis, Interval, RecordingMisfit, of_the_library

_PREFIXED = {"m", "N", "Pa", "s", "Hz", "W", "J", "N m", "N/m", "m/s"}
_PREFIXES = ((1e9, "G"), (1e6, "M"), (1e3, "k"), (1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


class Scale(NamedTuple):
    """A factor by which SI values are multiplied, and the ``unit`` of the product."""

    factor: float
    unit: str

    def text(self, value: float, digits: int = 3) -> str:
        """Return ``value`` (SI) with its unit, to ``digits`` significant digits."""
        return with_unit(number(value * self.factor, digits), self.unit)


def channel_scale(finding: Finding) -> Scale:
    """Return the scale in which misfits are shown: mm, mN or, for series, multiples of the noise."""
    if finding.unit == "noise":
        return Scale(1.0, "× noise")
    return Scale(1e3, "mm" if finding.unit == "m" else "mN")


def scale_for(values: Iterable[float | None], unit: str) -> Scale:
    """Return a scale whose prefix suits the largest of ``values``; radians become degrees, small masses grams."""
    largest = max((abs(v) for v in values if v is not None), default=0.0)
    if unit == "rad":
        return Scale(180 / math.pi, "°")
    if unit == "kg" and 0 < largest < 1:
        return Scale(1e3, "g") if largest >= 1e-3 else Scale(1e6, "mg")
    if unit not in _PREFIXED or largest == 0:
        return Scale(1.0, "" if unit == "1" else unit)
    size, prefix = next((p for p in _PREFIXES if largest >= 0.9999 * p[0]), _PREFIXES[-1])
    return Scale(1 / size, prefix + unit)


def number(value: float, digits: int = 3) -> str:
    """Return ``value`` to ``digits`` significant digits, with a true minus sign; integers up to 99999 stay whole."""
    if value == 0:
        return "0"
    power = math.floor(math.log10(abs(value)))
    if not -4 <= power < 5:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{_trimmed(mantissa)}e{int(exponent)}".replace("-", "−")
    return _trimmed(f"{value:.{max(0, digits - 1 - power)}f}").replace("-", "−")


def signed(value: float) -> str:
    """Return ``value`` as a number with its sign, also "+"."""
    return f"+{number(value)}" if value > 0 else number(value)


def share(part: float) -> str:
    """Return the fraction ``part`` as a whole percentage."""
    return with_unit(number(float(round(100 * part))), "%")


def with_unit(text: str, unit: str) -> str:
    """Return the number ``text`` and its unit, with a space between them except before °."""
    if not unit:
        return text
    return f"{text}{unit}" if unit == "°" else f"{text}\u00a0{unit}"


def percent(part: float) -> str:
    """Return the fraction ``part`` as a percentage; rounded to 0 % or 100 % only where it is exactly that."""
    value = 100 * part
    if 0 < value < 0.1:
        return "< 0.1\u00a0%"
    if 99.9 < value < 100:
        return "> 99.9\u00a0%"
    return with_unit(number(round(value, 1) if abs(value) < 10 or value > 90 else round(value), 3), "%")


def bounds(interval: Interval, scale: Scale, digits: int = 3) -> str:
    """Return the 90 % interval as text without its unit, such as "1 to 3" or "above 1"."""
    low, high = (None if v is None else number(v * scale.factor, digits) for v in (interval.low, interval.high))
    if low is None and high is None:
        return "not bounded by the data"
    if low is None:
        return f"below {high}"
    return f"above {low}" if high is None else f"{low} to {high}"


def condition(recording: RecordingMisfit) -> str:
    """Return flap frequency, phase lag, pressure and airspeed, or settings, of ``recording`` as text."""
    if recording.flap_frequency_hz is None or recording.pressure_mbar is None:
        return ", ".join(f"{name} {number(value)}" for name, value in recording.settings.items())
    parts = [f"{number(recording.flap_frequency_hz)} Hz"]
    if recording.phase_lag_deg:
        parts.append(f"lag {number(recording.phase_lag_deg)}°")
    parts.append(f"{number(recording.pressure_mbar, 4)} mbar")
    if recording.airspeed:
        parts.append(f"{number(recording.airspeed)} m/s")
    return ", ".join(parts).replace(" ", "\u00a0").replace(",\u00a0", ", ")


def shortened(text: str, letters: int) -> str:
    """Return ``text`` with at most ``letters`` characters; the middle is cut, because names differ at both ends."""
    if len(text) <= letters:
        return text
    tail = letters // 3
    return f"{text[: letters - tail - 1]}…{text[len(text) - tail :]}"


def titles_of(names: Iterable[str], finding: Finding) -> list[str]:
    """Return the display titles of the effects ``names``; for one without a hypothesis of its own, its name."""
    known = {h.effects[0]: h.title for h in finding.hypotheses if len(h.effects) == 1}
    return [known.get(name) or name.replace("_", " ").capitalize() for name in names]


def listed(items: Iterable[str], last: str = "and") -> str:
    """Return ``items`` separated by commas, with the word ``last`` before the last one."""
    words = list(items)
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}" if words else ""


def best_of(finding: Finding) -> Hypothesis | None:
    """Return the hypothesis of the "after" model, or the most probable one besides the nominal model; None if none."""
    others = [h for h in finding.hypotheses if h.effects]
    put_in = [h for h in others if set(h.effects) == set(finding.added_effects)]
    return next(iter([*put_in, *others]), None)


def stages(finding: Finding) -> dict[str, str]:
    """Return the legend texts of the models that are compared: "before" and, where effects were added, "after"."""
    if not finding.added_effects:
        return {"before": "nominal model, refitted"}
    after = "the named effects" if finding.named else "the closest of the library"  # short: titles of maps
    return {"before": "before: nominal model, refitted", "after": f"after: with {after}"}


def added_effects(finding: Finding) -> str:
    """Return what the "after" model adds: the named effects or, without any, the closest ones of the library."""
    if finding.named:
        return "the named effects"
    uncertain = of_the_library(finding.probabilities) >= UNCERTAIN
    return f"the closest effects of the library, which {'may not be the cause' if uncertain else 'do not explain it'}"


def change(finding: Finding, before: str, after: str) -> str:
    """Return both values as text, or only the first where no effect was added."""
    return f"{before} before, {after} after" if "after" in stages(finding) else before


def capital(text: str) -> str:
    """Return ``text`` with a capital first letter, the other letters unchanged."""
    return text[:1].upper() + text[1:]


def _trimmed(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text
