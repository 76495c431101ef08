"""Plan and record the blind trials: what is hidden, how large, under which noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal

import numpy as np
import scipy

from benchmarks.any_rig.plants import PLANTS, Plant
from benchmarks.any_rig.rigs import RIGS
from wingfit.records import Channel, Quantity, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.rigs.rig_model import RigModel

Group = Literal["null", "listed", "unlisted"]
Noise = Literal["stated", "unstated", "coloured, repeated", "coarse"]
GROUPS: tuple[Group, ...] = ("null", "listed", "unlisted")
NOISES: tuple[Noise, ...] = ("stated", "unstated", "coloured, repeated", "coarse")
STRENGTHS = (2.0, 3.0, 5.0)
EXPERIMENTS, HELD_OUT = 5, 2
SPREAD = 1.6  # largest factor between a parameter and its estimate
LOUDEST, QUIETEST = 0.03, 2e-4  # noise relative to the range of a channel
LAG1 = 0.7


@dataclass(frozen=True)
class Trial:
    """One trial; ``hidden`` is the name of what is hidden, "" for nothing."""

    name: str
    seed: int
    rig: str
    group: Group
    hidden: str
    aim: float
    noise: Noise


@dataclass(frozen=True)
class Answer:
    """The truth of a trial: parameters, size of what is hidden, noise (relative to the range), and strength.

    ``strength``: residual of the refitted nominal model without noise, divided by the noise. ``sizes``: value of each
    gene that the model would have for what is hidden; empty where it has none (:func:`sizes_in_model`).
    """

    trial: Trial
    parameters: dict[str, float]
    size: float
    noise: float
    strength: float
    sizes: dict[str, float] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return the answer as JSON."""
        return asdict(self)


def plan(seed: int, per_rig: tuple[int, int, int] = (12, 12, 6)) -> list[Trial]:
    """Return the trials of ``seed``: so many null, listed and unlisted ones (``per_rig``) for each rig."""
    found = []
    for r, (rig, plant) in enumerate(PLANTS.items()):
        for group, count in zip(GROUPS, per_rig, strict=True):
            things = {"null": [""], "listed": list(plant.listed), "unlisted": list(plant.unlisted)}[group]
            for k in range(count):
                own = int(np.random.default_rng([seed, r, GROUPS.index(group), k]).integers(2**31))
                name = f"t{own:08x}"
                hidden, aim = things[k % len(things)], STRENGTHS[(k // len(things)) % len(STRENGTHS)]
                found.append(Trial(name, own, rig, group, hidden, aim, NOISES[(k + r) % len(NOISES)]))
    return found


def recorded(trial: Trial) -> tuple[SeriesDataset, Answer]:
    """Record ``trial``; the answer has the strength that it has in the end."""
    rng, plant = np.random.default_rng(trial.seed), PLANTS[trial.rig]
    parameters = {name: value * SPREAD ** rng.uniform(-1, 1) for name, value in plant.nominal.items()}
    size = {**plant.listed, **plant.unlisted}.get(trial.hidden, 0.0) * rng.uniform(0.5, 1.0)
    clean = [_clean(plant, k, parameters, {trial.hidden: size}, rng) for k in range(EXPERIMENTS + HELD_OUT)]
    spans = np.max([np.ptp(one.values, axis=0) for one in clean], axis=0)
    left = _left(trial, clean[:EXPERIMENTS], parameters, spans) if trial.hidden else 0.0
    level = float(np.clip(left / trial.aim, QUIETEST, LOUDEST)) if trial.hidden else 10 ** rng.uniform(-2.7, -1.7)
    noisy = [one for series in clean for one in _noisy(trial, series, level * spans, rng)]
    held_out = tuple(one.name for one in noisy if int(one.name.split("-")[1]) >= EXPERIMENTS)
    inputs = tuple(Quantity(name, RIGS[trial.rig].inputs[name]) for name in clean[0].inputs)
    dataset = SeriesDataset(trial.name, trial.rig, tuple(noisy), noisy[0].quantities, inputs, (), held_out)
    return dataset, Answer(trial, parameters, size, level, left / level, sizes_in_model(trial, size, dataset))


def sizes_in_model(trial: Trial, size: float, dataset: SeriesDataset) -> dict[str, float]:
    """Return the values that the genes of the hidden thing would have in the model, by name.

    Empty for what the model does not know, and for saturation: the plant limits each recording to a part of its own
    largest value, the model all of them to one value.
    """
    if trial.group != "listed" or trial.hidden.startswith("saturation"):
        return {}
    model = RigModel(RIGS[trial.rig], dataset.recordings)
    (suspect,) = (one for one in model.suspects if one.name == trial.hidden)
    (gene,) = suspect.genes
    if not trial.hidden.startswith("crosstalk"):
        return {gene.name: size}
    _, name, other = trial.hidden.split(".")  # the model's is relative to the ranges of the channels
    spans = {
        channel: max(float(np.ptp(one.values[:, one.channels.index(channel)])) for one in dataset.recordings)
        for channel in (name, other)
    }
    return {gene.name: size * spans[other] / spans[name]}


def _clean(plant: Plant, k: int, parameters: dict[str, float], hidden: dict[str, float], rng: Any) -> Series:
    """Record experiment number ``k`` without noise."""
    rig = next(RIGS[name] for name, one in PLANTS.items() if one is plant)
    times = np.arange(plant.samples, dtype=np.float64) * plant.interval
    push = plant.push * _input(times, plant.corner, rng)
    start = rng.normal(0.0, plant.start)
    values = plant.run(parameters, hidden, lambda t: float(np.interp(t, times, push)), start, times)
    quantities = tuple(Channel(name, unit) for name, unit in rig.channels.items())
    return Series(f"run-{k}", times, quantities, values, {next(iter(rig.inputs)): push})


def _input(times: Array, corner: float, rng: Any) -> Array:
    """Return a smooth random input between about -1 and 1, with steps, positive on average for a heater."""
    waves = sum(
        rng.uniform(0.2, 1.0) * np.sin(2 * np.pi * times / (corner * 2 ** rng.uniform(0.0, 2.5)) + rng.uniform(0, 6.3))
        for _ in range(4)
    )
    steps = np.sign(np.sin(2 * np.pi * times / (corner * rng.uniform(4.0, 8.0)) + rng.uniform(0, 6.3)))
    whole = waves + steps * rng.uniform(0.5, 1.5)
    return np.asarray(whole / np.abs(whole).max() + 0.3)


def _left(trial: Trial, clean: list[Series], parameters: dict[str, float], spans: Array) -> float:
    """Return the residual (relative to the ranges) of the nominal model, refitted to recordings without noise."""
    model = RigModel(replace(RIGS[trial.rig], faults=False), tuple(clean))
    genes = model.genes
    start = np.array([np.clip(gene.to_unit(parameters.get(gene.name, gene.nominal)), 0.02, 0.98) for gene in genes])

    def residuals(unit: Array) -> Array:
        genome = np.array([float(gene.from_unit(u)) for gene, u in zip(genes, unit, strict=True)])
        parts = []
        for one in clean:
            seen = model.observe(genome, one).channels[0]
            parts.append((np.nan_to_num(seen, nan=1e3) - one.values) / spans)
        return np.concatenate([part.ravel() for part in parts])

    found = scipy.optimize.least_squares(residuals, start, bounds=(0.0, 1.0), diff_step=1e-4, max_nfev=12)
    return float(np.sqrt(np.mean(found.fun**2)))


def _noisy(trial: Trial, clean: Series, deviations: Array, rng: Any) -> Iterator[Series]:
    """Yield the recording with noise; two repeats of it if the noise is coloured."""
    shape = clean.values.shape
    if trial.noise == "coarse":
        steps = np.sqrt(12.0) * deviations
        yield replace(
            clean, values=np.round((clean.values + 0.1 * deviations * rng.normal(size=shape)) / steps) * steps
        )
        return
    if trial.noise == "coloured, repeated":
        for k in range(2):
            error = rng.normal(size=shape)
            for t in range(1, len(error)):
                error[t] = LAG1 * error[t - 1] + np.sqrt(1 - LAG1**2) * error[t]
            yield replace(clean, name=f"{clean.name}-{k}", values=clean.values + deviations * error, repeats=clean.name)
        return
    stated = deviations.tolist() if trial.noise == "stated" else [None] * shape[1]
    quantities = tuple(replace(c, standard_deviation=s) for c, s in zip(clean.quantities, stated, strict=True))
    yield replace(clean, quantities=quantities, values=clean.values + deviations * rng.normal(size=shape))
