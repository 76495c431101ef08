"""HDF5 is read in a process of its own; what is no file of SLEAP is refused."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
import pytest

from tests.importers.reading import read, refused
from tests.oracles.track_files import binary_writers, flapping

OPTIONS: dict[str, Any] = {"unit": "mm", "rate_hz": 240.0}


def hdf5(write: Callable[[Any], object]) -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        write(file)
    return buffer.getvalue()


def several(file: Any) -> None:
    file.create_dataset("tracks", data=np.ones((2, 3, 2, 9)))
    file.create_dataset("node_names", data=[b"tip", b"root"])
    file.create_dataset("track_names", data=["left", "right"], dtype=h5py.string_dtype())


def test_tracks_of_several_animals_have_their_names() -> None:
    assert read(hdf5(several), **OPTIONS).markers == ("left_tip", "left_root", "right_tip", "right_root")


@pytest.mark.parametrize(
    ("write", "words"),
    [
        (lambda f: f.create_dataset("positions", data=np.ones(3)), "without a variable 'tracks'"),
        (lambda f: f.create_dataset("tracks", data=np.ones((3, 3))), "4 dimensions"),
        (lambda f: f.create_dataset("tracks", data=np.ones((1, 3, 2, 9), dtype=int)), "real numbers"),
        (lambda f: f.create_dataset("tracks", data=np.ones((5, 5, 5, 5))), "(tracks, 3, nodes, frames)"),
        (lambda f: f.create_dataset("tracks", data=np.ones((9, 3, 2, 3))), "two dimensions could be"),
        (
            lambda f: f.create_dataset("tracks", shape=(1, 3, 4, 10**8), dtype="f4", chunks=(1, 1, 1, 8)),
            "at most 16000000 numbers",
        ),
        (lambda f: f.create_dataset("tracks", shape=(1, 3, 4, 10**6), dtype="f8", chunks=(1, 3, 4, 10**6)), "MiB"),
        (lambda f: f.__setitem__("tracks", h5py.ExternalLink("/etc/hostname", "/x")), "no variable in this file"),
        (lambda f: f.create_dataset("tracks", data=np.full((1, 3, 2, 9), np.inf)), "is inf m"),
        (lambda f: f.create_dataset("tracks", data=np.full((1, 3, 2, 9), np.nan)), "no marker is seen"),
    ],
)
def test_other_hdf5_is_refused(write: Callable[[Any], object], words: str) -> None:
    assert words in refused(hdf5(write), **OPTIONS)


def test_a_file_that_is_cut_off_is_refused() -> None:
    whole = binary_writers.sleap(flapping(), packed=False)
    assert "not a readable HDF5 file" in refused(whole[: len(whole) // 2], **OPTIONS)
