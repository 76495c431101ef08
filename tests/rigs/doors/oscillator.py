"""A damped oscillator that is driven by a force, in exact form, and the rig and recordings of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy.linalg

from wingfit.records import Channel, Gene, Quantity, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel
from wingfit.rigs.run import Run

GENES = (
    Gene("stiffness", "N/m", 20.0, 10.0, 40.0, "log", "stiffness"),
    Gene("damping", "N*s/m", 0.3, 0.05, 1.0, "log", "damping"),
)
START = Gene("start", "m", 0.1, -0.5, 0.5, "linear", "initial position")
CHANNELS = {"position": "m", "speed": "m/s"}
UNEVEN = np.cumsum(np.concatenate([[0.5], 0.01 + 0.02 * np.random.default_rng(5).random(80)]))


def oscillate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """Position (m) and speed (m/s) [T] of mass x'' + damping x' + stiffness x = force, linear between samples."""
    mass = run.setting("mass")
    force = run.input("force", run.times)
    system = np.zeros((4, 4))  # position, speed, force, rate of the force
    system[0, 1] = system[2, 3] = 1.0
    system[1, :3] = [-genes["stiffness"] / mass, -genes["damping"] / mass, 1.0 / mass]
    states = np.empty((len(run.times), 2))
    states[0] = genes["start"], 0.0
    for k, step in enumerate(np.diff(run.times)):
        whole = [*states[k], force[k], (force[k + 1] - force[k]) / step]
        states[k + 1] = (scipy.linalg.expm(system * step) @ whole)[:2]
    return {"position": states[:, 0], "speed": states[:, 1]}


def rig(simulate: Any, name: str = "oscillator") -> Rig:
    """The rig with ``simulate``."""
    return Rig(name, GENES, CHANNELS, simulate, (), (START,), {"force": "N"}, {"mass": "kg"}, faults=True)


def recording(times: Array | None = None) -> Series:
    """A recording [T, 2] without noise, 2 s long unless other ``times`` (s) are given."""
    at = np.linspace(0.0, 2.0, 101) if times is None else times
    force = np.sin(3.0 * at) + 0.5 * (at > at.mean())
    run = Run("first", at, {"mass": 0.5}, {"force": force}, at)
    truth = oscillate({"stiffness": 22.0, "damping": 0.25, "start": 0.15}, run)
    quantities = tuple(Channel(channel, unit, 1e-3) for channel, unit in CHANNELS.items())
    values = np.stack([truth[channel] for channel in CHANNELS], axis=1)
    return Series("first", at, quantities, values, {"force": force}, {"mass": 0.5})


def dataset(times: Array | None = None) -> SeriesDataset:
    """The dataset of :func:`recording`."""
    one = recording(times)
    inputs, settings = (Quantity("force", "N"),), (Quantity("mass", "kg"),)
    return SeriesDataset("oscillations", "oscillator", (one,), one.quantities, inputs, settings)


def run(times: Array | None = None) -> Run:
    """What is to be simulated for :func:`recording`."""
    one = recording(times)
    return Run(one.name, one.times, one.settings, dict(one.inputs), one.times)


NOMINAL = {"stiffness": 20.0, "damping": 0.3, "start": 0.1}


def largest_difference(simulate: Any, effects: tuple[str, ...] = (), times: Array | None = None) -> float:
    """The largest difference of any channel to the exact form, over ten genomes, relative to the largest value."""
    one = recording(times)
    seen = []
    for each in (simulate, oscillate):
        model = RigModel(rig(each), (one,), effects)
        units = np.random.default_rng(3).uniform(0.1, 0.9, (10, len(model.genes)))
        genomes = [[float(gene.from_unit(u)) for gene, u in zip(model.genes, row, strict=True)] for row in units]
        found = model.observe(genomes, one)
        assert found.reasons == (None,) * 10, found.reasons
        seen.append(found.channels)
    return float((np.abs(seen[0] - seen[1]) / np.abs(seen[1]).max((0, 1))).max())
