"""Version of the installed package, and the commit of its source."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


@cache
def wingfit_version() -> str:
    """Version of the installed package."""
    try:
        return version("wingfit")
    except PackageNotFoundError:
        return "0+uninstalled"


@cache
def source_commit() -> str:
    """Return the commit of the git checkout that the package is installed from; "" if it is not in one."""
    with suppress(OSError, ValueError):
        return _head(Path(__file__).resolve().parents[1] / ".git")
    return ""


def _head(place: Path) -> str:
    """Return the commit of the repository ``place``, a folder .git or the file of a linked worktree."""
    if place.is_file():
        place = (place.parent / place.read_text().removeprefix("gitdir:").strip()).resolve()
    head = (place / "HEAD").read_text().strip()
    if not head.startswith("ref:"):
        return head
    name = head.removeprefix("ref:").strip()
    common = place / "commondir"
    shared = (place / common.read_text().strip()).resolve() if common.is_file() else place
    if (shared / name).is_file():
        return (shared / name).read_text().strip()
    packed = (shared / "packed-refs").read_text().splitlines()
    return next(line.split()[0] for line in packed if line.endswith(f" {name}")) if packed else ""
