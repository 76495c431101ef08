"""The layout that ``python -m benchmarks.house`` measures stays within its limits."""

from __future__ import annotations

import pytest

from tests.oracles import house

MOST_FILES = 16  # in one folder, beside __init__.py


def test_modules_do_not_import_each_other_in_circles() -> None:
    assert house.cycles(house.imports()) == []


def test_a_circle_is_detected() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}
    assert house.cycles(graph) == [["a", "b", "c"]]


def test_files_are_short() -> None:
    assert house.large_files() == []


def test_folders_hold_few_files() -> None:
    most, folder = house.largest_folder()
    assert most <= MOST_FILES, f"{folder} holds {most} files; split it by subject"


@pytest.mark.parametrize("text", ["The data\n    tell it.", "What is left out.", "It is told."])
def test_a_banned_phrase_is_seen_across_line_breaks(text: str) -> None:
    assert list(house.phrases_in(text))


def test_standard_terms_are_not_banned() -> None:
    assert not list(house.phrases_in("The residual is what the model cannot describe; left turn; data telling."))
