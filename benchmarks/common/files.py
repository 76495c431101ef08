"""Paths of the repository and of its example datasets, and example datasets packed as archives."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
EXAMPLES = REPOSITORY / "examples"


def archive(example: str) -> bytes:
    """Pack the example dataset in the folder ``examples/<example>`` into a zip archive, and return its bytes.

    The bytes are the same at every call.
    """
    packed, folder = io.BytesIO(), EXAMPLES / example
    files = [folder / "dataset.yaml", *(folder / "recordings").iterdir()]
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as zipped:
        for file in sorted(files):
            zipped.writestr(zipfile.ZipInfo(file.relative_to(folder).as_posix()), file.read_bytes())
    return packed.getvalue()
