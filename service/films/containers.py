"""Recognises the containers of videos by their first bytes.

FFmpeg reads many other things, such as playlists, which name further files or addresses to open; none of these is given
to it.
"""

from __future__ import annotations

import re
from pathlib import Path

HEAD = 1024
_BEGINNINGS = (
    re.compile(rb"RIFF.{4}AVI ", re.DOTALL),
    re.compile(rb".{4}(?:ftyp|moov|mdat|wide|free|skip|pnot)", re.DOTALL),  # MP4, M4V, MOV
    re.compile(rb"\x1a\x45\xdf\xa3"),  # Matroska, WebM
    re.compile(rb"\x30\x26\xb2\x75\x8e\x66\xcf\x11"),  # ASF, WMV
    re.compile(rb"\x00\x00\x01\xba"),  # MPEG program stream
    re.compile(rb"\x47.{187}\x47.{187}\x47", re.DOTALL),  # MPEG transport stream
    re.compile(rb".{4}\x47.{191}\x47.{191}\x47", re.DOTALL),  # the same with times, MTS
)


def is_video(path: Path) -> bool:
    """Return whether the file ``path`` begins as a video in a known container."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    return any(beginning.match(head) for beginning in _BEGINNINGS)
