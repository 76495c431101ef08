"""The command line of an exported model: one prediction as JSON or CSV."""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Callable, Sequence
from typing import Any

from wingfit.export.runtime.conditions import SETTINGS
from wingfit.export.runtime.parts import Calibrated

Predict = Callable[..., Any]


def run(calibrated: Calibrated, predict: Predict, arguments: Sequence[str] | None = None) -> int:
    """Print the prediction that the ``arguments`` describe, and return the exit status; errors go to stderr.

    ``predict`` takes a condition by keyword, ``extrapolate`` and ``errors``; its answer has ``condition``, ``remarks``,
    ``means()`` and ``columns()``.
    """
    options = vars(_parser(calibrated).parse_args(arguments))
    if options.pop("about"):
        print(json.dumps(about(calibrated), indent=2))
        return 0
    as_csv, level, beat = options.pop("csv"), options.pop("level"), options.pop("beat")
    errors, extrapolate = not options.pop("no_intervals"), options.pop("extrapolate")
    try:
        found = predict(**options, extrapolate=extrapolate, errors=errors)
        means, columns = found.means(level), found.columns(level)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if as_csv:
        writer = csv.writer(sys.stdout)
        writer.writerow(columns)
        writer.writerows(zip(*(column.tolist() for column in columns.values()), strict=True))
        return 0
    answer = {"condition": found.condition, "level": level, **means, "remarks": list(found.remarks)}
    if beat:
        answer["beat"] = {name: column.tolist() for name, column in columns.items()}
    print(json.dumps(answer, indent=2))
    return 0


def about(calibrated: Calibrated) -> dict[str, Any]:
    """Return what the model is, where it holds, and where it comes from."""
    source = calibrated.provenance
    return {
        "name": calibrated.name,
        "provenance": {name: getattr(source, name) for name in source.__dataclass_fields__},
        "misfit": calibrated.misfit,
        "noise": calibrated.noise,
        "unit": calibrated.misfit_unit,
        "fitted_range": {f"{one.name} ({one.unit})": [one.low, one.high] for one in calibrated.ranges},
        "recordings": [one.name for one in calibrated.recordings],
        "parameters": {one.name: {"value": one.value, "unit": one.unit} for one in calibrated.parameters},
        "has_intervals": calibrated.covariance is not None,
        "remarks": list(calibrated.remarks),
    }


def _parser(calibrated: Calibrated) -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=f"Predict with the calibrated model of {calibrated.name!r}. A setting that is left out is the mean "
        "of the fitted recordings. Outside their range the model refuses, unless --extrapolate is given."
    )
    ranges = {one.name: one for one in calibrated.ranges}
    for one in SETTINGS:
        names = [_flag(one.name)] + (["--body-pitch"] if one.field == "angle_of_attack" else [])
        known = ranges.get(one.field)
        where = ""
        if known is not None:
            ends = ((end - one.offset) / one.factor for end in (known.low, known.high))
            where = "; fitted from {:.6g} to {:.6g}".format(*ends)
        parser.add_argument(
            *names, dest=one.name, type=float, metavar=one.unit.upper().replace(" ", "-"),
            help=f"{one.meaning}, {one.unit}{where}",
        )  # fmt: skip
    parser.add_argument("--extrapolate", action="store_true", help="answer outside the fitted range too")
    parser.add_argument("--level", type=float, default=0.95, help="probability of the intervals (0.95)")
    parser.add_argument("--no-intervals", action="store_true", help="omit the intervals, which take most of the time")
    parser.add_argument("--beat", action="store_true", help="add the series over the beat to the JSON")
    parser.add_argument("--csv", action="store_true", help="print the series over the beat as CSV instead of JSON")
    parser.add_argument("--about", action="store_true", help="print what the model is and where it holds")
    return parser


def _flag(name: str) -> str:
    """Return the option of the setting ``name``, without its unit: flap_frequency_hz becomes --flap-frequency."""
    for ending in ("_hz", "_m_s", "_deg", "_mbar", "_c"):
        if name.endswith(ending):
            return "--" + name.removesuffix(ending).replace("_", "-")
    raise ValueError(f"setting {name!r} has no unit in its name")
