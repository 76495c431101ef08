"""What is detected in one film, in files: blocks of instants, of which a few are in memory at a time.

A block is written as a whole, so that a run that is interrupted leaves whole blocks only.
"""

from __future__ import annotations

import os
import threading
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import BinaryIO
from zipfile import BadZipFile

import numpy as np

from wingfit.cameras.computed import Computed
from wingfit.cameras.markers.detections import FIELDS, Detections, joined
from wingfit.cameras.video.strobe import FlashMark
from wingfit.records.array_types import Array
from wingfit.records.errors import DatasetError, fail

BLOCK = 50  # instants
_COMPLETE = "complete"
_BLOCKS_KEPT = 4


class DetectionStore:
    """The detections of one film in ``folder``, which is made.

    Attributes:
        bad_frames: numbers of frames that could not be decoded, or whose size differs.

    Raises:
        DatasetError: what an earlier run left in the folder cannot be read.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise self._unwritable(error) from error
        self._counts: list[int] = []  # instants of each block
        self._marks: list[Array] = []
        self._fresh: list[tuple[FlashMark, Detections]] = []
        self.bad_frames: list[int] = []
        while self._file(len(self._counts)).exists():
            of = self._arrays(len(self._counts), ("marks", "bad", "counts"))
            self._remember(of["marks"], of["bad"])
        self._bad_kept = len(self.bad_frames)

    @property
    def complete(self) -> bool:
        """Return whether the film was read to its end."""
        return (self._folder / _COMPLETE).exists()

    @property
    def ended(self) -> int | None:
        """Return what ``finish`` was given, of a film that is complete."""
        stated = (self._folder / _COMPLETE).read_text()
        return int(stated) if stated else None

    def last(self) -> FlashMark | None:
        """Return where the last instant is that an earlier run wrote; None if there is none."""
        rows = next((marks for marks in reversed(self._marks) if len(marks)), None)
        return None if rows is None else _mark(rows[-1])

    def add(self, mark: FlashMark, seen: Detections, bad: Iterable[int]) -> None:
        """Add the next instant, and the numbers of the ``bad`` frames before it."""
        self._fresh.append((mark, seen))
        self.bad_frames.extend(bad)
        if len(self._fresh) == BLOCK:
            self._write()

    def finish(self, bad: Iterable[int], ended: int | None) -> None:
        """Write the last block; ``ended`` is the frame at which the film ends, if its container states more."""
        self.bad_frames.extend(bad)
        if self._fresh or len(self.bad_frames) > self._bad_kept:
            self._write()
        self._whole(self._folder / _COMPLETE, lambda to: to.write(("" if ended is None else str(ended)).encode()))

    def marks(self) -> Computed[FlashMark]:
        """Return where the instants are."""
        rows = np.concatenate([np.empty((0, 4)), *self._marks])
        return Computed(len(rows), lambda number: _mark(rows[number]))

    def seen(self) -> Computed[Detections]:
        """Return the detections of each instant, which are read from the files."""
        blocks = Computed(len(self._counts), self._block, _BLOCKS_KEPT)
        ends = np.cumsum(self._counts, dtype=int)

        def one(number: int) -> Detections:
            block = int(np.searchsorted(ends, number, side="right"))
            return blocks[block][number - int(ends[block])]

        return Computed(int(ends[-1]) if len(ends) else 0, one)

    def _file(self, number: int) -> Path:
        return self._folder / f"{number:06d}.npz"

    def _remember(self, marks: Array, bad: Array) -> None:
        self._counts.append(len(marks))
        self._marks.append(marks)
        self.bad_frames.extend(int(number) for number in bad)

    def _write(self) -> None:
        file = self._file(len(self._counts))
        whole = joined([seen for _, seen in self._fresh])
        marks = np.array([(one.frame, one.split, *one.between) for one, _ in self._fresh]).reshape(-1, 4)
        arrays = {
            "counts": np.array([len(seen) for _, seen in self._fresh], dtype=int),
            "marks": marks,
            "bad": np.array(self.bad_frames[self._bad_kept :], dtype=int),
            **{name: getattr(whole, name) for name in FIELDS},
        }
        self._whole(file, lambda to: np.savez_compressed(to, allow_pickle=False, **arrays))
        self._counts.append(len(marks))
        self._marks.append(marks)
        self._fresh, self._bad_kept = [], len(self.bad_frames)

    def _whole(self, file: Path, write: Callable[[BinaryIO], object]) -> None:
        """Write a ``file`` of which no part is ever read, even if two runs write it at once."""
        part = file.with_suffix(f".{os.getpid()}-{threading.get_ident()}.part")
        try:
            with part.open("wb") as to:
                write(to)
            part.replace(file)
        except OSError as error:
            raise self._unwritable(error) from error

    def _unwritable(self, error: OSError) -> DatasetError:
        remedy = "free the disk, or choose another folder for what is detected (--store, TMPDIR)"
        return fail(str(self._folder), None, f"cannot be written ({error.strerror or error}): {remedy}")

    def _block(self, number: int) -> list[Detections]:
        """Return the detections of the instants of one block."""
        of = self._arrays(number, ("counts", *FIELDS))
        ends = np.cumsum(of["counts"])
        return [
            Detections(*(of[name][start:end] for name in FIELDS))
            for start, end in zip(ends - of["counts"], ends, strict=True)
        ]

    def _arrays(self, number: int, names: Iterable[str]) -> dict[str, Array]:
        file = self._file(number)
        try:
            with np.load(file) as of:
                return {name: of[name] for name in names}
        except (OSError, EOFError, ValueError, KeyError, IndexError, BadZipFile, zlib.error) as error:
            raise fail(str(file), None, f"cannot be read ({error}); remove the folder, it is made anew") from None


def _mark(row: Array) -> FlashMark:
    return FlashMark(int(row[0]), float(row[1]), (float(row[2]), float(row[3])))
