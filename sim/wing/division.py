"""Discretisation of a wing: strips along the span, divided into rigid bodies along the chord (thesis Fig. 7)."""

from __future__ import annotations

from dataclasses import dataclass

PRESETS = {"4": (1, 1, 1, 1), "11": (3, 3, 3, 2), "24": (4, 4, 4, 4, 4, 4)}
MAX_STRIPS, MAX_CHORDWISE, MAX_BODIES = 64, 16, 128


@dataclass(frozen=True)
class Division:
    """A discretisation: number of bodies along the chord in each strip, root first."""

    bodies: tuple[int, ...]

    @classmethod
    def parse(cls, text: str) -> Division:
        """Read a discretisation from text; ValueError if it is not valid.

        ``text`` is a preset ("4", "11", "24"), strips x bodies along the chord ("6x4"), or the number of bodies of each
        strip from the root ("3,3,3,2").
        """
        if text in PRESETS:
            return cls(PRESETS[text])
        try:
            if "x" in text:
                strips, chordwise = (int(part) for part in text.split("x"))
                if not 1 <= strips <= MAX_STRIPS:
                    raise ValueError
                counts: tuple[int, ...] = (chordwise,) * strips
            else:
                counts = tuple(int(part) for part in text.split(","))
        except ValueError:
            counts = ()
        good = 2 <= len(counts) <= MAX_STRIPS and all(1 <= n <= MAX_CHORDWISE for n in counts)
        good = good and sum(counts) <= MAX_BODIES
        if not good:
            raise ValueError(
                f"division {text!r} is not valid; give a preset ({', '.join(PRESETS)}), strips x bodies along the "
                f"chord such as 6x4, or bodies per strip from the root such as 3,3,3,2 "
                f"(2 to {MAX_STRIPS} strips of 1 to {MAX_CHORDWISE} bodies, at most {MAX_BODIES} bodies in all)"
            )
        return cls(counts)

    @property
    def total(self) -> int:
        """Number of bodies."""
        return sum(self.bodies)

    def index(self, strip: int, chordwise: int) -> int:
        """Index of body ``chordwise`` (0 at the leading edge) of ``strip`` (0 at the root) among all bodies."""
        return sum(self.bodies[:strip]) + chordwise
