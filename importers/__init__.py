"""Reads marker tracks from the files of motion-capture systems and digitisers, on the user's machine.

The contract of :func:`import_tracks`:

- **One result** for every format, :class:`ImportedTracks`: names of markers [M], times [T] (s), positions [T, M, 3]
  (m; NaN where a marker was not seen), what is known about them and who stated it (the file, with the place, or the
  user, with the option), gaps by cause, and remarks about everything that is not imported or was changed.
- **Nothing is guessed.** Unit, rate and the unit of times are read where the file states them. Where it does not, the
  error lists all options that are needed, at once. An option that contradicts the file is an error too.
- **Axes** are those of the file unless the user says how the wing lies in them (:mod:`wingfit.importers.axes`); the
  result says which of the two it has. No format states how a wing lies.
- **A format is recognised by its content**, never by the file's name. If two formats fit, the user must choose.
- **Every bad file gives a DatasetError** with place (line and column where there are any), value, limit, unit and
  remedy, whatever its bytes are. Sizes are checked before memory is allocated (:mod:`wingfit.importers.limits`), and
  HDF5 is read in a separate process, because damaged HDF5 can make its library loop or crash.
- **Tracks of one camera**, in pixels, are recognised and refused: they must be triangulated first.

A reader (``importers/readers/``, one file per format) turns the bytes of a file into :class:`Raw`: numbers as they are
in the file, and the file's statements. It decides nothing. :mod:`wingfit.importers.resolve` is the only place where
statements and options meet. See ``docs/importing.md`` and ``docs/decisions/0023-importers.md``.
"""

from wingfit.importers.import_file import import_bytes, import_tracks, inspect_bytes
from wingfit.importers.options import Given
from wingfit.importers.tracks import FactName, Gaps, ImportedTracks, Statement

__all__ = ["FactName", "Gaps", "Given", "ImportedTracks", "Statement", "import_bytes", "import_tracks", "inspect_bytes"]
