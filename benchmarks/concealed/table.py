"""Summary of the scores of all blind trials: rates with counts and Wilson intervals, as a table and as JSON."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from benchmarks.concealed.calibration import bins_of, sure, verdict_is_right
from benchmarks.concealed.exhaustive import Compared
from benchmarks.concealed.score import BINS, WEAK, Mark
from wingfit.sim.effects.registry import EFFECTS

NORMAL_90 = 1.6448536269514722


@dataclass(frozen=True)
class Rate:
    """Proportion of ``hits`` among ``n`` cases, with the 90 % confidence interval of Wilson (1927)."""

    hits: int
    n: int

    @property
    def percent(self) -> float | None:
        """``hits`` / ``n`` in per cent; None if n is 0."""
        return round(100 * self.hits / self.n, 1) if self.n else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """90 % confidence interval (low, high) of the rate, per cent (Wilson 1927); None if n is 0."""
        if not self.n:
            return None
        z, p, n = NORMAL_90, self.hits / self.n, self.n
        middle, spread = p + z * z / (2 * n), z * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        low, high = ((middle + sign * spread) / (1 + z * z / n) for sign in (-1, 1))
        return round(100 * max(low, 0.0), 1), round(100 * min(high, 1.0), 1)

    def __str__(self) -> str:
        if self.interval is None:
            return "none"
        low, high = self.interval
        return f"{self.percent:5.1f} %  ({self.hits} of {self.n}; {low:.1f} to {high:.1f} %)"


def rate(marks: Iterable[Mark], good: Callable[[Mark], bool | None]) -> Rate:
    """Rate of the scores for which ``good`` returns True, among those for which it does not return None."""
    known = [bool(found) for one in marks if (found := good(one)) is not None]
    return Rate(sum(known), len(known))


def of(marks: Iterable[Mark], group: str) -> list[Mark]:
    """Scores among ``marks`` of the trials of one ``group``."""
    return [one for one in marks if one.group == group]


def at(marks: Iterable[Mark], d: int) -> list[Mark]:
    """Scores among ``marks`` whose strength (misfit / noise) lies in the bin ``d`` of BINS."""
    low, high = BINS[d]
    return [one for one in marks if low <= one.strength < high]


def seen(marks: Iterable[Mark]) -> list[Mark]:
    """Scores of the trials whose hidden effect is strong enough to count: its strength is at least ``WEAK``."""
    return [one for one in marks if one.strength >= WEAK]


@dataclass(frozen=True)
class Advised:
    """A trial whose first diagnosis was ambiguous, and whether one more recording resolved it.

    Attributes:
        truth: names of the hidden effects.
        verdict, named: of the first diagnosis.
        advice: the recording that it recommended, in words; None if it recommended none.
        resolved: whether the diagnosis named the truth after that recording.
        by_chance: whether it did so after a recording under a random condition instead.
    """

    trial: str
    truth: tuple[str, ...]
    verdict: str
    named: tuple[str, ...]
    advice: str | None
    resolved: bool
    by_chance: bool


@dataclass(frozen=True)
class Table:
    """All scores of one method.

    ``marks``: one score per trial; ``advised``: trials whose first diagnosis was ambiguous; ``advice_trials``: number
    of trials that were designed to be ambiguous; ``seconds``: duration of the test with this method; ``compared``: the
    searches that were compared with an exhaustive one.
    """

    marks: tuple[Mark, ...]
    advised: tuple[Advised, ...]
    advice_trials: int
    seconds: float
    compared: tuple[Compared, ...] = ()

    @property
    def rates(self) -> dict[str, Rate]:
        """Every rate of the table, by the name of its row."""
        listed, unlisted = of(self.marks, "listed"), seen(of(self.marks, "unlisted"))
        return {
            "null: false alarms": rate(of(self.marks, "null"), lambda m: m.alarm),
            **{f"listed, d = {d}: top-1": rate(at(listed, d), lambda m: m.first) for d in BINS},
            **{f"listed, d = {d}: exact": rate(at(listed, d), lambda m: m.exact) for d in BINS},
            **{
                f"listed, {kind}: top-1": rate(seen(of_kind(listed, kind)), lambda m: m.first) for kind in kinds(listed)
            },
            "unlisted: detected": rate(unlisted, lambda m: m.verdict not in ("adequate", "failed")),
            "unlisted: left unnamed": rate(unlisted, lambda m: m.verdict == "unnamed"),
            **{
                f"unlisted, {kind}: unnamed": rate(of_kind(unlisted, kind), lambda m: m.verdict == "unnamed")
                for kind in kinds(unlisted)
            },
            "smooth: wrong name": rate(seen(of(self.marks, "smooth")), lambda m: m.wrong),
            "smooth: left unnamed": rate(seen(of(self.marks, "smooth")), lambda m: m.verdict == "unnamed"),
            "drift: adequate": rate(of(self.marks, "drift"), lambda m: m.verdict == "adequate"),
            "said with 95 %: right": rate(sure(self.marks), verdict_is_right),
            "measurement: right side": rate(seen(of(self.marks, "measurement")), lambda m: m.right_side),
            "pairs: both": rate(of(self.marks, "pairs"), lambda m: m.found == 2),
            "every: top-1": rate(seen(of(self.marks, "every")), lambda m: m.first),
            "every: wrong name": rate(of(self.marks, "every"), lambda m: m.wrong),
            "partly: the part alone": rate(of(self.marks, "partly"), part_is_right),
            "partly: left unnamed": rate(of(self.marks, "partly"), lambda m: m.verdict == "unnamed"),
            "pairs: at least one": rate(of(self.marks, "pairs"), lambda m: (m.found or 0) >= 1),
            "all: wrong name": rate(self.marks, lambda m: m.wrong),
            "held out: worse": rate(self.hiding, lambda m: m.worse),
            "intervals: hold the truth": self.coverage,
            "advice: resolved": Rate(sum(one.resolved for one in self.advised), len(self.advised)),
            "advice: by a random recording": Rate(sum(one.by_chance for one in self.advised), len(self.advised)),
            "search: best hypothesis found": Rate(sum(one.found for one in self.compared), len(self.compared)),
            "plant finer than the model": rate(self.marks, lambda m: m.finer),
            **{
                f"{where}: {what}": rate([one for one in of(self.marks, group) if of_rig(one) == where], good)
                for where in sorted({of_rig(one) for one in self.marks})
                for group, what, good in BY_RIG
            },
        }

    @property
    def compared_by_rig(self) -> dict[str, int]:
        """Number of searches that were compared with an exhaustive one, by rig."""
        rigs = {one.trial: one.rig for one in self.marks}
        return dict(Counter(rigs[one.trial] for one in self.compared))

    @property
    def hiding(self) -> list[Mark]:
        """Scores of trials with a hidden effect."""
        return [one for one in self.marks if one.truth]

    @property
    def coverage(self) -> Rate:
        """Rate at which 90 % intervals contain the truth, over all trials."""
        return Rate(sum(one.covered for one in self.marks), sum(one.intervals for one in self.marks))

    @property
    def failures(self) -> list[dict[str, Any]]:
        """Every trial with a wrong result or useless advice, and what is wrong with it, for the JSON output."""
        known = [(one, what) for one in self.marks if (what := wrongs(one))]
        wrong = [
            {
                "trial": one.trial,
                "group": one.group,
                "rig": one.rig,
                "truth": list(one.truth),
                "d": round(one.strength, 2),
                "verdict": one.verdict,
                "named": list(one.named),
                "top": list(one.top),
                "what": what,
            }
            for one, what in known
        ]
        return wrong + [
            {**asdict(one), "group": "advice", "what": "the advised recording did not resolve it"}
            for one in self.advised
            if not one.resolved
        ]

    def as_json(self) -> dict[str, Any]:
        """The figures of the JSON output, under the names documented in docs/concealed.md."""
        rates, marks = self.rates, self.marks
        return {
            "null": {"n": len(of(marks, "null")), "false_alarms": rates["null: false alarms"].hits},
            "listed": {
                "n": len(of(marks, "listed")),
                "top1_percent_d2": rates["listed, d = 2: top-1"].percent,
                "top1_percent_d5": rates["listed, d = 5: top-1"].percent,
                "exact_percent_d2": rates["listed, d = 2: exact"].percent,
            },
            "unlisted": {
                "n": rates["unlisted: detected"].n,
                "detected_percent": rates["unlisted: detected"].percent,
                "unnamed_percent": rates["unlisted: left unnamed"].percent,
            },
            "smooth_unlisted": {
                "n": rates["smooth: wrong name"].n,
                "wrong_percent": rates["smooth: wrong name"].percent,
                "unnamed_percent": rates["smooth: left unnamed"].percent,
            },
            "every": {
                "n": len(of(self.marks, "every")),
                "seen": rates["every: top-1"].n,
                "top1_percent": rates["every: top-1"].percent,
                "wrong_percent": rates["every: wrong name"].percent,
            },
            "partly": {
                "n": rates["partly: the part alone"].n,
                "right_percent": rates["partly: the part alone"].percent,
                "unnamed_percent": rates["partly: left unnamed"].percent,
            },
            "drift": {"n": rates["drift: adequate"].n, "adequate_percent": rates["drift: adequate"].percent},
            "calibration": {
                "said_95": rates["said with 95 %: right"].n,
                "right_percent": rates["said with 95 %: right"].percent,
                "bins": bins_of(self.marks),
            },
            "by_plant": {name: figures_of(marks) for name, marks in by_plant(self.marks).items()},
            "measurement": {
                "n": rates["measurement: right side"].n,
                "right_percent": rates["measurement: right side"].percent,
            },
            "wrong_name_percent": rates["all: wrong name"].percent,
            "heldout_over_floor_median": median(
                m.held_out for m in self.hiding if m.group not in ("unlisted", "smooth", "drift", "partly")
            ),
            "heldout_worse_percent": rates["held out: worse"].percent,
            "coverage_percent": self.coverage.percent,
            "place": {
                "span_R": median(m.span for m in seen(self.hiding)),
                "chord_c": median(m.chord for m in seen(self.hiding)),
                "phase_deg": median(m.phase for m in seen(self.hiding)),
            },
            "pairs": {
                "n": rates["pairs: both"].n,
                "both_percent": rates["pairs: both"].percent,
                "one_percent": rates["pairs: at least one"].percent,
            },
            "advice": {
                "n": len(self.advised),
                "resolved_percent": rates["advice: resolved"].percent,
                "random_percent": rates["advice: by a random recording"].percent,
            },
            "search": {
                "n": rates["search: best hypothesis found"].n,
                "best_found_percent": rates["search: best hypothesis found"].percent,
                "missed": [asdict(one) for one in self.compared if not one.found],
            },
            "rates": {name: [one.hits, one.n, one.interval] for name, one in rates.items() if one.n},
            "failures": self.failures,
            "seconds": round(self.seconds, 1),
        }

    def rows(self) -> dict[str, str]:
        """The rows of the printed table: value as text by name of the row."""
        figures = self.as_json()
        place = figures["place"]
        return {
            **{name: str(found) for name, found in self.rates.items() if found.n},
            "held-out misfit over floor": f"median {figures['heldout_over_floor_median']}",
            "place": f"medians {place['span_R']} R, {place['chord_c']} c, {place['phase_deg']} degrees",
            f"too weak to count (d < {WEAK})": str(
                len([m for m in self.hiding if m.group != "drift" and m.strength < WEAK])
            ),
            "advice: ambiguous at first": f"{len(self.advised)} of {self.advice_trials} trials",
            "failures": str(len(figures["failures"])),
            "seconds of a trial": f"median {median(m.seconds for m in self.marks)}",
        }


def side_by_side(tables: Mapping[str, Table]) -> str:
    """The printed text of the tables of several methods, one column per method, headed by its name."""
    columns = {name: table.rows() for name, table in tables.items()}
    names = dict.fromkeys(row for column in columns.values() for row in column)
    lines = [["", *columns], *([name, *(column.get(name, "") for column in columns.values())] for name in names)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    padded = [[f"{cell:{width}}" for cell, width in zip(line, widths, strict=True)] for line in lines]
    return "\n".join("  ".join(line).rstrip() for line in padded)


def wrongs(one: Mark) -> str:
    """Description of all that is wrong with the result of one trial; "" if nothing is."""
    if one.verdict == "failed":
        return f"no finding: {one.remark}"
    mistakes = list[str]()
    if not one.truth:
        return "false alarm" if one.alarm else ""
    if one.strength < WEAK and one.group not in ("pairs", "drift"):
        pass
    elif one.group == "drift":
        mistakes += ["adequate"] * (one.verdict == "adequate")
    elif one.group in ("unlisted", "smooth"):
        mistakes += ["not detected" if one.verdict == "adequate" else "not left unnamed"] * (one.verdict != "unnamed")
    elif one.group == "measurement":
        mistakes += ["wrong side"] * (not one.right_side)
    elif one.group == "partly":
        mistakes += ["not the part alone"] * (not part_is_right(one))
    elif one.group == "pairs":
        mistakes += ["not both"] * ((one.found or 0) < len(one.truth))
    else:
        mistakes += ["not first"] * (not one.first) + ["not exactly named"] * (not one.exact)
    mistakes += ["wrong name"] * one.wrong + ["held-out misfit grew"] * bool(one.worse)
    return "; ".join(mistakes)


def of_rig(one: Mark) -> str:
    """Label of a trial's rig with the discretisations of model and plant: "wing 4 of 8x1" is model 4, plant 8x1."""
    return f"{one.rig} {one.division} of {one.plant}".removesuffix("  of ")


def by_plant(marks: Iterable[Mark]) -> dict[str, list[Mark]]:
    """Scores by what was simulated: which wing or vehicle, and the discretisations of model and plant."""
    found = dict[str, list[Mark]]()
    for one in sorted(marks, key=lambda m: (m.body, of_rig(m))):
        found.setdefault(f"{one.body}: {of_rig(one)}", []).append(one)
    return found


def figures_of(marks: Sequence[Mark]) -> dict[str, float | int | None]:
    """Figures of the trials of one plant, as in the JSON output; percentages are None where no trial counts."""
    known, unlisted = seen(of(marks, "listed")), seen([*of(marks, "unlisted"), *of(marks, "smooth")])
    return {
        "n": len(marks),
        "null": len(of(marks, "null")),
        "false_alarms": rate(of(marks, "null"), lambda m: m.alarm).hits,
        "top1_percent": rate(known, lambda m: m.first).percent,
        "exact_percent": rate(known, lambda m: m.exact).percent,
        "unlisted_unnamed_percent": rate(unlisted, lambda m: m.verdict == "unnamed").percent,
        "wrong_name_percent": rate(marks, lambda m: m.wrong).percent,
        "said_95": len([one for one in sure(marks) if verdict_is_right(one) is not None]),
        "said_95_right_percent": rate(sure(marks), verdict_is_right).percent,
    }


def part_is_right(one: Mark) -> bool:
    """Whether the verdict is that a part is certain, and names just what is hidden of the library."""
    return one.verdict == "partly named" and set(one.named) == {name for name in one.truth if name in EFFECTS}


def right(one: Mark) -> bool | None:
    """Whether nothing is wrong with the result of a trial; None if its hidden effect is too weak to count."""
    return None if one.truth and one.strength < WEAK else not wrongs(one)


BY_RIG: tuple[tuple[str, str, Callable[[Mark], bool | None]], ...] = (
    ("null", "nulls without false alarm", lambda m: not m.alarm),
    ("listed", "listed, correct", right),
    ("unlisted", "unlisted, left unnamed", lambda m: None if m.strength < WEAK else m.verdict == "unnamed"),
    ("measurement", "measurement, right side", lambda m: None if m.strength < WEAK else m.right_side),
    ("pairs", "pairs, both found", lambda m: m.found == 2),
)


def kinds(marks: Sequence[Mark]) -> list[str]:
    """Names of all effects hidden in the trials of ``marks``, sorted."""
    return sorted({name for one in marks for name in one.truth})


def of_kind(marks: Iterable[Mark], name: str) -> list[Mark]:
    """Scores among ``marks`` of the trials in which the effect ``name`` was hidden."""
    return [one for one in marks if name in one.truth]


def median(values: Iterable[float | None]) -> float | None:
    """Median of the values that are not None, rounded to 4 decimals; None if it is infinite or there are none."""
    known = [value for value in values if value is not None]
    middle = float(np.median(known)) if known else math.inf
    return round(middle, 4) if math.isfinite(middle) else None
