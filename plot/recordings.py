"""The figure of a dataset: the conditions of its recordings."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from wingfit.plot.style import ACCENT, BOTTOM, GROUND, TOP, Figure, finish, grid, objects, plain, spoken

# Label, key of an answer of the client, attribute of a Condition, and conversion of that to the unit of the label.
CONDITION = (
    ("flap frequency, Hz", "flap_frequency_hz", "flap_frequency", float),
    ("phase lag, deg", "phase_lag_deg", "phase_lag", math.degrees),
    ("pressure, mbar", "pressure_mbar", "pressure", lambda pascals: pascals / 100),
    ("temperature, °C", "temperature_c", "temperature", lambda kelvins: kelvins - 273.15),
    ("airspeed, m/s", "airspeed_m_s", "airspeed", float),
    ("angle of attack, deg", "angle_of_attack_deg", "angle_of_attack", math.degrees),
)
DURATION = "duration, s"
Row = tuple[str, bool, dict[str, float]]  # name, held out, {label: value}


def conditions(dataset: object) -> Figure:
    """Draw under which conditions the recordings of a dataset were made, one row for each recording.

    Columns are what differs between the recordings: flap frequency (Hz), phase lag (deg), pressure (mbar), temperature
    (degrees C), airspeed (m/s), angle of attack or body pitch (deg), or the settings of a rig of the user's own; if
    nothing differs, the duration (s). Held out recordings are hollow.

    Args:
        dataset: a :class:`wingfit.Dataset` or :class:`wingfit.SeriesDataset`, or an answer of
            :meth:`wingfit.Client.dataset`.

    Raises:
        TypeError: ``dataset`` is none.
        ValueError: it has no recordings.
    """
    name, rows = _rows(dataset)
    if not rows:
        raise ValueError(f"the dataset {name!r} has no recordings")
    columns = _columns(rows)
    figure = grid(1, len(columns), shared_yaxes=True, horizontal_spacing=0.03)
    for k, label in enumerate(columns, 1):
        for held_out in (False, True):
            some = [(values[label], plain(one)) for one, held, values in rows if held == held_out and label in values]
            if not some:
                continue
            x, y = zip(*some, strict=True)
            marker = {"size": 10, "color": GROUND if held_out else ACCENT, "line": {"color": ACCENT, "width": 2}}
            use = "held out" if held_out else "fitted"
            text = f"%{{y}}: %{{x:.4g}}<extra>{use}</extra>"
            figure.add_trace(
                objects().Scatter(
                    x=x, y=y, mode="markers", marker=marker, name=use, legendgroup=use, showlegend=k == 1,
                    hovertemplate=text,
                ), 1, k)  # fmt: skip
        figure.update_xaxes(title_text=plain(label), nticks=5, row=1, col=k)
    order = [plain(one) for one, _, _ in rows]
    figure.update_yaxes(categoryorder="array", categoryarray=order, autorange="reversed")
    fixed = {
        label: next(iter(values)) for label, values in _values(rows).items() if len(values) == 1 and label != DURATION
    }
    same = ", ".join(f"{label.split(', ')[0]} {value:.4g} {label.partition(', ')[2]}" for label, value in fixed.items())
    title = f"{name}: {len(rows)} recordings" + (f"; the same in all: {same}" if same and len(fixed) <= 3 else "")
    return finish(figure, title, TOP + BOTTOM + 26 * (len(rows) + 1))


def _rows(dataset: object) -> tuple[str, list[Row]]:
    if isinstance(dataset, Mapping) and "recordings" in dataset:
        units = {one["name"]: one["unit"] for one in (dataset.get("rig") or {}).get("settings", ())}
        answers = dataset["recordings"]
        return dataset["name"], [(one["name"], one["held_out"], _of_answer(one, units)) for one in answers]
    if hasattr(dataset, "recordings") and hasattr(dataset, "held_out"):
        found = [(one.name, one.name in dataset.held_out, _of_recording(one)) for one in dataset.recordings]
        return getattr(dataset, "name", ""), found
    raise TypeError(f"{type(dataset).__name__} is no dataset; give wingfit.load_dataset(...) or Client.dataset(...)")


def _of_answer(one: Mapping[str, Any], units: Mapping[str, str]) -> dict[str, float]:
    angle = "body pitch, deg" if any(name.startswith("force_") for name in one["channels"]) else CONDITION[-1][0]
    values = {label: one[key] for label, key, _, _ in CONDITION[:-1] if one[key] is not None}
    if one["angle_of_attack_deg"] is not None:
        values[angle] = one["angle_of_attack_deg"]
    settings = {_setting(name, units.get(name, "1")): value for name, value in one["settings"].items()}
    length = {} if one["duration_s"] is None else {DURATION: one["duration_s"]}
    return values | settings | length


def _of_recording(one: Any) -> dict[str, float]:
    length = {DURATION: float(one.times[-1] - one.times[0])}
    if not hasattr(one, "condition"):
        return {_setting(name, "1"): float(value) for name, value in one.settings.items()} | length
    values = length | {label: convert(getattr(one.condition, name)) for label, _, name, convert in CONDITION}
    if one.forces:
        values["body pitch, deg"] = values.pop(CONDITION[-1][0])
        values.pop("phase lag, deg")  # of the rods of a wing
    return values


def _setting(name: str, unit: str) -> str:
    return spoken(name) + ("" if unit == "1" else f", {unit}")


def _values(rows: list[Row]) -> dict[str, set[float]]:
    found: dict[str, set[float]] = {}
    for _, _, values in rows:
        for label, value in values.items():
            found.setdefault(label, set()).add(round(value, 9))
    return found


def _columns(rows: list[Row]) -> list[str]:
    """Return the labels of what differs between the recordings; if nothing does, of how long they are."""
    differing = [label for label, values in _values(rows).items() if len(values) > 1 and label != DURATION]
    return differing or [DURATION]
