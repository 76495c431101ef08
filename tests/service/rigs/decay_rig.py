"""A rig that takes no time: a charge that decays, in closed form; a constant current may be missing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from wingfit.records import Channel, Gene, Quantity, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run, SimulationError
from wingfit.rigs.suspect import Suspect

NOISE = 0.01  # C
RATE, LEAK = 0.8, 0.3  # 1/s, C/s: of the recorded rig


def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    rate, leak = genes["rate"], genes["leak.size"]
    if rate > 4.9:
        raise SimulationError("the charge is gone at once")
    equilibrium = -leak / rate
    return {"charge": equilibrium + (genes["charge0"] - equilibrium) * np.exp(-rate * run.times)}


rig = Rig(
    name="decay",
    genes=[Gene("rate", "1/s", 1.0, 0.2, 5.0, "log", "of the decay")],
    recording_genes=[Gene("charge0", "C", 1.0, 0.1, 5.0, "linear", "at the first sample")],
    channels={"charge": "C"},
    settings={"resistance": "ohm"},
    suspects=[Suspect("leak", genes=(Gene("leak.size", "C/s", 0.0, -2.0, 2.0),))],
    faults=False,
    simulate=simulate,
)


def dataset() -> SeriesDataset:
    """Three recordings of a rig with a leak, one of them held out."""
    channel = Channel("charge", "C", NOISE)
    recordings = [_recording(f"from-{start:g}", start, channel, seed) for seed, start in enumerate((1.0, 2.0, 3.0))]
    return SeriesDataset(
        "decay", "decay", tuple(recordings), (channel,), (), (Quantity("resistance", "ohm"),), ("from-3",), "For tests."
    )


def _recording(name: str, start: float, channel: Channel, seed: int) -> Series:
    times = np.linspace(0.0, 3.0, 60)
    run = Run(name, times, {}, {}, times)
    charge = simulate({"rate": RATE, "leak.size": LEAK, "charge0": start}, run)["charge"]
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(times))
    return Series(name, times, (channel,), (charge + noise)[:, None], settings={"resistance": 1.0})
