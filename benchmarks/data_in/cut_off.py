"""C3D files that are cut off: how many are read without a word about missing frames, here and by ezc3d."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path

from benchmarks.data_in.binary_writers import by_hand, have_ezc3d
from benchmarks.data_in.truth import flapping
from wingfit.importers import Given, import_bytes
from wingfit.records import DatasetError

FILES = 100


def read_without_a_word() -> dict[str, int | None]:
    """Return counts of the files that are read; those of ezc3d are None where it is not installed."""
    whole, dice = by_hand(flapping(frames=600)), random.Random(5)  # noqa: S311  # no secret
    # The padding at the end, up to a block of 512 bytes, may be missing.
    cut = [whole[: dice.randrange(2, len(whole) - 512)] for _ in range(FILES)]
    return {"files": FILES, "read_here": sum(map(_read_here, cut)), "read_by_ezc3d": _by_ezc3d(cut)}


def _read_here(raw: bytes) -> bool:
    try:
        import_bytes(raw, "cut.c3d", Given())
    except DatasetError:
        return False
    return True


def _by_ezc3d(cut: list[bytes]) -> int | None:
    if not have_ezc3d():
        return None
    import ezc3d

    count = 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cut.c3d"
        for raw in cut:
            path.write_bytes(raw)
            try:
                ezc3d.c3d(str(path))
                count += 1
            except (OSError, ValueError, RuntimeError, IndexError):
                continue
    return count
