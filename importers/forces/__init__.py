"""Reads forces from the files of balances, on the user's machine, and writes the forces of a dataset.

The contract of :func:`import_forces` is that of :mod:`wingfit.importers`: one result, :class:`ImportedForces`, with who
stated what; nothing is guessed; all that is missing is listed at once; every bad file gives a DatasetError with place,
value and remedy. Readers (``table``, ``tdms``) return :class:`~wingfit.importers.forces.channels.Channels`, numbers as
they are in the file. ``resolve`` is the only place where the file's statements and the user's meet, and turns the
channels into body axes. See ``docs/importing.md``.
"""

from wingfit.importers.forces.import_forces import import_forces
from wingfit.importers.forces.resolve import ImportedForces

__all__ = ["ImportedForces", "import_forces"]
