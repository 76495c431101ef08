"""A rig for tests: a mass on a spring and a damper, pushed by an input, with a port where laws may act."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from wingfit.records import Channel, Gene, Quantity, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.rigs.ports import Port
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run
from wingfit.rigs.suspect import Suspect

PORT = Port("slide", "m", "N", coordinate=0.1, rate=0.6, force=4.0, stiffness="stiffness")
GENES = (
    Gene("stiffness", "N/m", 40.0, 10.0, 160.0, "log", "of the spring"),
    Gene("damping", "N s/m", 0.2, 0.02, 2.0, "log", "of the damper"),
)
START = (
    Gene("start", "m", 0.08, -0.3, 0.3, "linear", "displacement at the first sample"),
    Gene("speed", "m/s", 0.0, -2.0, 2.0, "linear", "rate at the first sample"),
)
DRAG = Suspect("drag", genes=(Gene("drag.size", "N s^2/m^2", 0.0, -3.0, 3.0), Gene("drag.power", "1", 2.0, 1.5, 3.0)))


def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    mass = run.settings.get("mass", 1.0)

    def rate(t: float, state: Array) -> tuple[float, float]:
        x, v = state
        force = -genes["stiffness"] * x - genes["damping"] * v + run.force("slide", x, v)
        force -= genes["drag.size"] * abs(v) ** genes["drag.power"] * np.sign(v)
        if "push" in run.inputs:
            force += float(run.input("push", t))
        return v, force / mass

    position, speed = run.integrate(rate, [genes["start"], genes["speed"]])
    return {"position": position, "speed": speed}


RIG = Rig(
    name="oscillator",
    genes=GENES,
    recording_genes=START,
    channels={"position": "m", "speed": "m/s"},
    suspects=(DRAG,),
    settings={"mass": "kg"},
    ports=(PORT,),
    simulate=simulate,
)
UNFORCED = replace(RIG, channels={"position": "m"})


def blank(name: str = "one", *, samples: int = 160, last: float = 4.0, **changes: Any) -> Series:
    """A recording of the oscillator without values."""
    times = np.linspace(0.0, last, samples)
    quantities = (Channel("position", "m"), Channel("speed", "m/s"))
    empty = Series(name, times, quantities, np.full((samples, 2), np.nan), settings={"mass": 1.0})
    return replace(empty, **changes)


def dataset(*recordings: Series, held_out: tuple[str, ...] = ()) -> SeriesDataset:
    first = recordings[0]
    inputs = tuple(Quantity(name, "N") for name in first.inputs)
    settings = tuple(Quantity(name, "kg") for name in first.settings)
    return SeriesDataset("test", RIG.name, recordings, first.quantities, inputs, settings, held_out)


def run_of(recording: Series, laws: Mapping[str, Any] | None = None, values: Mapping[str, float] | None = None) -> Run:
    at = recording.times
    return Run(recording.name, at, recording.settings, dict(recording.inputs), at, values or {}, laws or {})
