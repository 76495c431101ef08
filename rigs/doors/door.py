"""What all doors share: the error of a broken door, names, and the checks of an answer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from wingfit.records.array_types import Array
from wingfit.rigs.run import Run, SimulationError

SHOWN = 300  # characters of an answer or of an error output that a message shows


class DoorError(OSError):
    """Raised where no simulation is possible: no such program, no connection, an answer of the wrong form.

    The message says what to do. It ends a diagnosis, unlike
    :class:`wingfit.rigs.run.SimulationError`, which is the failure of one individual.
    """


def named(names: Sequence[str] | Mapping[str, str], what: str) -> dict[str, str]:
    """Return the simulator's name for each of ``names``; a sequence means that both names are the same."""
    if isinstance(names, str):
        raise DoorError(f"{what} is the text {names!r}; give a list of names, such as [{names!r}]")
    return dict(names) if isinstance(names, Mapping) else {name: name for name in names}


def value_of(name: str, genes: Mapping[str, float], run: Run) -> float:
    """Return the value of the gene ``name``, or of the setting of that name; DoorError if there is neither."""
    if name in genes:
        return float(genes[name])
    if name in run.settings:
        return float(run.settings[name])
    have = ", ".join([*genes, *run.settings]) or "none"
    raise DoorError(
        f"{name!r} is neither a gene of the rig nor a setting of recording {run.recording!r}; it has {have}"
    )


def checked(answer: Mapping[str, Any], names: Iterable[str], count: int, source: str) -> dict[str, Array]:
    """Return the channels ``names`` of ``answer``, each [T] with T = ``count``, in the channel's unit.

    DoorError if one is missing, holds something other than numbers, or has another shape; SimulationError if a value is
    not finite (null counts as such).
    """
    return {name: _channel(answer, name, count, source) for name in names}


def _channel(answer: Mapping[str, Any], name: str, count: int, source: str) -> Array:
    if name not in answer:
        have = ", ".join(map(str, answer)) or "nothing"
        raise DoorError(f"{source} returned no channel {name!r}, but {have}; return it, or take it out of channels")
    try:
        values = np.asarray(answer[name], float)
    except (TypeError, ValueError) as error:
        raise DoorError(f"{source} returned something other than numbers for {name!r}: {error}") from error
    if values.shape != (count,):
        raise DoorError(
            f"{source} returned {name!r} with shape {list(values.shape)}; return one value for each of the "
            f"{count} times that it was given"
        )
    if not np.isfinite(values).all():
        raise SimulationError(f"{name} is not finite from time {int(np.argmin(np.isfinite(values))) + 1} of {count} on")
    return values


def short(text: str, end: bool = False) -> str:
    """Return ``text`` in one line, at most SHOWN characters: the first ones, or with ``end`` the last ones."""
    line = " / ".join(part.strip() for part in text.splitlines() if part.strip())
    if len(line) <= SHOWN:
        return line
    return f"... {line[-SHOWN:]}" if end else f"{line[:SHOWN]} ..."
