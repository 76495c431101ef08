"""Printed output against the output that a page shows."""

from __future__ import annotations

import difflib
import re

RELATIVE = 0.03
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?![\w.]*\d)")
# Ids and times are different each time.
CHANGING = (
    (re.compile(r"\b(ds|run|dx|key)_[0-9a-f]{16}\b"), r"\1_ID"),
    (re.compile(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d"), "TIME"),
)


def difference(shown: str, printed: str) -> str:
    """What differs, or nothing. ``...`` stands for any text within a line, or for any lines where it is alone.

    Numbers may differ by 3 %, or by one and a half units of the last digit shown; spaces may differ in number.
    """
    shown, printed = _plain(shown), _plain(printed)
    pattern, numbers = "", []
    for line in shown.splitlines():
        if line == "...":
            pattern += r"(?:.*\n)*?"
            continue
        for piece in re.split(r"(\.\.\.)", line):
            if piece == "...":
                pattern += r".*?"
                continue
            at = 0
            for match in NUMBER.finditer(piece):
                pattern += re.escape(piece[at : match.start()]) + f"({NUMBER.pattern})"
                numbers.append(match.group())
                at = match.end()
            pattern += re.escape(piece[at:])
        pattern += r"\n"
    found = re.fullmatch(pattern, printed)
    if found and all(_near(number, other) for number, other in zip(numbers, found.groups(), strict=True)):
        return ""
    return "\n".join(difflib.unified_diff(shown.splitlines(), printed.splitlines(), "shown", "printed", lineterm=""))


def _plain(text: str) -> str:
    for pattern, name in CHANGING:
        text = pattern.sub(name, text)
    lines = [re.sub(r"\s+", " ", line).strip() for line in text.strip().splitlines()]
    return "".join(f"{line}\n" for line in lines)


def _near(shown: str, printed: str) -> bool:
    digits = re.sub(r"[eE].*", "", shown)
    exponent = int(shown[len(digits) + 1 :]) if len(shown) > len(digits) else 0
    unit = 10.0 ** (exponent - len(digits.partition(".")[2]))
    return abs(float(shown) - float(printed)) <= max(1.5 * unit, RELATIVE * abs(float(shown)))
