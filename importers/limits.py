"""Limits of files of other programs, beside those of all recordings (:mod:`wingfit.records.limits`)."""

from wingfit.records.limits import MIB

MAX_TRACK_FILE_BYTES = 256 * MIB
MAX_TRACK_VALUES = 16_000_000  # numbers in a file that are read: 8 bytes each, about three times in memory
MAX_DISTANCE = 10_000.0  # of a marker from the origin of its frame, m; beyond, the unit or the file is wrong
MIN_RATE, MAX_RATE = 1e-3, 1e7  # frames per second of a camera
MAX_FORCE = 1e5  # on a balance for wings, N; beyond, the unit or the file is wrong
