"""A stated model of a person: how long typing, pointing, thinking and reading take.

The keystroke-level model of Card, Moran and Newell (1983), The Psychology of Human-Computer Interaction, ch. 8:
K = 0.28 s for a keystroke of an average typist, P = 1.1 s to point with a mouse, B = 0.1 s to press or release its
button, H = 0.4 s to move a hand between mouse and keyboard, M = 1.35 s to prepare a step. Text is read at 200 words a
minute, each word once, numbers included; of a table, the first five rows, because the others look alike. Machines are
waited for.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

KEY, POINT, BUTTON, HOME, THINK = 0.28, 1.1, 0.1, 0.4, 1.35
WORDS_PER_MINUTE = 200.0
KINDS = ("hands", "thought", "reading", "machine")
ROWS = 5  # of a table that are read
COLUMNS = 3  # a line with as many, two spaces or a tab apart, is a row of a table


def words(text: str) -> int:
    """Return the words in ``text``: what stands between spaces and has a letter or a digit."""
    return sum(1 for word in text.split() if re.search(r"\w", word))


def skimmed(text: str) -> str:
    """Return ``text`` without further rows of tables: those behind the header and the first ROWS."""
    kept, row = [], 0
    for line in text.splitlines():
        row = row + 1 if len(re.split(r"\s{2,}|\t", line.strip())) >= COLUMNS else 0
        if row <= ROWS + 1:
            kept.append(line)
    return "\n".join(kept)


@dataclass
class Person:
    """Sums the seconds of each kind, and counts steps, keys, clicks and words."""

    seconds: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("hands", "thought", "reading", "machine"), 0.0)
    )
    steps: int = 0
    keys: int = 0
    clicks: int = 0
    read: int = 0
    skipped: int = 0

    def types(self, count: int) -> None:
        """One step: prepare it, move the hands to the keyboard, and press ``count`` keys."""
        self.steps, self.keys = self.steps + 1, self.keys + count
        self.seconds["thought"] += THINK
        self.seconds["hands"] += HOME + KEY * count

    def clicks_on(self, places: int = 1) -> None:
        """One step: prepare it, and click on ``places`` after one another, such as a list and an entry in it."""
        self.steps, self.clicks = self.steps + 1, self.clicks + places
        self.seconds["thought"] += THINK
        self.seconds["hands"] += HOME + places * (POINT + 2 * BUTTON)

    def reads(self, text: str) -> None:
        """Read ``text`` once, without further rows of tables."""
        count = words(skimmed(text))
        self.skipped += words(text) - count
        self.read += count
        self.seconds["reading"] += 60.0 * count / WORDS_PER_MINUTE

    def waits(self, seconds: float) -> None:
        """Wait for the machine."""
        self.seconds["machine"] += seconds

    def summary(self) -> dict[str, float]:
        """Return minutes in all, the seconds of each kind, and the counts."""
        parts = {f"{kind}_s": round(value, 1) for kind, value in self.seconds.items()}
        counts = {"steps": self.steps, "keys": self.keys, "clicks": self.clicks, "words": self.read}
        minutes = sum(self.seconds.values()) / 60
        every = minutes + self.skipped / WORDS_PER_MINUTE
        return {"minutes": round(minutes, 2), "minutes_if_all_rows_are_read": round(every, 2), **parts, **counts}
