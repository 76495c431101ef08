"""A linear model of forces, for which every answer is known in closed form."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.problem import Problem, base_genome
from wingfit.records import Condition, Gene, Recording
from wingfit.sim.model import Array, Observation, genome_batch

TRUTH = {"a": 1.2, "b": 0.8, "c": 1.5}
FREQUENCY = 12.5


@dataclass(frozen=True)
class Linear:
    """Forces that are sums of periodic shapes times genes.

    ``upper`` bounds all genes; ``twins``: b acts against a; ``fails_above`` and ``fails_beside``: values of a above, or
    further than ``ledge`` from, which nothing can be simulated.
    """

    upper: float = 6.0
    twins: bool = False
    fails_above: float = np.inf
    fails_beside: float | None = None
    ledge: float = 1e-9

    @property
    def genes(self) -> tuple[Gene, ...]:
        return tuple(Gene(name, "1", 1.0, -4.0, self.upper, "linear", name) for name in TRUTH)

    @property
    def searched(self) -> tuple[str, ...]:
        return tuple(TRUTH)

    def observe(self, genomes: Array, recording: Recording) -> Observation:
        batch = genome_batch(self.genes, genomes)
        channels = np.einsum("bp,tcp->btc", batch, self.shapes(recording))
        a = batch[:, 0]
        bad = a > self.fails_above
        if self.fails_beside is not None:
            bad |= np.abs(a - self.fails_beside) > self.ledge
        channels[bad] = np.nan
        return Observation(channels, tuple("broken" if one else None for one in bad))

    def shapes(self, recording: Recording) -> Array:
        """[T, C, 3]."""
        phase = 2 * np.pi * recording.condition.flap_frequency * recording.times
        x = np.stack([np.sin(phase), np.maximum(np.sin(phase + 0.4), 0) ** 2, np.cos(2 * phase) + 0.3], axis=1)
        if self.twins:
            x[:, 1] = -x[:, 0] + 0.003 * x[:, 1]
        z = np.stack([np.cos(phase), np.sin(2 * phase), 0.5 + 0 * phase], axis=1)
        by_axis = {"x": x, "z": z}
        return 0.1 * np.stack([by_axis[axis] for axis in recording.forces], axis=1)


def blank(samples: int = 400, axes: str = "x", rate: float = 1000.0) -> Recording:
    """A recording without values."""
    condition = Condition(FREQUENCY, 0.0, 101325.0, 293.15)
    values = np.zeros((samples, len(axes)))
    forces = tuple(axes)
    return Recording("balance", "wind_tunnel", condition, np.arange(samples) / rate, (), values, forces=forces)  # type: ignore[arg-type]


def recorded(noise: Array, axes: str = "x", model: Linear | None = None, rate: float = 1000.0) -> Recording:
    """The true forces with ``noise`` [T, C] added."""
    empty = blank(len(noise), axes, rate)
    clean = (model or Linear()).shapes(empty) @ np.array(list(TRUTH.values()))
    return replace(empty, values=clean + noise)


def problem(recording: Recording, model: Linear | None = None) -> Problem:
    """All genes free, all recorded axes fitted."""
    model = model or Linear()
    return Problem(model, (recording,), tuple(TRUTH), base_genome(model), recording.forces)
