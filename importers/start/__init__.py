"""A whole dataset from tracks alone, to look at and to correct: see :mod:`wingfit.importers.start.dataset`."""

from wingfit.importers.start.dataset import ASSUMED, MAX_FREQUENCY, MIN_FREQUENCY, Conditions, Start, start_dataset

__all__ = ["ASSUMED", "MAX_FREQUENCY", "MIN_FREQUENCY", "Conditions", "Start", "start_dataset"]
