"""A whole dataset from tracks alone, to look at and to correct: see :mod:`wingfit.importers.start.dataset`."""

from wingfit.importers.start.dataset import Conditions, Start, start_dataset

__all__ = ["Conditions", "Start", "start_dataset"]
