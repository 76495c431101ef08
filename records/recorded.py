"""What all datasets have in common: recordings by name, some of them held out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, Protocol, TypeVar


class _Named(Protocol):
    @property
    def name(self) -> str: ...


R = TypeVar("R", bound=_Named)


class Recorded(Generic[R]):
    """Recordings of one dataset; those named in ``held_out`` are used for validation only, never for fitting."""

    name: str
    recordings: tuple[R, ...]
    held_out: tuple[str, ...]

    def recording(self, name: str) -> R:
        """Return the recording called ``name``; ValueError if there is none."""
        for recording in self.recordings:
            if recording.name == name:
                return recording
        raise ValueError(
            f"no recording {name!r} in dataset {self.name!r}; it has {', '.join(r.name for r in self.recordings)}"
        )

    def select(self, names: Iterable[str]) -> tuple[R, ...]:
        """Return the recordings called ``names``, in the order of ``names``; ValueError for an unknown name."""
        return tuple(self.recording(name) for name in names)

    @property
    def fitted(self) -> tuple[R, ...]:
        """Return the recordings that may be fitted: all that are not held out."""
        return tuple(r for r in self.recordings if r.name not in self.held_out)
