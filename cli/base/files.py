"""Reads and writes the files of the commands, with error messages for the user."""

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
    """Raise a usage error of ``option`` if ``path`` (None: no file) cannot be written or has none of ``endings``."""
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
    """Return a typer option for a file to write, which is checked before anything is computed.

    ``about``: help text; the endings in it (FILE.csv) are those that are allowed. ``names``: names of the option.
    """

    def checked(path: Path | None) -> Path | None:
        check_file(path, names[0], tuple(re.findall(r"FILE(\.\w+)", about)))
        return path

    return typer.Option(*names, help=about, callback=checked)


@contextmanager
def refused(message: str) -> Iterator[None]:
    """Convert a ValueError (fault of the input) raised in the with-block into a WingfitError titled ``message``."""
    try:
        yield
    except ValueError as error:
        raise WingfitError(message, str(error)) from error


def read_bytes(path: Path) -> bytes:
    """Return the content of a file; raise WingfitError with path and reason if it cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise WingfitError(f"cannot read {path}", error.strerror or str(error)) from error


def write_text(path: Path, text: str, what: str) -> None:
    """Write ``text`` to ``path``, and print that ``what`` was written; raise WingfitError on failure."""
    try:
        path.write_text(text, encoding="utf-8", newline="")
    except OSError as error:
        raise WingfitError(f"cannot write {path}", error.strerror or str(error)) from error
    note(f"{what} written to {path}{'; open it in a browser' if path.suffix.lower() == '.html' else ''}")


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[object]], what: str) -> None:
    """Write a table (``header``: names of the columns) as CSV to ``path``; messages and errors as in ``write_text``."""
    buffer = io.StringIO()
    writer = csv.writer(buffer)
    writer.writerow(header)
    writer.writerows(rows)
    write_text(path, buffer.getvalue(), what)
