"""Collect the modules that a simulation needs, by their imports, as source under another package's name.

Of a module, imports are left out whose names only annotations use, since annotations are not evaluated. A name that a
package passes on (``from wingfit.records import Gene``) is imported from where it is defined, so that the package
itself is not needed.
"""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import TypeGuard

ROOT = "wingfit"


def collect(starts: Iterable[str], replaced: Mapping[str, str], package: str) -> dict[str, str]:
    """Return the source of the modules ``starts`` and of all of wingfit that they import, by name below ``package``.

    ``replaced``: source of modules, by name in wingfit, that stands in for their own. Packages have empty sources
    unless something is imported from them. The empty name is the package itself.
    """
    found, waiting = dict[str, str](), list(starts)
    while waiting:
        name = waiting.pop()
        if name in found:
            continue
        source = replaced[name] if name in replaced else source_of(name)
        pruned, needed = _pruned(source)
        found[name] = pruned
        waiting += needed
    for name in list(found):
        parts = name.split(".")
        for end in range(1, len(parts)):
            found.setdefault(".".join(parts[:end]), "")
    return {name.removeprefix(ROOT).removeprefix("."): _renamed(text, package) for name, text in sorted(found.items())}


def _renamed(source: str, package: str) -> str:
    lines = source.splitlines(keepends=True)
    for start, end in _import_lines(ast.parse(source)):
        for k in range(start - 1, end):
            for word in ("from", "import"):
                lines[k] = lines[k].replace(f"{word} {ROOT}", f"{word} {package}")
    return "".join(lines).replace(f'import_module(f"{ROOT}.', f'import_module(f"{package}.')


def _import_lines(tree: ast.Module) -> Iterator[tuple[int, int]]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield node.lineno, node.end_lineno or node.lineno


def _pruned(source: str) -> tuple[str, list[str]]:
    """Return ``source`` without imports that only annotations use, and the modules of wingfit that it still imports."""
    tree = ast.parse(source)
    used, needed, changes = _used(tree), list[str](), list[tuple[int, int, str]]()
    for node in tree.body:
        end = node.end_lineno or node.lineno
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            changes.append((node.lineno, end, ""))
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == ROOT:
            lines = []
            for alias in node.names:
                if (alias.asname or alias.name) in used or alias.asname == alias.name:
                    module, whole = _defining(node.module or "", alias.name)
                    shown = f"{alias.name} as {alias.asname}" if alias.asname else alias.name
                    lines.append(f"from {module} import {shown}\n")
                    needed.append(f"{module}.{alias.name}" if whole else module)
            changes.append((node.lineno, end, "".join(lines)))
        elif isinstance(node, ast.Import | ast.ImportFrom) and not _kept(node, used):
            changes.append((node.lineno, end, ""))
    text = source.splitlines(keepends=True)
    for start, end, new in reversed(changes):
        text[start - 1 : end] = [new]
    return "".join(text), needed


def _kept(node: ast.Import | ast.ImportFrom, used: set[str]) -> bool:
    if isinstance(node, ast.ImportFrom) and node.module == "__future__":
        return True
    return any((alias.asname or alias.name).split(".")[0] in used for alias in node.names)


def _used(tree: ast.Module) -> set[str]:
    """Return the names that ``tree`` uses outside annotations, where these are not evaluated."""
    lazy = any(isinstance(node, ast.ImportFrom) and node.module == "__future__" for node in tree.body)
    names, waiting = set[str](), list[ast.AST](tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Name):
            names.add(node.id)
        waiting += [child for child in ast.iter_child_nodes(node) if not (lazy and _is_annotation(node, child))]
    return names


def _is_annotation(parent: ast.AST, child: ast.AST) -> bool:
    return child in (getattr(parent, "annotation", None), getattr(parent, "returns", None))


def _defining(module: str, name: str) -> tuple[str, bool]:
    """Return the module from which ``name`` can be imported without its package, and whether it is a module itself."""
    passed_on = _passed_on(module)
    if name in passed_on:
        return _defining(passed_on[name], name)
    return module, _path(f"{module}.{name}") is not None


@cache
def _passed_on(module: str) -> Mapping[str, str]:
    """Return the modules of wingfit from which the package ``module`` imports names, by name; empty for a module."""
    path = _path(module)
    if path is None or path.name != "__init__.py":
        return {}
    body = ast.parse(path.read_text()).body
    public: list[str] = next((ast.literal_eval(node.value) for node in body if _assigns(node, "__all__")), [])
    return {
        alias.name: node.module or ""
        for node in body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.name in public
    }


def _assigns(node: ast.stmt, name: str) -> TypeGuard[ast.Assign]:
    """Return whether ``node`` sets the variable ``name``."""
    return isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id == name


def source_of(module: str) -> str:
    """Return the source of a module of wingfit; ValueError if it cannot be found."""
    path = _path(module)
    if path is None:
        raise ValueError(f"module {module} has no source that can be copied: install wingfit from source")
    return path.read_text()


@cache
def _path(module: str) -> Path | None:
    """Return the file of a module of wingfit; None if there is none."""
    root = importlib.util.find_spec(ROOT)
    if root is None or not root.submodule_search_locations:
        return None
    place = Path(root.submodule_search_locations[0]).joinpath(*module.split(".")[1:])
    for path in (place / "__init__.py", place.with_name(f"{place.name}.py")):
        if path.is_file():
            return path
    return None
