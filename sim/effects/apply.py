"""Apply effects on an observation to the individuals for which they are on."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from wingfit.records import Gene
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.ports.observation import Sampling

Array = npt.NDArray[np.float64]


def observed(effects: Iterable[Effect], genes: tuple[Gene, ...], genomes: Array, kind: str) -> list[Effect]:
    """Effects on observations of ``kind`` ("tracks", "forces") that are on in at least one of ``genomes`` [B, G]."""
    return [e for e in effects if e.observe and kind in e.observed and not e.off(e.values(genes, genomes)).all()]


def apply(effects: Iterable[Effect], genes: tuple[Gene, ...], genomes: Array, sampling: Sampling) -> None:
    """Change ``sampling`` by each effect in turn, only for those of ``genomes`` [B, G] in which it is on."""
    for effect in effects:
        values = effect.values(genes, genomes)
        on = np.flatnonzero(~effect.off(values))
        if effect.observe is None or not len(on):
            continue
        times, added = sampling.times[on].copy(), sampling.added[on].copy()
        part = Sampling(sampling.rig, sampling.recording, sampling.beat[on], times, added)
        effect.observe(part, {name: value[on] for name, value in values.items()})
        sampling.beat[on], sampling.times[on], sampling.added[on] = part.beat, part.times, part.added
