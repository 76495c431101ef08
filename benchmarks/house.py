"""How large the code is, how it is laid out, and which words of the private idiom are left.

``python -m benchmarks.house [--json]`` needs the standard library only. Product lines are those of Python files of the
product, without blank lines and comments of their own; folders of documents, data and generated files do not count.
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
from typing import Any

ROOT = Path(__file__).parents[1]
PARTS = ("records", "tracking", "sim", "calibration", "diagnosis", "report", "workers", "service", "client", "cli")
PRODUCT = (*PARTS, "wingfit")
CODE = (*PRODUCT, "benchmarks", "docs", "examples", "tests")
SOURCES = (".py", ".js", ".css", ".html")
# Lines of the product at commit fa75500, before the move, counted as here.
BEFORE = 36_543
MOST_LINES = 400
HELP_RUNS = 5
# Words of the private idiom with one meaning each that no reader would use so; words of many meanings (found, had,
# kept) cannot be counted by a pattern.
IDIOMS = (
    r"the data (?:can )?tell",
    r"\btold\b",
    r"\blacking\b",
    r"\binnocent\b",
    r"\bin parts of the noise\b",
    r"\bmemory \d\.?\d* from sample to sample\b",
    r"\bruns of before\b",
    r"\bits law says nothing\b",
    r"\[open, open\]",
)


def files(*parts: str, suffixes: tuple[str, ...] = (".py",)) -> Iterator[Path]:
    """Files of these folders that git knows, without those behind links."""
    listed = subprocess.run(["git", "ls-files", *parts], cwd=ROOT, capture_output=True, text=True, check=True).stdout  # noqa: S603, S607
    for name in listed.splitlines():
        path = ROOT / name
        if path.suffix in suffixes and path.is_file() and not path.is_symlink():
            yield path


def code_lines(path: Path) -> int:
    """Lines that are neither blank nor only a comment."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return sum(1 for line in lines if line.strip() and not line.strip().startswith("#"))


def function_lengths(path: Path) -> list[int]:
    """Lines of each function from its ``def`` to its end."""
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
    """For each module of the product, the modules that it imports, in functions too; not the packages it lies in."""
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


def largest_folder() -> tuple[int, str]:
    """The most source files in one folder, and which."""
    count = Counter(path.parent for path in files(*CODE, suffixes=SOURCES) if path.name != "__init__.py")
    folder, most = count.most_common(1)[0]
    return most, folder.relative_to(ROOT).as_posix()


def idioms() -> Counter[str]:
    """How often each banned word stands in docstrings, comments, messages and documents."""
    found: Counter[str] = Counter()
    for path in files(*CODE, "README.md", "CHANGELOG.md", suffixes=(*SOURCES, ".md")):
        if path == Path(__file__):
            continue
        text = _prose(path) if path.suffix == ".py" else path.read_text(encoding="utf-8")
        for pattern in IDIOMS:
            found[pattern] += len(re.findall(pattern, text, re.IGNORECASE))
    return +found


def _prose(path: Path) -> str:
    """Strings and comments of a Python file."""
    tokens = tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
    kinds = (tokenize.STRING, tokenize.COMMENT, getattr(tokenize, "FSTRING_MIDDLE", tokenize.STRING))  # 3.12 and later
    return "\n".join(token.string for token in tokens if token.type in kinds)


def help_seconds() -> float:
    """Shortest time of ``wingfit --help``, s."""
    command = [str(Path(sys.executable).with_name("wingfit")), "--help"]
    times = []
    for _ in range(HELP_RUNS):
        began = time.perf_counter()
        subprocess.run(command, capture_output=True, check=True)  # noqa: S603
        times.append(time.perf_counter() - began)
    return min(times)


def measure() -> dict[str, Any]:
    """All figures."""
    product = list(files(*PRODUCT))
    lengths = [length for path in product for length in function_lengths(path)]
    large = [path for path in files(*CODE, suffixes=SOURCES) if len(path.read_text("utf-8").splitlines()) > MOST_LINES]
    most, folder = largest_folder()
    left = idioms()
    return {
        "product_lines_before": BEFORE,
        "product_lines": sum(map(code_lines, product)),
        "files_over_400": len(large),
        "over_400": [path.relative_to(ROOT).as_posix() for path in large],
        "largest_folder_files": most,
        "largest_folder": folder,
        "function_median_lines": statistics.median(lengths),
        "function_p90_lines": statistics.quantiles(lengths, n=10)[8],
        "import_cycles": len(found := cycles(imports())),
        "cycles": found,
        "help_seconds": round(help_seconds(), 3),
        "idioms_left": left.total(),
        "idioms": dict(left.most_common()),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.house", description=__doc__)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    as_json = parser.parse_args().json
    figures = measure()
    print(json.dumps(figures) if as_json else "\n".join(f"{name:24}{value}" for name, value in figures.items()))


if __name__ == "__main__":
    main()
