"""Where a misfit lies, as it enters a finding."""

from __future__ import annotations

from dataclasses import dataclass

from wingfit.diagnosis.finding import (
    ChannelMisfit,
    FreeLaw,
    MarkerMisfit,
    MissingLoad,
    Overlay,
    PhaseMap,
    Table,
    Where,
)


@dataclass(frozen=True)
class Located:
    """Where the misfit of the nominal model lies, and what remains of it: see :class:`Finding` for each."""

    where: Where
    overlays: tuple[Overlay, ...] = ()
    markers: tuple[MarkerMisfit, ...] = ()
    phase_map: PhaseMap | None = None
    missing: tuple[MissingLoad, ...] = ()
    law: FreeLaw | None = None
    outline: Table = ()
    channels: tuple[ChannelMisfit, ...] = ()
