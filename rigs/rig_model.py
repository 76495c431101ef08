"""The model of a user's rig: its simulation, with laws at its ports and faults of its channels and inputs added."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wingfit.records import Gene
from wingfit.records.array_types import Array, ArrayLike, Float
from wingfit.records.series import Series, recording_gene
from wingfit.rigs.faults import Channels, Fault, Scales, channel_faults, input_faults
from wingfit.rigs.ports import Law, Values, laws
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run
from wingfit.rigs.suspect import Suspect
from wingfit.sim.model import Observation, genome_batch


class Simulated(NamedTuple):
    """One simulated individual: ``channels`` [T, C] in the units of the recording, NaN if it failed, and why."""

    channels: Float[Array, "T C"]
    reason: str | None


@dataclass(frozen=True, eq=False)
class RigModel:
    """The simulation of ``rig`` with ``effects`` (names of suspects) added, for the recordings ``all_recordings``.

    Recordings matter because some genes belong to a single one (:attr:`Rig.recording_genes`), and because the bounds
    of faults follow from what was recorded.
    """

    rig: Rig
    all_recordings: tuple[Series, ...]
    effects: tuple[str, ...] = ()

    def __getstate__(self) -> dict[str, object]:
        """Pickle the fields alone: laws and faults are made again from them."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @cached_property
    def _faults(self) -> dict[str, Fault]:
        if not self.rig.faults:
            return {}
        scales = Scales.of(self.all_recordings, {**self.rig.channels, **self.rig.inputs})
        return channel_faults(list(self.rig.channels), scales) | input_faults(list(self.rig.inputs), scales)

    @cached_property
    def _laws(self) -> dict[str, tuple[str, Law]]:
        return {name: (port.name, law) for port in self.rig.ports for name, law in laws(port).items()}

    @cached_property
    def suspects(self) -> tuple[Suspect, ...]:
        """All that may be added: the rig's own suspects, laws at its ports, and faults, without :attr:`effects`."""
        every = (
            *self.rig.suspects,
            *(law.suspect for _, law in self._laws.values()),
            *(fault.suspect for fault in self._faults.values()),
        )
        return tuple(suspect for suspect in every if suspect.name not in self.effects)

    @cached_property
    def added(self) -> tuple[Suspect, ...]:
        """The suspects that were added, in the order of :attr:`effects`."""
        known = {suspect.name: suspect for suspect in replace(self, effects=()).suspects}
        return tuple(known[name] for name in self.effects)

    @cached_property
    def genes(self) -> tuple[Gene, ...]:
        """Genes of the nominal model, those of each recording, and those of the effects that were added."""
        added = (gene for suspect in self.added for gene in suspect.genes)
        return (*self.rig.genes, *(gene for one in self.all_recordings for gene in self.genes_of(one)), *added)

    def genes_of(self, recording: Series) -> tuple[Gene, ...]:
        """Return the genes that belong to ``recording`` alone, with its estimates as nominal values."""
        return tuple(
            replace(
                gene,
                name=recording_gene(gene.name, recording.name),
                nominal=recording.estimates.get(gene.name, gene.nominal),
            )
            for gene in self.rig.recording_genes
        )

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of all genes."""
        return tuple(gene.name for gene in self.genes)

    def with_effects(self, *names: str) -> RigModel:
        """Return the model with the suspects ``names`` added, all off; ValueError for an unknown one."""
        known = [suspect.name for suspect in self.suspects]
        for name in names:
            if name not in known:
                raise ValueError(f"unknown suspect {name!r}; rig {self.rig.name!r} has {', '.join(known)}")
        return replace(self, effects=(*self.effects, *names))

    def observe(self, genomes: ArrayLike, recording: Series) -> Observation:
        """Simulate ``genomes`` [B, G] for ``recording``: channels [B, T, C] in the units of the recording."""
        calls, place = self.calls(genomes, recording)
        return observation([self.simulated(values, recording) for values in calls], place)

    def calls(self, genomes: ArrayLike, recording: Series) -> tuple[list[Values], list[int]]:
        """Return the values by name of the individuals to simulate for ``genomes`` [B, G], and which of them each is.

        Individuals that differ only in genes of other recordings are simulated once. Genes of ``recording`` alone have
        the names that they have in the rig.
        """
        batch = genome_batch(self.genes, genomes)
        names = [gene.name for gene in self.genes]
        own = {recording_gene(gene.name, recording.name): gene.name for gene in self.rig.recording_genes}
        of_others = {gene.name for one in self.all_recordings for gene in self.genes_of(one)} - set(own)
        columns = [k for k, name in enumerate(names) if name not in of_others]
        labels = [own.get(names[k], names[k]) for k in columns]
        own_values, known = batch[:, columns], dict[bytes, int]()
        place = [known.setdefault(row.tobytes(), len(known)) for row in own_values]
        rows = dict(zip(place[::-1], own_values[::-1].tolist(), strict=True))
        return [dict(zip(labels, rows[k], strict=True)) for k in range(len(known))], place

    def simulated(self, values: Values, recording: Series) -> Simulated:
        """Simulate one individual with ``values`` by name, as :meth:`calls` gives them, for ``recording``."""
        failed = np.full(recording.values.shape, np.nan)
        off = {gene.name: gene.nominal for suspect in self.rig.suspects for gene in suspect.genes}
        faults = [self._faults[name] for name in self.effects if name in self._faults]
        run = self._run(values, recording)
        for fault in faults:
            run = fault.before(run, values) if fault.before else run
        try:
            channels = _channels(self.rig.simulate({**off, **values}, _copied(run)))
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
            return Simulated(failed, f"the simulation fails: {error}")
        problem = _unusable(channels, recording)
        if problem:
            return Simulated(failed, problem)
        for fault in faults:
            channels = fault.after(channels, run, values) if fault.after else channels
        return Simulated(np.stack([channels[name] for name in recording.channels], axis=1), None)

    def _run(self, values: Values, recording: Series) -> Run:
        at_ports: dict[str, list[Law]] = {}
        for name in self.effects:
            if name in self._laws:
                port, law = self._laws[name]
                if any(values[size] != 0.0 for size in law.suspect.size_genes):  # else its memory is not integrated
                    at_ports.setdefault(port, []).append(law)
        times = recording.times
        return Run(recording.name, times, recording.settings, dict(recording.inputs), times, values, at_ports)


def observation(done: Sequence[Simulated], place: Sequence[int]) -> Observation:
    """Return the observation of individuals; the result of each is that of ``done`` at its ``place``."""
    return Observation(np.stack([done[k].channels for k in place]), tuple(done[k].reason for k in place))


def _copied(run: Run) -> Run:
    """Return ``run`` with arrays of its own: the user's code may change them, and faults are computed from ``run``."""
    inputs = {name: one.copy() for name, one in run.inputs.items()}
    return replace(
        run, times=run.times.copy(), settings=dict(run.settings), inputs=inputs, input_times=run.input_times.copy()
    )


def _channels(returned: object) -> Channels:
    """Return what a simulation ``returned`` as arrays; TypeError if it is no mapping of real numbers by channel."""
    if not isinstance(returned, Mapping):
        kind = type(returned).__name__
        raise TypeError(f"simulate returned {kind}; it must return a dict with the values of each channel by its name")
    for name, one in returned.items():
        if np.iscomplexobj(one):
            raise TypeError(f"simulate returned complex values of {name!r}; return real ones, such as their real part")
    return {name: np.asarray(np.ma.filled(one, np.nan), float) for name, one in returned.items()}


def _unusable(channels: Channels, recording: Series) -> str | None:
    """Return what is wrong with the simulated ``channels``; None if nothing is."""
    count = len(recording.times)
    for name in recording.channels:
        if name not in channels:
            return f"the simulation returned no channel {name!r}, but {', '.join(channels) or 'nothing'}"
        if channels[name].shape != (count,):
            shape = list(channels[name].shape)
            return f"the simulation returned {name!r} with shape {shape}; it needs one value for each of {count} times"
        if not np.isfinite(channels[name]).all():
            return f"the simulated {name} is not finite"
    return None
