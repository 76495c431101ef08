"""Make the blind trials: simulate and record a rig, save the dataset for the diagnosis, and seal the answer.

Parameters of the rig, conditions, recording quality and the shape of the hidden effect are drawn at random. The
strength of the effect is chosen such that the refitted nominal model (:mod:`.strength`) has the intended misfit. The
same trial always gives bit-identical data.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from benchmarks.concealed.answer import Answer, Secret
from benchmarks.concealed.benches.bench import Bench, Made
from benchmarks.concealed.benches.choose import bench_of
from benchmarks.concealed.plant.law import Concealed
from benchmarks.concealed.seal import read, seal
from benchmarks.concealed.strength import Refit, rms, stacked, strength_for
from benchmarks.concealed.trials import ENTIRE, REST, Trial, conditions, name_of
from wingfit.records import (
    Condition,
    Dataset,
    DatasetError,
    Recording,
    Vehicle,
    load_dataset,
    save_dataset,
    wing_or_vehicle,
)

Array = npt.NDArray[np.float64]

ATTEMPTS = 48  # draws of a trial, if the plant cannot be simulated with the first ones, or no dataset takes them
ROUNDS = 8  # limit of a refit's iterations; genes that can imitate a mass almost completely converge slowly
CORRECTIONS = 1  # full refits to correct a strength; the remaining error is corrected by lowering the noise
LITTLE = 0.85  # fraction of the target d below which the noise is lowered, as far as real equipment allows


@dataclass(frozen=True)
class Order:
    """A trial to be recorded, the path for its ``dataset``, and the folder ``sealed`` for its answer."""

    trial: Trial
    dataset: Path
    sealed: Path


@dataclass(frozen=True)
class Addition:
    """Request for one more recording of a trial's rig, under ``condition``.

    Paths: ``dataset`` of the trial; ``longer``, the extended dataset to be written; ``sealed``, the folder of answers.
    """

    trial: Trial
    condition: Condition
    dataset: Path
    longer: Path
    sealed: Path


@dataclass(frozen=True, eq=False)
class Specimen:
    """A simulated rig with its cameras or balance (``bench``), and all that determines the recordings.

    ``genome``: true parameters of the rig; ``hidden``: the hidden effects. Random numbers follow from ``seed`` and
    ``attempt``. ``level`` multiplies the noise that was drawn. An ``ideal`` specimen is recorded without noise and
    gaps.
    """

    bench: Bench[Any, Any]
    seed: int
    attempt: int
    genome: Mapping[str, float]
    hidden: Concealed
    level: float = 1.0
    ideal: bool = False

    @cached_property
    def quality(self) -> Any:
        """Settings of cameras or balance, with the noise multiplied by ``level``, or without noise if ``ideal``."""
        drawn = self.bench.quality(np.random.default_rng([self.seed, self.attempt, 2]))
        return self.bench.ideal(drawn) if self.ideal else self.bench.quieter(drawn, self.level)

    @property
    def least_level(self) -> float:
        """Smallest ``level`` (factor on the drawn noise) that real equipment reaches."""
        return self.bench.least(replace(self, level=1.0, ideal=False).quality)

    def made(self, number: int, condition: Condition) -> Made:
        """Simulate the recording with this ``number`` in the dataset, under ``condition``."""
        rng = np.random.default_rng([self.seed, self.attempt, 3, number])
        found = self.bench.recording(condition, self.genome, self.hidden, self.quality, rng)
        return found._replace(recording=replace(found.recording, name=name_of(condition)))

    def fitted(self, conditions: Sequence[Condition]) -> tuple[Recording, ...]:
        """Simulated recordings under ``conditions``, filtered as before a fit."""
        made = (self.made(number, condition).recording for number, condition in enumerate(conditions))
        return tuple(self.bench.fitted(one) for one in made)

    def secret(self, name: str, condition: Condition) -> Secret:
        """Description of the hidden effect ``name`` for the answer.

        The phase of an effect that depends on the motion is that in the beat under ``condition``.
        """
        law, parameters = self.bench.laws[name], self.hidden[name]
        beat = self.bench.beat(condition, self.genome, self.hidden)
        return Secret(
            law.name,
            law.listed,
            law.side,
            parameters["strength"],
            dict(parameters),
            parameters.get("span"),
            parameters.get("chord"),
            self.bench.phase(beat, name, parameters),
            dict(law.values(parameters)),
        )

    def noise(self, conditions: Sequence[Condition]) -> float:
        """RMS noise of the recordings under ``conditions`` after the filter that precedes a fit, m or N."""
        return rms(np.array([self.made(number, condition).noise for number, condition in enumerate(conditions)]))


def make(order: Order) -> str:
    """Record a trial, save its dataset and its answer, and return the SHA-256 of the file with the answer.

    RuntimeError if the plant cannot be simulated in any of ATTEMPTS draws.
    """
    reasons = []
    for attempt in range(ATTEMPTS):
        try:
            dataset, answer = _made(order.trial, attempt)
            save_dataset(dataset, order.dataset)  # refuses some wrong units
        except (RuntimeError, ArithmeticError, ValueError) as error:
            reasons.append(f"{type(error).__name__}: {error}")
            continue
        return seal(answer, order.sealed)
    raise RuntimeError(f"{order.trial} cannot be recorded: {'; '.join(reasons)}")


def add(order: Addition) -> bool:
    """Record one more condition of a trial's rig, and save the dataset extended by it.

    Returns False where the dataset refuses the recording, such as forces that no balance for this vehicle measures.
    """
    dataset, answer = wing_or_vehicle(load_dataset(order.dataset)), read(order.sealed / f"{order.trial.name}.json")
    secrets = [secret for secret in answer.secrets if secret.name not in order.trial.build.by_nature]
    hidden = {secret.name: dict(secret.parameters) for secret in secrets}
    bench = bench_of(order.trial.build)
    specimen = Specimen(bench, answer.seed, answer.attempt, answer.genome, hidden, answer.level)
    more = specimen.made(len(dataset.recordings), order.condition).recording
    taken = {one.name for one in dataset.recordings}
    name = more.name if more.name not in taken else f"{more.name}-again"
    try:
        save_dataset(replace(dataset, recordings=(*dataset.recordings, replace(more, name=name))), order.longer)
    except DatasetError:
        return False
    return True


def _made(trial: Trial, attempt: int) -> tuple[Dataset, Answer]:
    rng = np.random.default_rng([trial.seed, attempt, 1])
    bench = bench_of(trial.build)
    planned = conditions(trial, rng)
    fitted = [condition for condition, held_out in planned if not held_out]
    bare = Specimen(bench, trial.seed, attempt, bench.genome(rng), {})
    drawn = {name: bench.laws[name].draw(rng) for name in trial.hidden}
    strength = Strength.of(bare, fitted)
    as_drawn = trial.group == "drift"
    specimen = replace(bare, hidden=drawn) if as_drawn else strength.set(bare, drawn, _targets(trial, bare.bench))
    every = [specimen.made(number, condition) for number, (condition, _) in enumerate(planned)]
    held_out = tuple(one.recording.name for one, (_, held) in zip(every, planned, strict=True) if held)
    noise = {
        held: rms(np.array([one.noise for one, (_, other) in zip(every, planned, strict=True) if other is held]))
        for held in (False, True)
    }
    answer = Answer(
        trial=trial.name,
        group=trial.group,
        rig=trial.build.rig,
        division=trial.build.division,
        plant=trial.build.plant,
        secrets=(
            *(specimen.secret(name, fitted[0]) for name in specimen.hidden),
            *(Secret(name, listed=True, side="physics", strength=1.0) for name in trial.build.by_nature),
        ),
        genome=specimen.genome,
        target=trial.target,
        strength=_reached(trial, specimen, strength) / noise[False],
        strength_of_division=strength.division() / noise[False],
        noise=noise[False],
        noise_held_out=noise[True],
        conditions={one.recording.name: one.recording.condition for one in every},
        seed=trial.seed,
        attempt=attempt,
        level=specimen.level,
        body=trial.build.body,
    )
    described = bench.described(np.random.default_rng([trial.seed, attempt, 4]))
    return Dataset(trial.name, described, tuple(one.recording for one in every), held_out), answer


def _reached(trial: Trial, specimen: Specimen, strength: Strength) -> float:
    """RMS residual (m or N) that a refit of the nominal model leaves of what is hidden; 0 of a drift."""
    if trial.group == "drift":
        return 0.0
    return strength.division() if trial.build.by_nature else strength.final(specimen)


def _targets(trial: Trial, bench: Bench[Any, Any]) -> dict[str, float]:
    """Intended strength of each effect that ``trial`` hides; what the library does not have is a smaller part."""
    rest = REST if trial.group == "partly" else 1.0
    return {name: trial.target * (1.0 if bench.laws[name].listed else rest) for name in trial.hidden}


@dataclass(frozen=True, eq=False)
class Strength:
    """Finds the strength of a hidden effect at which the refitted nominal model has a given misfit.

    The change due to a hidden effect is simulated with the discretisation of the model, which is cheaper and gives
    nearly the same change. A strength is searched first with the model linearised at the true parameters, then by full
    refits.

    Attributes:
        bare: the specimen without hidden effects, recorded without noise; ``coarse``: discretised like the model.
        conditions: of the fitted recordings.
        refit: refits the nominal model to these recordings.
        plain: [D] all values recorded from ``coarse``, m or N.
        changes: cache of :meth:`change`.
        ends: cache, by hidden effects, of RMS residual (m or N) and parameters [F] (unit coordinates) at the end of
            each full refit; later refits start from these parameters.
    """

    bare: Specimen
    conditions: tuple[Condition, ...]
    refit: Refit
    coarse: Specimen
    plain: Array
    changes: dict[Hashable, Array] = field(default_factory=dict, repr=False)
    ends: dict[Hashable, tuple[float, Array]] = field(default_factory=dict, repr=False)

    @classmethod
    def of(cls, bare: Specimen, fitted: Sequence[Condition]) -> Strength:
        """Simulate ``bare`` under the conditions ``fitted``, and set up a refit that starts at the true parameters."""
        ideal = replace(bare, ideal=True)
        coarse = replace(ideal, bench=bare.bench.coarse())
        recordings = ideal.fitted(fitted)
        plain = stacked(recordings) if coarse.bench is ideal.bench else stacked(coarse.fitted(fitted))
        refit = Refit(bare.bench.model_beside(bare.genome), bare.genome, recordings, bare.bench.searched)
        return cls(ideal, tuple(fitted), refit, coarse, plain)

    def change(self, hidden: Concealed) -> Array:
        """[D] change of all recorded values (m or N) due to the effects ``hidden``, cached."""
        key = _key(hidden)
        if key not in self.changes:
            self.changes[key] = stacked(replace(self.coarse, hidden=hidden).fitted(self.conditions)) - self.plain
        return self.changes[key]

    def set(self, bare: Specimen, drawn: Concealed, targets: Mapping[str, float]) -> Specimen:
        """The specimen ``bare`` with each effect of ``drawn`` at the strength where misfit / noise is its target.

        If the misfit stays below LITTLE times that, the noise is lowered instead, as far as real equipment allows.
        """
        hidden, level, noise = {}, bare.level, bare.noise(self.conditions)
        for name, parameters in drawn.items():
            target = targets[name]
            if isinstance(bare.bench.rig, Vehicle) and name in ENTIRE:
                hidden[name] = dict(parameters)
                continue
            hidden[name], found = self._sized(name, parameters, target, noise)
            if found < LITTLE * target:
                level = min(level, max(found / target, bare.least_level))
        return replace(bare, hidden=hidden, level=level)

    def _sized(
        self, name: str, parameters: Mapping[str, float], target: float, noise: float
    ) -> tuple[dict[str, float], float]:
        """Parameters with the strength at which misfit / ``noise`` after a refit is near ``target``, and that ratio."""

        def sized(size: float) -> dict[str, float]:
            return {**parameters, "strength": size * parameters["strength"]}

        def linear(size: float) -> float:
            return self.refit.linear(self.change({name: sized(size)})) / noise

        def full(size: float) -> float:
            truth, hidden = self.refit.unit, {name: sized(size)}
            near = [truth + part * (end - truth) for old, end in ends.items() for part in (1, size / old)]
            left = self._refit(hidden, [np.clip(one, 0.0, 1.0) for one in near])
            ends[size] = self.ends[_key(hidden)][1]
            return left / noise

        ends: dict[float, Array] = {}
        limits = self.bare.bench.limits(name)
        start, _ = strength_for(target, linear, 1.0, limits)
        size, found = strength_for(target, full, start, limits, CORRECTIONS)
        return sized(size), found

    def final(self, specimen: Specimen) -> float:
        """RMS residual (m or N) of a full refit with all effects hidden in ``specimen``; 0 if there are none.

        The result for a single effect is cached from the search for its strength.
        """
        hidden = specimen.hidden
        key = _key(hidden)
        if hidden and key not in self.ends:
            self._refit(hidden, [end for _, end in self.ends.values()])
        return self.ends[key][0] if hidden else 0.0

    def _refit(self, hidden: Concealed, near: Sequence[Array]) -> float:
        self.ends[_key(hidden)] = self.refit.full(self.change(hidden), rounds=ROUNDS, near=near)
        return self.ends[_key(hidden)][0]

    def division(self) -> float:
        """RMS misfit (m or N) with nothing hidden, after a linearised refit: error of discretisation and solver.

        With equal discretisation only the solvers differ; that difference is small and is not refitted.
        """
        change = stacked(self.refit.recordings) - self.refit.nominal
        return rms(change) if self.coarse.bench is self.bare.bench else self.refit.linear(change)


def _key(hidden: Concealed) -> Hashable:
    return tuple((name, *sorted(values.items())) for name, values in hidden.items())
