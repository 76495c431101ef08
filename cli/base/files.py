"""Files that commands write, and the check that they can be written before anything is computed."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable
from pathlib import Path

import typer

from wingfit.client.transport import WingfitError


def check_file(path: Path | None, option: str, known: tuple[str, ...] = ()) -> None:
    """Refuse, before anything is computed, a file of no ``known`` ending or that cannot be written."""
    if path is None:
        return
    if known and path.suffix.lower() not in known:
        raise typer.BadParameter(f"{path}: the name must end in {' or '.join(known)}", param_hint=option)
    if path.is_dir():
        raise typer.BadParameter(f"{path} is a folder; name a file in it", param_hint=option)
    place = path if path.exists() else path.parent
    if not place.exists():
        raise typer.BadParameter(f"there is no folder {place}; make it first", param_hint=option)
    if not os.access(place, os.W_OK):
        raise typer.BadParameter(f"{place} cannot be written; choose another place", param_hint=option)


def write_text(path: Path, text: str) -> None:
    """Write ``text`` as UTF-8; WingfitError with the path and the reason where that fails."""
    try:
        path.write_text(text, encoding="utf-8", newline="")
    except OSError as error:
        raise WingfitError(f"cannot write {path}", error.strerror or str(error)) from error


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a table as CSV; errors as :func:`write_text`."""
    buffer = io.StringIO()
    writer = csv.writer(buffer)
    writer.writerow(header)
    writer.writerows(rows)
    write_text(path, buffer.getvalue())
