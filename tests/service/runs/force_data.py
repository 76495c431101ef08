"""Small force datasets of the virtual balance, as they are uploaded."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from wingfit.records import Dataset, save_dataset
from wingfit.sim.virtual_rigs.balance import TRIALS, Balance, campaign

BALANCE = Balance(every=10, beats=4)
HELD_OUT = "test-7"
FITTED = ("test-3", "test-4", "test-5", "test-6", "test-8")


@cache
def dataset() -> Dataset:
    """Six conditions of the source's Table 4, one of them held out, four beats each."""
    return campaign(3, BALANCE, TRIALS[2:], (HELD_OUT,))


@cache
def archive(fewer: int = 0) -> bytes:
    """The dataset as a zip, without its ``fewer`` first recordings."""
    whole = dataset()
    return zipped(replace(whole, recordings=whole.recordings[fewer:]))


def zipped(given: Dataset) -> bytes:
    """``given`` as the bytes of a zip."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "delfly.zip"
        save_dataset(given, path)
        return path.read_bytes()
