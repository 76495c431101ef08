"""The bytes of a file and its first lines as text: encodings, separators, rows."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count

from wingfit.records.errors import check_most, fail

HEAD_BYTES = 2**20  # of the text from which a format is recognised
HEAD_LINES = 60
_BLOCK = 2**20
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas"}
MAX_CELLS = 20_000  # in a line: more than 1000 markers with all that programs write about them
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f]")
_LINE_END = re.compile(r"\r\n|\n|\r")
_MAX_LINE = 2**20  # characters
_MAX_BLANK = 2**20  # rows without a cell, one after another: a spreadsheet has as many rows in all

Row = tuple[int, list[str]]


@dataclass(frozen=True)
class Source:
    """A file: its bytes ``raw``, the name ``file`` for messages, and its text, if it is one.

    ``encoding`` is None for a binary file. ``head`` are the first lines of a text, without their ends.
    """

    raw: bytes
    file: str
    encoding: str | None
    head: tuple[str, ...]

    def at(self, line: int, column: str | int | None = None) -> str:
        """Return the place of a ``line`` (from 1), and of a column by name or number (from 1), for messages."""
        named = "" if column is None else f", column {column if isinstance(column, int) else repr(column)}"
        return f"{self.file}, line {line}{named}"

    def cells(self, line: int, separator: str | None = None) -> list[str]:
        """Return the cells of a ``line`` of the head (from 1), stripped; none beyond the head."""
        if line > len(self.head):
            return []
        text = self.head[line - 1]
        try:
            row = next(csv.reader([text], delimiter=separator or separator_of(text)), [])
        except csv.Error:
            row = []
        return [cell.strip() for cell in row]

    def _lines(self) -> Iterator[str]:
        """Yield the lines of the text with their ends; DatasetError for one that is too long for the memory."""
        stream = io.TextIOWrapper(io.BytesIO(self.raw), self.encoding or "utf-8", newline="")
        for line in count(1):
            text = stream.readline(_MAX_LINE + 1)
            if not text:
                return
            if len(text) > _MAX_LINE:
                check_most(self.at(line), "has more than", len(text), _MAX_LINE, "characters", "export fewer markers")
            yield text

    def rows(self, separator: str, start: int = 1) -> Iterator[Row]:
        """Yield (line from 1, cells) of each line from ``start`` on; DatasetError for text that is no table."""
        reader, line, blank = csv.reader(self._lines(), delimiter=separator, strict=True), 0, 0
        try:
            for row in reader:
                line = reader.line_num
                check_most(self.at(line), "has", len(row), MAX_CELLS, "cells", "export fewer markers")
                blank = 0 if any(row) else blank + 1
                check_most(self.at(line), "ends", blank, _MAX_BLANK, "empty lines", "remove them")
                if line >= start:
                    yield line, row
        except csv.Error as error:
            message = f"not a table: {error}; remove stray quotes, or export the file again"
            raise fail(self.at(max(line, reader.line_num)), None, message) from None


def open_source(raw: bytes, file: str) -> Source:
    """Return the file with the bytes ``raw``; a text is UTF-8 or UTF-16, with or without a byte-order mark.

    DatasetError names the line of a text in which a byte does not fit its encoding.
    """
    encoding = _encoding(raw)
    if encoding is None:
        return Source(raw, file, None, ())
    text = raw[:HEAD_BYTES].decode(encoding, errors="replace")
    lines = _LINE_END.split(text, HEAD_LINES)
    if 1 < len(lines) <= HEAD_LINES and len(raw) > HEAD_BYTES:
        lines.pop()  # the head ends within this line
    if _CONTROL.search("".join(lines[:HEAD_LINES])):
        return Source(raw, file, None, ())
    _check_encoding(raw, encoding, file)
    for number, line in enumerate(lines[:HEAD_LINES], 1):
        cells = 1 + max(map(line.count, SEPARATORS))
        check_most(f"{file}, line {number}", "has", cells, MAX_CELLS, "cells", "export fewer markers")
    return Source(raw, file, encoding, tuple(lines[:HEAD_LINES]))


def _check_encoding(raw: bytes, encoding: str, file: str) -> None:
    decoder, lines = codecs.getincrementaldecoder(encoding)(), 0
    for start in range(0, len(raw), _BLOCK):
        block = raw[start : start + _BLOCK]
        try:
            lines += decoder.decode(block, final=start + _BLOCK >= len(raw)).count("\n")
        except UnicodeDecodeError as error:
            byte = f"0x{error.object[error.start]:02x}"
            lines += bytes(error.object[: error.start]).count(b"\n")
            message = f"byte {byte} is not {encoding.removesuffix('-sig').upper()} text; save the file as UTF-8"
            raise fail(f"{file}, line {lines + 1}", byte, message) from None


def _encoding(raw: bytes) -> str | None:
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    start = raw[:4096]
    if b"\0" not in start:
        return "utf-8-sig"
    # UTF-16 without a byte-order mark: the high bytes of ASCII are zero.
    for encoding, high in (("utf-16-le", start[1::2]), ("utf-16-be", start[::2])):
        if len(high) > 8 and high.count(0) > 0.9 * len(high) and start.count(0) < 0.55 * len(start):
            return encoding
    return None


def separator_of(line: str) -> str:
    """Return the most frequent separator in ``line``; a tab, then a semicolon, where several are equally frequent."""
    return max(SEPARATORS, key=line.count)
