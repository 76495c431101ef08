"""Aligns tracks in any camera axes to the frame of a described wing, and its markers to their names.

The contract of :func:`align`: the result is the wing's frame, its side, and the marker of each track, or a DatasetError
that says what is not certain and what would settle it. See ``docs/alignment.md`` and
``docs/decisions/0025-alignment.md``.
"""

from wingfit.tracking.alignment.common_frame import in_common_frame
from wingfit.tracking.alignment.procedure import align
from wingfit.tracking.alignment.request import Known, Tracks
from wingfit.tracking.alignment.result import AlignedTracks

__all__ = ["AlignedTracks", "Known", "Tracks", "align", "in_common_frame"]
