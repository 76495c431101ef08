"""Tests and benchmarks are independent of each other, but for the reference solutions of ``tests/oracles``."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
# tests/benchmarks tests the benchmarks; tests/oracles is the one way in for all others.
MAY_IMPORT_BENCHMARKS = (ROOT / "tests" / "benchmarks", ROOT / "tests" / "oracles")


def imported(path: Path) -> Iterator[str]:
    """Names of the modules that a file imports, in functions too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module


def importers(folder: str, package: str) -> set[Path]:
    """Files below ``folder`` that import from ``package``."""
    return {
        path for path in (ROOT / folder).rglob("*.py") if any(name.split(".")[0] == package for name in imported(path))
    }


def test_benchmarks_import_no_tests() -> None:
    assert importers("benchmarks", "tests") == set()


def test_tests_import_benchmarks_through_oracles_only() -> None:
    direct = {
        path.relative_to(ROOT).as_posix()
        for path in importers("tests", "benchmarks")
        if not any(path.is_relative_to(folder) for folder in MAY_IMPORT_BENCHMARKS)
    }
    assert direct == set(), "import them from a module of tests/oracles"


def test_examples_import_neither() -> None:
    assert importers("examples", "tests") | importers("examples", "benchmarks") == set()
