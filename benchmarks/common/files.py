"""The repository and its example datasets."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
EXAMPLES = REPOSITORY / "examples"


def archive(example: str) -> bytes:
    """The folder of an example dataset as a zip archive, the same bytes every time."""
    packed, folder = io.BytesIO(), EXAMPLES / example
    files = [folder / "dataset.yaml", *(folder / "recordings").iterdir()]
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as zipped:
        for file in sorted(files):
            zipped.writestr(zipfile.ZipInfo(file.relative_to(folder).as_posix()), file.read_bytes())
    return packed.getvalue()
