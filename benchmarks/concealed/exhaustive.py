"""Compares the search of the diagnosis with an exhaustive one: every suspect and every pair of suspects is fitted.

Both get the same suspects: those that the first diagnosis of a trial put first. The exhaustive search of the whole
library would take days.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import islice

from benchmarks.concealed.run_diagnosis import Outcome, Task
from benchmarks.concealed.running import Folders, diagnosed, task
from benchmarks.concealed.trials import Trial
from wingfit.diagnosis.finding import Finding, Hypothesis

TRIALS = {"vehicle": 40, "wing": 20}  # compared at most; a wing takes ten times as long
SUSPECTS = {"vehicle": 16, "wing": 8}
GROUPS = ("unlisted", "smooth", "listed", "pairs", "measurement")  # those compared
SAME = 0.5  # natural logarithm: evidence that two fits of the same hypothesis may differ by


@dataclass(frozen=True)
class Compared:
    """One trial: the best hypotheses of the two searches, and by how much the evidence of the default one is less.

    None if one of the two failed.
    """

    trial: str
    best: tuple[str, ...]
    default: tuple[str, ...]
    behind: float | None

    @property
    def found(self) -> bool:
        """Whether the default search found the best hypothesis, or one with as much evidence."""
        return self.behind is not None and self.behind <= SAME


def compare(
    tool: Executor,
    trials: Sequence[Trial],
    first: Mapping[str, Outcome],
    folders: Folders,
    before: Mapping[str, int],
) -> tuple[Compared, ...]:
    """Search with all pairs, and by default, in trials whose ``first`` diagnosis did not find the model adequate.

    ``before``: number of trials that other parts of the test have compared, by rig.
    """
    pairs = [pair for one in _chosen(trials, first, before) for pair in _tasks(one, first[one.name], folders)]
    outcomes = diagnosed(tool, pairs, folders, "comparing with an exhaustive search")
    both = zip(outcomes[::2], outcomes[1::2], strict=True)
    return tuple(_compared(default, every) for default, every in both)


def _chosen(trials: Sequence[Trial], first: Mapping[str, Outcome], before: Mapping[str, int]) -> list[Trial]:
    found = list[Trial]()
    for rig, count in TRIALS.items():
        fit = (one for one in trials if one.build.rig == rig and one.group in GROUPS and _open(first[one.name]))
        found += islice(fit, max(count - before.get(rig, 0), 0))
    return found


def _open(outcome: Outcome) -> bool:
    return outcome.finding is not None and outcome.finding.verdict != "adequate"


def _tasks(trial: Trial, outcome: Outcome, folders: Folders) -> tuple[Task, Task]:
    """Tasks of the default and of the exhaustive search, with the suspects that the diagnosis ``outcome`` put first."""
    if outcome.finding is None:
        raise ValueError(f"{trial.name} has no finding")
    count, names = SUSPECTS[trial.build.rig], dict[str, None]()
    for one in sorted(outcome.finding.hypotheses, key=lambda one: (-one.refitted, -one.evidence, -one.score)):
        names |= dict.fromkeys(one.effects)
    few = replace(task(trial, trial.name, folders), trial=f"{trial.name}-few", suspects=tuple(names)[:count])
    return few, replace(few, trial=f"{trial.name}-pairs", exhaustive=True)


def _compared(default: Outcome, every: Outcome) -> Compared:
    trial = default.trial.removesuffix("-few")
    if default.finding is None or every.finding is None:
        return Compared(trial, (), (), None)
    one, best = _best(default.finding), _best(every.finding)
    return Compared(trial, best.effects, one.effects, round(best.evidence - one.evidence, 2))


def _best(finding: Finding) -> Hypothesis:
    return max((one for one in finding.hypotheses if one.refitted or not one.effects), key=lambda one: one.evidence)
