"""A rig that the user simulates: genes, channels, what may be missing, and a function that simulates one recording."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields

from wingfit.records import Gene
from wingfit.records.array_types import Array
from wingfit.rigs.ports import Port
from wingfit.rigs.run import Run
from wingfit.rigs.suspect import Suspect

JOINTS = "+,"  # characters that join the names of effects in findings and commands
Simulate = Callable[[Mapping[str, float], Run], Mapping[str, Array]]
"""Simulates the :class:`Run` with the values of all genes by name, those of suspects included (zero: off); returns the
values [T] of each channel at ``run.times``, in the channel's unit. Raises ValueError where that is impossible."""


@dataclass(frozen=True)
class Rig:
    """A rig with a simulation of the user's own.

    Attributes:
        name: of the rig.
        genes: parameters of the nominal model that are fitted, each one value for all recordings.
        channels: unit of each channel that ``simulate`` returns, by name.
        simulate: see :data:`Simulate`. The same arguments must give the same numbers.
        suspects: effects that may be missing; ``simulate`` implements them, exactly off while their sizes are zero.
        recording_genes: parameters with a value of their own in each recording, such as an initial angle; a recording's
            ``estimates`` replace the nominal value.
        inputs, settings: units of the inputs and settings that ``simulate`` uses, by name.
        ports: where laws may act (:meth:`Run.force`); each adds dry friction, damping, stiffness and others as
            suspects.
        faults: whether faults of the channels and inputs (gain, delay and so on) are suspects as well.
        description: the nominal model in one line, for reports.
        reference: where the rig was loaded from (:func:`wingfit.rigs.load.load_rig`), so that other processes can load
            it; "" if it was not.
    """

    name: str
    genes: Sequence[Gene]
    channels: Mapping[str, str]
    simulate: Simulate
    suspects: Sequence[Suspect] = ()
    recording_genes: Sequence[Gene] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, str] = field(default_factory=dict)
    ports: Sequence[Port] = ()
    faults: bool = True
    description: str = ""
    reference: str = ""

    def __reduce__(self) -> str | tuple[object, ...]:
        """Pickle a rig that was loaded without its function, which may not be importable elsewhere."""
        from wingfit.rigs.load import load_rig, reload_rig  # it imports this module

        if not self.reference or load_rig(self.reference).simulate is not self.simulate:
            return super().__reduce__()
        return reload_rig, ({one.name: getattr(self, one.name) for one in fields(self) if one.name != "simulate"},)

    def __post_init__(self) -> None:
        for name, kind in (("genes", Gene), ("suspects", Suspect), ("recording_genes", Gene), ("ports", Port)):
            parts = tuple(getattr(self, name))
            if wrong := [part for part in parts if not isinstance(part, kind)]:
                raise TypeError(
                    f"rig {self.name!r}: {name} has {wrong[0]!r}; give a list of wingfit.{kind.__name__} objects"
                )
            object.__setattr__(self, name, parts)
        for name in ("channels", "inputs", "settings"):
            if not isinstance(getattr(self, name), Mapping):
                raise TypeError(
                    f"rig {self.name!r}: {name} is {getattr(self, name)!r}; give a unit for each name, such as "
                    "{'angle': 'rad'}"
                )
        if not (self.genes or self.recording_genes):
            raise ValueError(f"rig {self.name!r} has no gene; give at least one parameter to fit")
        if not self.channels:
            raise ValueError(f"rig {self.name!r} has no channel; give the unit of each, such as {{'angle': 'rad'}}")
        if not callable(self.simulate):
            raise ValueError(f"rig {self.name!r}: simulate is {self.simulate!r}; give a function of (genes, run)")
        self._check_names()
        own = [gene.name for gene in (*self.genes, *self.recording_genes)]
        for port in self.ports:
            if port.stiffness and port.stiffness not in own:
                raise ValueError(
                    f"port {port.name!r}: its stiffness {port.stiffness!r} is no gene of rig {self.name!r}"
                )

    def _check_names(self) -> None:
        """ValueError for a name that is used twice, or a gene that is called as one of a single recording."""
        genes = [gene.name for gene in (*self.genes, *self.recording_genes)]
        genes += [gene.name for suspect in self.suspects for gene in suspect.genes]
        for what, names in (
            ("gene", genes),
            ("suspect", [suspect.name for suspect in self.suspects]),
            ("port", [port.name for port in self.ports]),
        ):
            twice = [name for name, times in Counter(names).items() if times > 1]
            if twice:
                raise ValueError(f"rig {self.name!r} has {what} {twice[0]!r} twice; give each a name of its own")
            strange = [name for name in names if not name.strip() or not name.isprintable() or set(name) & set(JOINTS)]
            if strange:
                raise ValueError(
                    f"rig {self.name!r} has {what} {strange[0]!r}; a name needs printable characters and none of "
                    f"{JOINTS!r}, which join names: rename it"
                )
        bracketed = [name for name in genes if "[" in name]
        if bracketed:
            raise ValueError(
                f"rig {self.name!r}: gene {bracketed[0]!r} has a bracket, like genes of single recordings; rename it"
            )
        both = sorted(set(self.channels) & set(self.inputs))
        if both:
            raise ValueError(f"rig {self.name!r}: {both[0]!r} is a channel and an input; give one of them another name")


def required_rig(rig: object) -> Rig:
    """Return ``rig``; TypeError if it is something else, such as the path of the file that defines it."""
    if not isinstance(rig, Rig):
        raise TypeError(
            f"rig is a {type(rig).__name__}; give a wingfit.Rig, such as the one that its file defines: "
            "wingfit.rigs.load.load_rig('my_rig.py')"
        )
    return rig
