"""Tables of a calibrated model over the fitted range of conditions: cycle means, and series over the beat.

Levels of flap frequency, airspeed, angle of attack and phase lag are combined; pressure and temperature are those of
most air. Combinations that were never recorded together lie inside the ranges, but far from any recording.
"""

from __future__ import annotations

import csv
import io
import json
from itertools import product
from typing import Any

import numpy as np

from wingfit.export.calibrated_model import CalibratedModel
from wingfit.export.predict import predictor
from wingfit.export.runtime.command_line import about
from wingfit.export.runtime.conditions import SETTINGS
from wingfit.records import Wing

LEVEL = 0.95
VARIED = ("flap_frequency", "airspeed", "angle_of_attack", "phase_lag")
# Levels of each field that varies, and conditions in all: a wing is simulated for every parameter.
LEVELS, MOST = {True: 3, False: 5}, {True: 24, False: 128}
SERIES = 64  # instants of a beat at most

Row = dict[str, Any]


def tables(model: CalibratedModel) -> dict[str, str]:
    """Return the files of the tables by name: means.csv, beats.csv, tables.json.

    Names of columns end in the unit; ends of 95 % intervals are called low and high, and are absent without a
    covariance. ValueError for a rig with a simulation of the user's own.
    """
    own, means, beats, failed = predictor(model), list[Row](), list[Row](), list[Row]()
    for where in grid(model):
        try:
            found = own.forces(**where)
        except ValueError as error:
            failed.append({**where, "reason": str(error)})
            continue
        means.append({**found.condition, **found.means(LEVEL)})
        columns = found.columns(LEVEL)
        step = max(1, len(found.time_s) // SERIES)
        for k in range(0, len(found.time_s), step):
            beats.append({**found.condition, **{name: float(column[k]) for name, column in columns.items()}})
    document = {
        **about(model.calibrated),
        "effects": list(model.settings.effects),
        "level": LEVEL,
        "means": means,
        "failed": failed,
    }
    return {
        "means.csv": _csv(means),
        "beats.csv": _csv(beats),
        "tables.json": json.dumps(document, indent=1) + "\n",
    }


def grid(model: CalibratedModel) -> list[dict[str, Any]]:
    """Return the conditions of the tables, by names with units, inside the fitted range."""
    wing = isinstance(model.rig, Wing)
    ranges = {one.name: one for one in model.ranges}
    settings = {one.field: one for one in SETTINGS}
    levels = LEVELS[wing]
    while True:
        axes = []
        for name in VARIED:
            known, setting = ranges[name], settings[name]
            values = sorted({known.low, known.high} | set(np.linspace(known.low, known.high, levels).tolist()))
            axes.append([(value - setting.offset) / setting.factor for value in values])
        if np.prod([len(one) for one in axes]) <= MOST[wing] or levels == 2:
            break
        levels -= 1
    names = [settings[name].name for name in VARIED]
    air = {"pressure_mbar": ranges["pressure"].high / 100.0, "temperature_c": ranges["temperature"].low - 273.15}
    return [{**dict(zip(names, values, strict=True)), **air} for values in product(*axes)]


def _csv(rows: list[Row]) -> str:
    buffer = io.StringIO()
    if rows:
        writer = csv.DictWriter(buffer, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return buffer.getvalue()
