"""Are the probabilities of verdicts right? Which verdicts are true, and how many are, by the probability given."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

from benchmarks.concealed.score import WEAK, Mark
from wingfit.diagnosis.finding import NAMING

SURE = 0.95  # probability of a verdict that is given with certainty
EDGES = (0.0, 0.6, 0.8, 0.95, 0.99, 1.0)  # of the bins of probability, the last one closed


def sure(marks: Iterable[Mark]) -> list[Mark]:
    """Scores of the trials whose verdict was given with a probability of at least SURE."""
    return [one for one in marks if one.probability >= SURE]


def verdict_is_right(one: Mark) -> bool | None:
    """Whether the verdict is true; None if what is hidden is too weak for a verdict to be expected.

    A name is right if all that it names is hidden, an ambiguity if what is hidden is one of the alternatives, and
    "unnamed" if what is hidden is not in the library.
    """
    if not one.truth:
        return one.verdict == "adequate"
    if one.group == "drift":  # of which few beats show that there is one, but not which
        return one.verdict == "unnamed" or (one.verdict in NAMING and not one.wrong and bool(one.found))
    if one.strength < WEAK:
        return None
    if one.group in ("unlisted", "smooth") or (one.group == "partly" and one.verdict == "unnamed"):
        return one.verdict == "unnamed"
    if one.verdict == "ambiguous":
        return bool(one.among)
    return one.verdict in NAMING and not one.wrong and bool(one.found)


def bins_of(marks: Iterable[Mark]) -> list[dict[str, float | int]]:
    """Reliability of verdicts: number, mean probability and share that is true (both per cent), for each bin."""
    known = [(one.probability, true) for one in marks if (true := verdict_is_right(one)) is not None]
    found = list[dict[str, float | int]]()
    for low, high in pairwise(EDGES):
        inside = [(p, true) for p, true in known if low <= p < high or (high == EDGES[-1] and p >= high)]
        if inside:
            mean, share = (100 * sum(map(float, column)) / len(inside) for column in zip(*inside, strict=True))
            found.append({"n": len(inside), "said_percent": round(mean, 1), "right_percent": round(share, 1)})
    return found
