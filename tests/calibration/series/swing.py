"""A damped oscillator in closed form, whose simulation takes microseconds, and recordings of it with noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from wingfit.records import Channel, Gene, Quantity, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run, SimulationError
from wingfit.rigs.suspect import Suspect

TRUTH = {"stiffness": 55.0, "damping": 0.31}
STARTS = {"a": 0.1, "b": -0.06, "c": 0.14}
NOISE = (1e-3, 8e-3)  # m, m/s
HUM = Suspect(
    "hum",
    genes=(
        Gene("hum.size", "m", 0.0, -0.05, 0.05, "linear", "amplitude of a vibration of the sensor"),
        Gene("hum.rate", "rad/s", 5.0, 2.0, 40.0, "log", "its rate"),
    ),
)
# Named as an effect of a wing, with genes that this effect has as well.
TETHER = Suspect(
    "tether",
    genes=(
        Gene("tether.k", "N/m", 0.0, 0.0, 40.0, "linear", "of a second spring"),
        Gene("tether.station", "1", 0.5, 0.2, 1.0, "linear", "where it acts, as a fraction of the length"),
    ),
)
CREEP = Suspect("creep", genes=(Gene("creep.rate", "m/s", 0.0, -0.1, 0.1, "linear", "drift of the position"),))
LOST = 120.0  # N/m: a stiffer spring cannot be simulated


def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    decay, at = genes["damping"], run.times
    if genes["stiffness"] > LOST:
        raise SimulationError("the spring breaks")
    stiffness = genes["stiffness"] + genes["tether.k"] * genes["tether.station"] ** 2
    omega = np.sqrt(stiffness / run.setting("mass") - decay**2)
    x, v = genes["start"], genes["speed"]
    cosine, sine, fall = np.cos(omega * at), np.sin(omega * at), np.exp(-decay * at)
    other = (v + decay * x) / omega
    position = fall * (x * cosine + other * sine)
    speed = fall * (v * cosine - (omega * x + decay * other) * sine)
    hum = genes["hum.size"] * np.sin(genes["hum.rate"] * at)
    return {"position": position + genes["creep.rate"] * at + hum, "speed": speed}


RIG = Rig(
    name="swing",
    genes=(
        Gene("stiffness", "N/m", 40.0, 10.0, 160.0, "log", "of the spring"),
        Gene("damping", "1/s", 0.2, 0.02, 2.0, "log", "damping over twice the mass"),
    ),
    recording_genes=(
        Gene("start", "m", 0.08, -0.3, 0.3, "linear", "displacement at the first sample"),
        Gene("speed", "m/s", 0.0, -2.0, 2.0, "linear", "rate at the first sample"),
    ),
    channels={"position": "m", "speed": "m/s"},
    suspects=(CREEP, HUM, TETHER),
    settings={"mass": "kg"},
    simulate=simulate,
)


def recorded(
    name: str,
    seed: int = 1,
    *,
    lag1: float = 0.0,
    added: Mapping[str, float] | None = None,
    times: Array | None = None,
    **changes: Any,
) -> Series:
    """The swing that starts at ``STARTS``, with noise of the lag-1 autocorrelation ``lag1``, the start estimated.

    ``added``: values of genes of suspects; the others are off.
    """
    at = np.linspace(0.0, 3.0, 80) if times is None else times
    start = STARTS[name]
    run = Run(name, at, {"mass": 1.0}, {}, at)
    off = {gene.name: gene.nominal for suspect in RIG.suspects for gene in suspect.genes}
    found = simulate(TRUTH | {"start": start, "speed": 0.1} | off | dict(added or {}), run)
    rng = np.random.default_rng([seed, ord(name)])
    noise = rng.standard_normal((len(at), 2))
    for k in range(1, len(at)):
        noise[k] = lag1 * noise[k - 1] + np.sqrt(1.0 - lag1**2) * noise[k]
    values = np.stack([found["position"], found["speed"]], axis=1) + noise * NOISE
    channels = (Channel("position", "m", NOISE[0]), Channel("speed", "m/s", NOISE[1]))
    one = Series(name, at, channels, values, settings={"mass": 1.0}, estimates={"start": start + 0.005})
    return replace(one, **changes)


def dataset(*recordings: Series, held_out: Sequence[str] = ()) -> SeriesDataset:
    channels, mass = recordings[0].quantities, (Quantity("mass", "kg"),)
    return SeriesDataset("swings", "swing", recordings, channels, (), mass, tuple(held_out))


def three(seed: int = 1, **changes: Any) -> SeriesDataset:
    """Three recordings, the third held out."""
    return dataset(*(recorded(name, seed, **changes) for name in STARTS), held_out=("c",))
