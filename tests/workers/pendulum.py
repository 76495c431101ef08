"""A small rig for tests of evaluators: one marker on a damped pendulum at small angles."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wingfit.calibration.problem import Problem, base_genome
from wingfit.records import Condition, Gene, Recording
from wingfit.sim.model import Array, Observation, genome_batch

GENES = (
    Gene("length", "m", 0.25, 0.05, 1.0, "log", "distance from the pivot to the marker"),
    Gene("damping", "1/s", 0.4, 0.01, 3.0, "log", "decay rate of the amplitude"),
    Gene("amplitude", "rad", 0.1, -0.3, 0.3, "linear", "angle at the start"),
)
TRUE = {"length": 0.3, "damping": 0.25, "amplitude": 0.12}


@dataclass(frozen=True)
class Pendulum:
    """theta'' + 2 d theta' + (g / L) theta = 0 from rest at the amplitude; the marker hangs at distance L.

    ``incident`` is called before each simulation: tests make trouble with it.
    """

    incident: Callable[[Array, Recording], None] | None = None

    @property
    def genes(self) -> tuple[Gene, ...]:
        return GENES

    @property
    def searched(self) -> tuple[str, ...]:
        return tuple(gene.name for gene in GENES)

    def observe(self, genomes: Array, recording: Recording) -> Observation:
        batch = genome_batch(self.genes, genomes)
        if self.incident:
            self.incident(batch, recording)
        length, damping, amplitude = (column[:, None] for column in batch.T)
        omega2 = recording.condition.gravity / length - damping**2
        omega = np.sqrt(np.maximum(omega2, 1e-12))
        t = recording.times[None, :]
        theta = amplitude * np.exp(-damping * t) * (np.cos(omega * t) + damping / omega * np.sin(omega * t))
        channels = np.stack([length * np.sin(theta), 0.0 * theta, -length * np.cos(theta)], axis=2)
        overdamped = omega2[:, 0] <= 0.0
        channels[overdamped] = np.nan
        return Observation(channels, tuple("overdamped" if bad else None for bad in overdamped))


def recording(name: str, gravity: float, frames: int = 40) -> Recording:
    """A noisy recording of the true pendulum, with a gap."""
    times = np.linspace(0.0, 2.0, frames)
    condition = Condition(3.0, 0.0, 101325.0, 293.0, gravity=gravity)
    blank = Recording(name, "vacuum_chamber", condition, times, ("bob",), np.zeros((frames, 3)))
    truth = np.array([[TRUE[gene.name] for gene in GENES]])
    values = Pendulum().observe(truth, blank).channels[0]
    values = values + np.random.default_rng(frames).normal(0.0, 1e-4, values.shape)
    values[5:8] = np.nan
    return Recording(name, "vacuum_chamber", condition, times, ("bob",), values)


def problem(
    incident: Callable[[Array, Recording], None] | None = None,
    gravities: tuple[float, ...] = (9.81, 1.62, 3.71),
) -> Problem:
    """Pendulum on several celestial bodies, two genes free."""
    model = Pendulum(incident)
    recordings = tuple(recording(f"g{gravity}", gravity, 40 + i) for i, gravity in enumerate(gravities))
    return Problem(model, recordings, ("length", "damping"), base_genome(model, {"amplitude": 0.12}))


def population(individuals: int, seed: int = 7) -> Array:
    """Values of the free genes; the first individual is overdamped on the Moon, so it fails."""
    rng = np.random.default_rng(seed)
    values = np.column_stack([rng.uniform(0.1, 0.8, individuals), rng.uniform(0.05, 0.8, individuals)])
    values[0] = 0.95, 2.9
    return values


def _first(flag: Path) -> bool:
    """Whether nobody has asked this before, in any process."""
    try:
        flag.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


@dataclass(frozen=True)
class DieOnce:
    """Kills its process the first time it is called anywhere, as the kernel does when memory runs out."""

    flag: Path

    def __call__(self, _batch: Array, _recording: Recording) -> None:
        if _first(self.flag):
            os.kill(os.getpid(), 9)


@dataclass(frozen=True)
class HangOnce:
    """Hangs the first time it is called anywhere: ``how`` is stop (as by a signal), loop, or sleep."""

    flag: Path
    how: str

    def __call__(self, _batch: Array, _recording: Recording) -> None:
        if not _first(self.flag):
            return
        if self.how == "stop":
            os.kill(os.getpid(), signal.SIGSTOP)
        while self.how != "sleep":
            pass
        time.sleep(3600)


@dataclass(frozen=True)
class Count:
    """Leaves a file in ``folder`` for each call, and takes its time."""

    folder: Path
    seconds: float

    def __call__(self, _batch: Array, _recording: Recording) -> None:
        os.close(tempfile.mkstemp(dir=self.folder)[0])
        time.sleep(self.seconds)


@dataclass(frozen=True)
class LoseOnce:
    """Fails the first time it is called anywhere, as when Ray's memory has lost what a task asks for."""

    flag: Path

    def __call__(self, _batch: Array, _recording: Recording) -> None:
        from ray.exceptions import GetTimeoutError

        if _first(self.flag):
            raise GetTimeoutError("the problem did not come")


def hang_always(_batch: Array, _recording: Recording) -> None:
    """Hangs every time."""
    time.sleep(3600)


def die_always(_batch: Array, _recording: Recording) -> None:
    """Kills its process every time."""
    os.kill(os.getpid(), 9)


def need_writeable(batch: Array, recording: Recording) -> None:
    """Raises when arrays came out of shared memory as they were, read-only."""
    for array in (batch, recording.values, recording.times):
        if not array.flags.writeable:
            raise ValueError("read-only array")


def refuse(_batch: Array, recording: Recording) -> None:
    """Raises what a model raises on bad input."""
    raise ValueError(f"cannot simulate {recording.name}")


@dataclass(frozen=True)
class Note:
    """Writes down where it ran: a file per process, with niceness and threads; then takes its time."""

    folder: Path
    seconds: float = 0.0

    def __call__(self, _batch: Array, _recording: Recording) -> None:
        settings = " ".join(os.environ.get(n, "-") for n in ("OMP_NUM_THREADS", "RAY_RAYLET_PID"))
        (self.folder / str(os.getpid())).write_text(f"{os.nice(0)} {settings}")
        time.sleep(self.seconds)
