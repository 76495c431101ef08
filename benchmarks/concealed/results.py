"""Scores of a blind test that is run in parts: a file with one line per part, to which each run adds its own.

A run of all trials takes most of a day. Since the trials are in random order, the first parts are a fair sample of all.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from benchmarks.common.machine import commit, cpu
from benchmarks.concealed.exhaustive import Compared
from benchmarks.concealed.score import Mark
from benchmarks.concealed.table import Advised, Table
from benchmarks.concealed.trials import Trial

LISTS = ("truth", "named", "top", "best", "default")  # fields that JSON turns into lists


def append(path: Path, seed: int, table: Table) -> None:
    """Add the scores of ``table``, of trials of ``seed``, to the file ``path`` with this commit and processor."""
    part = {"seed": seed, "commit": commit(), "machine": cpu(), **asdict(table)}
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(part) + "\n")


def read(path: Path, seed: int) -> Table | None:
    """All scores in the file ``path``; None if there is none.

    ValueError if it holds scores of another seed than ``seed``, or those of a trial twice.
    """
    if not path.exists():
        return None
    parts = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    if others := {part["seed"] for part in parts} - {seed}:
        raise ValueError(f"{path} holds trials of seed {others.pop()}, not {seed}; give another file, or that seed")
    tables = [_table(part) for part in parts]
    names = [mark.trial for table in tables for mark in table.marks]
    if len(set(names)) < len(names):
        raise ValueError(f"{path} holds a trial twice; remove one of its lines")
    return joined(tables)


def of_all_seeds(paths: Sequence[Path], rig: str | None, only: Sequence[str]) -> Table:
    """The scores in the files ``paths`` of trials with this ``rig`` and a group in ``only``; None or empty: with any.

    Trials of different seeds have the same names; what is followed up or compared is of all rigs and groups.
    """
    table = joined([_table(json.loads(line)) for path in paths for line in path.read_text("utf-8").splitlines()])
    marks = [one for one in table.marks if rig in (None, one.rig) and (not only or one.group in only)]
    return replace(table, marks=tuple(marks))


def check_plan(table: Table, trials: Sequence[Trial]) -> None:
    """Raise ValueError if ``table`` has scores of trials that another plan than ``trials`` has under the same names.

    With and without a vortex lattice, the trials of a seed have other names.
    """
    planned = {trial.name: trial for trial in trials}
    for mark in table.marks:
        trial = planned.get(mark.trial)
        if trial and not _is_of(mark, trial):
            raise ValueError(
                f"the results have {mark.trial} as one of {mark.group!r} with {', '.join(mark.truth) or 'nothing'} "
                f"hidden, the plan as one of {trial.group!r} with {', '.join(trial.hidden) or 'nothing'}: they are of "
                "a run with another --quick, or with a vortex lattice where this one has none, or the reverse; give "
                "another file, or run as then"
            )


def _is_of(mark: Mark, trial: Trial) -> bool:
    """Return whether ``mark`` may be of ``trial``; a plant may hide more than what its trial hides."""
    return (mark.group, mark.rig) == (trial.group, trial.build.rig) and set(trial.hidden) <= set(mark.truth)


def joined(tables: Sequence[Table]) -> Table:
    """The scores of several parts as one table."""
    return Table(
        tuple(mark for table in tables for mark in table.marks),
        tuple(one for table in tables for one in table.advised),
        sum(table.advice_trials for table in tables),
        sum(table.seconds for table in tables),
        tuple(one for table in tables for one in table.compared),
    )


def _table(part: Mapping[str, Any]) -> Table:
    return Table(
        tuple(Mark(**_tuples(one)) for one in part["marks"]),
        tuple(Advised(**_tuples(one)) for one in part["advised"]),
        part["advice_trials"],
        part["seconds"],
        tuple(Compared(**_tuples(one)) for one in part["compared"]),
    )


def _tuples(one: Mapping[str, Any]) -> dict[str, Any]:
    return {name: tuple(value) if name in LISTS else value for name, value in one.items()}
