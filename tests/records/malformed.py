"""Takes a good dataset apart and breaks it."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

import pytest

from tests.records.samples import falcon_dataset
from wingfit.records import DatasetError, load_archive, load_dataset
from wingfit.records.files.folder import contents

TRACKS = "recordings/vacuum-2hz.csv"
YAML = "dataset.yaml"


@cache
def good_files() -> Mapping[str, bytes]:
    """Files of a good dataset, by name."""
    return MappingProxyType(contents(falcon_dataset(12)))


def with_yaml(old: str, new: str) -> dict[str, bytes]:
    """Good files, with ``old`` in the description replaced once."""
    text = good_files()[YAML].decode()
    assert old in text, old
    return {**good_files(), YAML: text.replace(old, new, 1).encode()}


def with_csv(rows: dict[int, str] | None = None, *, old: str = "", new: str = "") -> dict[str, bytes]:
    """Good files, with lines of the first recording replaced (numbered from 1), or a text replaced everywhere."""
    lines = good_files()[TRACKS].decode().splitlines()
    for number, line in (rows or {}).items():
        lines[number - 1] = line
    text = "\n".join([*lines, ""])
    assert not old or old in text
    return {**good_files(), TRACKS: text.replace(old, new).encode() if old else text.encode()}


def cells(line: int) -> list[str]:
    """Cells of a line of the first recording."""
    return good_files()[TRACKS].decode().splitlines()[line - 1].split(",")


def edited(line: int, column: int, cell: str) -> dict[str, bytes]:
    """Good files, with one cell changed; line and column from 1."""
    row = cells(line)
    row[column - 1] = cell
    return with_csv({line: ",".join(row)})


def zipped(files: Mapping[str, bytes], prefix: str = "") -> bytes:
    """``files`` as a zip."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(prefix + name, data)
    return buffer.getvalue()


def error_of_zip(data: bytes, name: str = "upload.zip") -> DatasetError:
    """The error that loading these bytes gives."""
    with pytest.raises(DatasetError) as caught:
        load_archive(data, name)
    return caught.value


def error_of(files: Mapping[str, bytes], folder: Path) -> DatasetError:
    """The error of ``files``, which must be the same from a zip as from a folder."""
    for name, data in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)
    with pytest.raises(DatasetError) as caught:
        load_dataset(folder)
    from_zip = error_of_zip(zipped(files))
    inside = [fault for fault in caught.value.errors if not fault.where.startswith(str(folder))]
    assert from_zip.errors[-len(inside) :] == inside or not inside
    return caught.value
