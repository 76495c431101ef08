"""Files that commands read and write."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from wingfit.cli.base.output import note
from wingfit.client.transport import WingfitError


def check_file(path: Path | None, option: str, endings: tuple[str, ...] = ()) -> None:
    """Refuse, before anything is computed, a file that cannot be written or whose name has none of ``endings``."""
    if path is None:
        return
    if endings and path.suffix.lower() not in endings:
        raise typer.BadParameter(f"{path}: the name must end in {' or '.join(endings)}", param_hint=option)
    if path.is_dir():
        raise typer.BadParameter(f"{path} is a folder; name a file in it", param_hint=option)
    place = path if path.exists() else path.parent
    if not place.exists():
        raise typer.BadParameter(f"there is no folder {place}; create it first", param_hint=option)
    if not os.access(place, os.W_OK):
        raise typer.BadParameter(f"{place} cannot be written; choose another place", param_hint=option)


def new_file(about: str, *names: str) -> Any:
    """A typer option ``names`` for a file to write, checked at once; its help ``about`` has the ending: FILE.csv."""

    def checked(path: Path | None) -> Path | None:
        check_file(path, names[0], tuple(re.findall(r"FILE(\.\w+)", about)))
        return path

    return typer.Option(*names, help=about, callback=checked)


@contextmanager
def refused(message: str) -> Iterator[None]:
    """Turn an error in the input (ValueError) into a WingfitError with ``message``."""
    try:
        yield
    except ValueError as error:
        raise WingfitError(message, str(error)) from error


def read_bytes(path: Path) -> bytes:
    """The content of a file; WingfitError with the path and the reason if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise WingfitError(f"cannot read {path}", error.strerror or str(error)) from error


def write_text(path: Path, text: str, what: str) -> None:
    """Write ``text`` as UTF-8 and report it as ``what``; WingfitError with the path and the reason where that fails."""
    try:
        path.write_text(text, encoding="utf-8", newline="")
    except OSError as error:
        raise WingfitError(f"cannot write {path}", error.strerror or str(error)) from error
    note(f"{what} written to {path}{'; open it in a browser' if path.suffix.lower() == '.html' else ''}")


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]], what: str) -> None:
    """Write a table as CSV; otherwise as :func:`write_text`."""
    buffer = io.StringIO()
    writer = csv.writer(buffer)
    writer.writerow(header)
    writer.writerows(rows)
    write_text(path, buffer.getvalue(), what)
