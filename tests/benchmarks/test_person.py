"""The stated model of a person, and the part of README.md that it reads."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.data_in import minutes
from benchmarks.data_in.person import BUTTON, HOME, KEY, POINT, ROWS, THINK, Person, skimmed, words


def test_steps_take_the_time_of_the_model() -> None:
    person = Person()
    person.types(10)
    person.clicks_on(2)
    person.reads("one two three, - four 5")
    person.waits(3.0)
    found = person.summary()
    assert found["hands_s"] == pytest.approx(HOME + 10 * KEY + HOME + 2 * (POINT + 2 * BUTTON), abs=0.06)
    assert found["thought_s"] == pytest.approx(2 * THINK, abs=0.06)
    assert (found["words"], found["reading_s"], found["machine_s"]) == (5, 1.5, 3.0)
    assert (found["steps"], found["keys"], found["clicks"]) == (2, 10, 2)


def test_further_rows_of_a_table_are_skimmed_and_counted() -> None:
    table = "\n".join(["marker  x  y", *(f"m{k}  {k}  {k}" for k in range(20))])
    assert words(skimmed(table)) == 3 * (ROWS + 1)
    assert skimmed("a sentence\nand another") == "a sentence\nand another"
    person = Person()
    person.reads(table)
    found = person.summary()
    assert found["minutes_if_all_rows_are_read"] - found["minutes"] == pytest.approx(45 / 200, abs=0.02)


def test_the_readme_leads_to_the_sections_that_are_read() -> None:
    text = minutes.readme()
    assert "#from-a-file-to-a-dataset" in text.partition("## ")[0]
    assert "--dataset my-wing" in text


def test_remedies_are_copied_from_errors() -> None:
    errors = (
        "error: 3 errors\n  a.csv: states no unit; add it: --unit mm (one of m, mm)\n"
        "  a.csv: choose the rows of one: --rows run=1,Left=0 (or run=2)\n  a.csv: cut off; give --incomplete\n"
    )
    found = minutes._remedies(errors, minutes.Source("a.csv", unit="m"), ["import", "a.csv"])
    assert found == ["--unit m", "--rows run=1,Left=0", "--incomplete"]


def test_without_the_files_nothing_is_measured_and_this_is_said(tmp_path: Path) -> None:
    found, fine = minutes.run(lambda _: None, tmp_path)
    assert (found["minutes_mocap_to_dataset"], fine) == (None, True)
    assert len(found["mocap_to_dataset"]["skipped"]) == len(minutes.SOURCES)
