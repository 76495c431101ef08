"""Measures the size and structure of the code, and finds banned phrases in it.

``python -m benchmarks.house [--json | --list]`` needs the standard library only. Product lines are those of the Python
files of the product that are neither blank nor only a comment; docstring lines are those of them in docstrings.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import re
import statistics
import subprocess
import sys
import time
import tokenize
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
PARTS = (
    "records", "importers", "tracking", "cameras", "sim", "inference", "calibration", "diagnosis", "planning", "report",
    "plot", "export", "workers", "service", "client", "cli",
)  # fmt: skip
PRODUCT = (*PARTS, "wingfit")
CODE = (*PRODUCT, "benchmarks", "docs", "examples", "tests")
SOURCES = (".py", ".js", ".css", ".html")
PROSE = (*SOURCES, ".md", ".yml", ".yaml", ".toml", ".sh", "")
# Reports that docs.generate.gallery writes: nobody reads or edits them as source.
WRITTEN = ROOT / "docs" / "gallery"
# Lines of the product at commit fa75500, before the move, counted as here.
BEFORE = 36_543
DOCSTRINGS_BEFORE = 4_983
# They hold the phrases because they name them.
UNCHECKED = (ROOT / "benchmarks" / "house.py", ROOT / "tests" / "test_house.py")
MOST_LINES = 400
HELP_RUNS = 5
# Phrases that readers would not understand, and the term to use instead. Words with several meanings (found, had, kept,
# asked) are not here: a pattern cannot tell their good uses from the bad ones.
IDIOMS = {
    r"\bdata (?:can |can't |cannot |do not )?tells?\b": "identifiable",
    r"\b(?:re)?told\b": "described; identifiable; given; logged; reported",
    r"\buntold\b": "not given",
    r"\blacking\b": "missing physics; residual",
    r"\bwhat (?:it|they|(?:the|a) (?:model|simulation|baseline)) (?:still )?lacks?\b": "missing physics",
    r"\bwhat (?:is|was) left(?: out)?\b": "residual; missing physics",
    r"\bwhat (?:it|(?:a|the) (?:re)?fit|the model) leaves\b": "residual",
    r"\basks? of\b": "request",
    r"\binnocent\b": "the discretisation is not the cause",
    r"\bin parts of the noise\b": "residual / noise",
    r"\bto the 3\.3\b": "scales with f^3.3",
    r"\bmemory \d\.?\d* from sample to sample\b": "lag-1 autocorrelation",
    r"\bexplanations? parts?\b": "hypotheses become distinguishable",
    r"\bchooses? nothing\b": "used for validation only",
    r"\bthe proof is theirs\b": "used for validation only",
    r"\[open, open\]": "not bounded by the data",
    r"\blaw says nothing\b": "could not be identified",
    r"\b(?:runs|jobs|tables) of before\b": "made by earlier versions",
    r"\bthe seed's (?:baseline|tables?|model|values?|equations?|conditions?|multiple|own)\b": "Armanini et al. (2016)",
    r"\bas the seed (?:does|has|fits|says|gives|prints)\b": "as in Armanini et al. (2016)",
    r"\bthan which no\b": "no riddles",
    r"\bof (?:whom|which) nothing\b": "no riddles",
    r"\bin words of its own\b": "in plain words",
}


def files(*parts: str, suffixes: tuple[str, ...] = (".py",)) -> Iterator[Path]:
    """Files under the folders ``parts`` with these suffixes that git tracks, without symbolic links."""
    listed = subprocess.run(["git", "ls-files", *parts], cwd=ROOT, capture_output=True, text=True, check=True).stdout  # noqa: S603, S607
    for name in listed.splitlines():
        path = ROOT / name
        if path.suffix in suffixes and path.is_file() and not path.is_symlink():
            yield path


def code_lines(path: Path) -> int:
    """Number of lines of ``path`` that are neither blank nor only a comment."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return sum(1 for line in lines if line.strip() and not line.strip().startswith("#"))


def docstring_lines(path: Path) -> int:
    """Number of lines of ``path`` that :func:`code_lines` counts, and that are docstrings."""
    source = path.read_text(encoding="utf-8")
    lines, inside = source.splitlines(), set[int]()
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Expr(ast.Constant(str())):
                inside.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return sum(1 for number in inside if (line := lines[number - 1].strip()) and not line.startswith("#"))


def function_lengths(path: Path) -> list[int]:
    """Number of lines of each function in ``path``, from its ``def`` to its end."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [
        (node.end_lineno or node.lineno) - node.lineno + 1
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
    ]


def module_of(path: Path) -> str:
    """Dotted name under which a file of the product is imported."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts[:-1] if parts[-1] == "__init__" else parts
    return ".".join(parts if parts[:1] == ("wingfit",) else ("wingfit", *parts))


def imports() -> dict[str, set[str]]:
    """Product modules that each product module imports, also within functions; its own parent packages are omitted."""
    known = {module_of(path): path for path in files(*PRODUCT)}
    graph: dict[str, set[str]] = defaultdict(set)
    for module, path in known.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                graph[module] |= {alias.name for alias in node.names} & known.keys()
            elif isinstance(node, ast.ImportFrom) and node.module in known:
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                graph[module] |= (inner & known.keys()) or {node.module}
    return {module: {one for one in found if not f"{module}.".startswith(f"{one}.")} for module, found in graph.items()}


def cycles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Groups of modules that import each other (strongly connected components of more than one; Tarjan 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(graph.get(node, ())):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            group = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(group) > 1:
                found.append(sorted(group))

    sys.setrecursionlimit(10_000)
    for node in sorted(graph):
        if node not in index:
            visit(node)
    return found


def large_files() -> list[str]:
    """Source files of more than MOST_LINES lines, without those that a program writes."""
    every = (path for path in files(*CODE, suffixes=SOURCES) if path.parent != WRITTEN)
    return [
        path.relative_to(ROOT).as_posix() for path in every if len(path.read_text("utf-8").splitlines()) > MOST_LINES
    ]


def largest_folder() -> tuple[int, str]:
    """The most source files in one folder, and which."""
    count = Counter(path.parent for path in files(*CODE, suffixes=SOURCES) if path.name != "__init__.py")
    folder, most = count.most_common(1)[0]
    return most, folder.relative_to(ROOT).as_posix()


class Place(NamedTuple):
    """A banned phrase: file and line where it stands, the phrase, and what to say instead."""

    file: str
    line: int
    phrase: str
    instead: str


def idioms() -> list[Place]:
    """Banned phrases in strings, comments, documents and the web page, except in quotations (lines with ``>``)."""
    places = []
    for path in files(suffixes=PROSE):
        if path in UNCHECKED:
            continue
        for line, text in _prose(path) if path.suffix == ".py" else _lines(path):
            for start, phrase, instead in phrases_in(text):
                at = line + text.count("\n", 0, start)
                places.append(Place(path.relative_to(ROOT).as_posix(), at, phrase, instead))
    return places


def phrases_in(text: str) -> Iterator[tuple[int, str, str]]:
    """Each banned phrase in ``text``: where it starts, the phrase with single spaces, and what to say instead."""
    for pattern, instead in IDIOMS.items():
        # Any space of a pattern also matches the end of a line and the mark of a comment on the next.
        for hit in re.finditer(pattern.replace(" ", r"\s+(?:#\s*)?"), text, re.IGNORECASE):
            yield hit.start(), " ".join(hit.group().split()), instead


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (1, whole text) of a document, with quotations and code spans blanked.

    As one text, so that a phrase broken over two lines is found.
    """
    yield 1, re.sub(r"(?m)^>.*$|`[^`\n]+`", "", path.read_text(encoding="utf-8"))


def _prose(path: Path) -> Iterator[tuple[int, str]]:
    """Yield (first line number, text) of each string and comment of a Python file; adjacent comments are joined."""
    tokens = tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
    strings = (tokenize.STRING, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING))  # 3.12 and later
    comment: tuple[int, list[str]] = (0, [])
    for token in tokens:
        if token.type in strings:
            yield token.start[0], token.string
        elif token.type == tokenize.COMMENT:
            first, lines = comment
            if first + len(lines) != token.start[0]:
                yield first, "\n".join(lines)
                first, lines = token.start[0], []
            comment = first, [*lines, token.string.lstrip("# ")]
    yield comment[0], "\n".join(comment[1])


def help_seconds() -> float:
    """Shortest duration of the command ``wingfit --help`` in several runs, s."""
    command = [str(Path(sys.executable).with_name("wingfit")), "--help"]
    times = []
    for _ in range(HELP_RUNS):
        began = time.perf_counter()
        subprocess.run(command, capture_output=True, check=True)  # noqa: S603
        times.append(time.perf_counter() - began)
    return min(times)


def measure() -> dict[str, Any]:
    """All figures of this benchmark, by name."""
    product = list(files(*PRODUCT))
    lengths = [length for path in product for length in function_lengths(path)]
    large = large_files()
    most, folder = largest_folder()
    phrases = Counter(place.phrase.lower() for place in idioms())
    return {
        "product_lines_before": BEFORE,
        "product_lines": sum(map(code_lines, product)),
        "docstring_lines_before": DOCSTRINGS_BEFORE,
        "docstring_lines": sum(map(docstring_lines, product)),
        "files_over_400": len(large),
        "over_400": large,
        "largest_folder_files": most,
        "largest_folder": folder,
        "function_median_lines": statistics.median(lengths),
        "function_p90_lines": statistics.quantiles(lengths, n=10)[8],
        "import_cycles": len(found := cycles(imports())),
        "cycles": found,
        "help_seconds": round(help_seconds(), 3),
        "idioms_left": phrases.total(),
        "idioms": dict(phrases.most_common()),
    }


def main() -> None:
    """Command line: measure, and print the figures or the list of phrases."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.house", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument(
        "--list", action="store_true", help="print where each banned phrase stands, and what to say instead"
    )
    options = parser.parse_args()
    if options.list:
        for place in idioms():
            print(f"{place.file}:{place.line}: {place.phrase!r}; say: {place.instead}")
        return
    figures = measure()
    print(json.dumps(figures) if options.json else "\n".join(f"{name:24}{value}" for name, value in figures.items()))


if __name__ == "__main__":
    main()
