"""Apply the faults of a measurement to simulated beats, and find the individuals in which an effect is on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import compress

import numpy as np

from wingfit.records import Gene
from wingfit.records.array_types import Array, Index
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.ports.observation import Sampling


def by_active(
    effects: Sequence[Effect], genes: tuple[Gene, ...], genomes: Array
) -> list[tuple[tuple[Effect, ...], list[int]]]:
    """Group ``genomes`` [B, G] by the ``effects`` that are on; return these effects and the genomes' indices."""
    on = np.array([effect.on(genes, genomes) for effect in effects], bool).reshape(len(effects), len(genomes))
    groups: dict[bytes, list[int]] = {}
    for k, active in enumerate(on.T):
        groups.setdefault(active.tobytes(), []).append(k)
    return [(tuple(compress(effects, on[:, members[0]])), members) for members in groups.values()]


def affected(effects: Iterable[Effect], genes: tuple[Gene, ...], genomes: Array) -> Index:
    """Return the indices of ``genomes`` [B, G] (columns: ``genes``) in which a fault of the measurement is on."""
    on = [effect.on(genes, genomes) for effect in effects if effect.observe]
    return np.flatnonzero(np.any(on, axis=0)) if on else np.empty(0, np.intp)


def apply(effects: Iterable[Effect], genes: tuple[Gene, ...], genomes: Array, sampling: Sampling) -> None:
    """Change ``sampling`` by each fault of the measurement, for those ``genomes`` [B, G] in which it is on."""
    for effect in effects:
        if effect.observe is None or not len(on := np.flatnonzero(effect.on(genes, genomes))):
            continue
        times, added = sampling.times[on].copy(), sampling.added[on].copy()
        part = Sampling(sampling.rig, sampling.recording, sampling.beat[on], times, added, sampling.cameras)
        effect.observe(part, effect.values(genes, genomes[on]))
        sampling.beat[on], sampling.times[on], sampling.added[on] = part.beat, part.times, part.added
