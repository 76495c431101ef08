"""Broken, hostile and unusual archives."""

from __future__ import annotations

import io
import random
import stat
import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.records.compare import assert_same
from tests.records.malformed import TRACKS, YAML, error_of_zip, good_files, zipped
from tests.records.samples import falcon_dataset
from wingfit.records import DatasetError, load_archive, load_dataset
from wingfit.records.files.archive import write_zip
from wingfit.records.files.netcdf import write_netcdf
from wingfit.records.limits import MAX_ENTRIES


def good_zip() -> bytes:
    return write_zip(falcon_dataset(12))


def with_entry(name: str, data: bytes = b"x", attributes: int = 0) -> bytes:
    buffer = io.BytesIO(good_zip())
    with zipfile.ZipFile(buffer, "a") as archive:
        entry = zipfile.ZipInfo(name)
        entry.filename = entry.orig_filename = name
        entry.create_system = 3
        entry.external_attr = attributes << 16
        archive.writestr(entry, data)
    return buffer.getvalue()


def patched(offset: int, value: bytes) -> bytes:
    """The good zip with bytes changed in every central-directory entry."""
    data = bytearray(good_zip())
    at = -1
    while (at := data.find(b"PK\x01\x02", at + 1)) >= 0:
        data[at + offset : at + offset + len(value)] = value
    return bytes(data)


HOSTILE: dict[str, tuple[Callable[[], bytes], list[str]]] = {
    "parent": (lambda: with_entry("../evil.csv"), ["'../evil.csv'", "leads out of the archive"]),
    "inner parent": (lambda: with_entry("recordings/../../evil.csv"), ["leads out of the archive"]),
    "absolute": (lambda: with_entry("/etc/passwd"), ["leads out of the archive"]),
    "drive": (lambda: with_entry("C:/evil.csv"), ["leads out of the archive"]),
    "backslash": (lambda: with_entry("..\\evil.csv"), ["backslash"]),
    "symlink": (lambda: with_entry("recordings/l.csv", b"/etc/passwd", stat.S_IFLNK | 0o777), ["symbolic link"]),
    "encrypted": (lambda: patched(8, b"\x01\x00"), ["encrypted", "without a password"]),
    "method": (lambda: patched(10, b"\x0e\x00"), ["method 14", "deflate"]),
    "declared size": (lambda: patched(24, b"\xff\xff\xff\x7f"), ["MiB; at most 512 MiB"]),
    "bomb": (lambda: zipped({**good_files(), "recordings/z.csv": b"," * 40_000_000}), ["times its size"]),
    "entries": (lambda: zipped({f"{k}.txt": b"" for k in range(MAX_ENTRIES + 1)}), ["5001 entries"]),
    "cut off": (lambda: good_zip()[:-500], ["not a readable zip", "cut off"]),
    "only a beginning": (lambda: b"PK\x03\x04", ["not a readable zip"]),
    "empty zip": (lambda: zipped({}), ["dataset.yaml is missing"]),
    "no description": (lambda: zipped({TRACKS: good_files()[TRACKS]}), ["dataset.yaml is missing"]),
    "yml": (lambda: zipped({"dataset.yml": b"x"}), ["found 'dataset.yml'", "rename"]),
    "two folders": (lambda: zipped({"a/dataset.yaml": b"x", "b/x.csv": b"x"}), ["found 'a/dataset.yaml'", "move"]),
    "not an archive": (lambda: b"time_s,a\n", ["neither a zip nor NetCDF-4"]),
    "empty": (lambda: b"", ["empty"]),
    "gzip": (lambda: b"\x1f\x8b\x08", ["gzip", "upload a zip"]),
    "netcdf-3": (lambda: b"CDF\x01", ["NetCDF-3", "nccopy"]),
}


@pytest.mark.parametrize("what", HOSTILE)
def test_each_archive_is_refused_in_words(what: str) -> None:
    make, words = HOSTILE[what]
    error = error_of_zip(make())
    assert error.where.startswith("upload.zip")
    for word in words:
        assert word in str(error), str(error)


def test_a_repeated_entry_is_refused() -> None:
    with pytest.warns(UserWarning, match="Duplicate name"):
        data = with_entry(YAML)
    assert "appears twice" in str(error_of_zip(data))


@pytest.mark.parametrize("make", [good_zip, lambda: write_netcdf(falcon_dataset(12))], ids=["zip", "netcdf"])
def test_flipped_bytes_give_a_dataset_error_or_a_dataset(make: Callable[[], bytes]) -> None:
    good, dice = make(), random.Random(7)  # noqa: S311
    refused = 0
    for _ in range(60):
        data = bytearray(good)
        for _ in range(dice.randint(1, 4)):
            data[dice.randrange(16, len(data))] ^= dice.randint(1, 255)
        try:
            load_archive(bytes(data[: dice.choice([len(data), dice.randrange(16, len(data))])]), "a")
        except DatasetError:
            refused += 1
    assert refused > 20


@pytest.mark.parametrize("prefix", ["falcon/", "a b/"])
def test_a_single_folder_in_the_zip_is_fine(prefix: str) -> None:
    files = {f"{prefix}{name}": data for name, data in good_files().items()}
    files |= {f"__MACOSX/{prefix}._dataset.yaml": b"junk", ".DS_Store": b"junk", f"{prefix}README.md": b"notes"}
    assert_same(load_archive(zipped(files), "a.zip"), falcon_dataset(12))


def test_only_the_last_part_of_a_client_path_is_shown() -> None:
    assert error_of_zip(b"", "C:\\fakepath\\x.zip").where == "x.zip"


def test_paths_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="cannot be read: No such file"):
        load_dataset(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match=r"dataset\.yaml is missing"):
        load_dataset(tmp_path)


def edited_netcdf(change: Callable[[h5py.File], None]) -> bytes:
    buffer = io.BytesIO(write_netcdf(falcon_dataset(12)))
    with h5py.File(buffer, "r+") as file:
        change(file)
    return buffer.getvalue()


GROUP = "recordings/vacuum-2hz"


def _replace(name: str, data: object) -> Callable[[h5py.File], None]:
    def change(file: h5py.File) -> None:
        del file[f"{GROUP}/{name}"]
        if data is not None:
            file[f"{GROUP}/{name}"] = data

    return change


def _external_data(file: h5py.File) -> None:
    del file[f"{GROUP}/time_s"]
    file[GROUP].create_dataset("time_s", (12,), "f8", external=[("/etc/passwd", 0, 96)])


def _huge(file: h5py.File) -> None:
    del file[f"{GROUP}/position_m"], file[f"{GROUP}/time_s"]
    file[GROUP].create_dataset("time_s", (10**9,), "f8", chunks=(1000,))
    file[GROUP].create_dataset("position_m", (10**9, 12, 3), "f8", chunks=(1000, 12, 3))


def _set_time(file: h5py.File) -> None:
    file[f"{GROUP}/time_s"][5] = -1.0


def _set_yaml(file: h5py.File) -> None:
    file.attrs["dataset_yaml"] = file.attrs["dataset_yaml"].replace("chord_m: 0.21", "chord_m: 210")


def _rename_marker(file: h5py.File) -> None:
    file[f"{GROUP}/marker"][1] = "m111"


def _repeat_marker(file: h5py.File) -> None:
    file[f"{GROUP}/marker"][1] = "m1"


NETCDF: dict[str, tuple[Callable[[h5py.File], None], str, str]] = {
    "no description": (lambda f: f.attrs.__delitem__("dataset_yaml"), "a.nc", "attribute 'dataset_yaml' is missing"),
    "number for text": (lambda f: f.attrs.__setitem__("dataset_yaml", 3), "a.nc", "must be one text"),
    "description": (_set_yaml, "a.nc: dataset_yaml, line 8, column 40: wing.stations[1].chord_m", "is 210.0 m"),
    "no group": (lambda f: f.__delitem__(GROUP), f"a.nc: {GROUP}", "is missing"),
    "no recordings": (lambda f: f.__delitem__("recordings"), "a.nc", "'recordings' is missing"),
    "unlisted": (lambda f: f.create_group("recordings/new") and None, "a.nc: recordings/new", "not listed"),
    "no positions": (_replace("position_m", None), f"a.nc: {GROUP}", "'position_m' is missing"),
    "shape": (_replace("position_m", np.zeros((12, 36))), f"a.nc: {GROUP}", "[T, M, 3]"),
    "text": (_replace("position_m", np.full((12, 12, 3), b"a")), f"a.nc: {GROUP}", "floating-point"),
    "nothing": (_replace("time_s", h5py.Empty("f8")), f"a.nc: {GROUP}", "no dimensions and no data"),
    "integers": (_replace("time_s", np.arange(12)), f"a.nc: {GROUP}", "floating-point"),
    "infinite": (_replace("position_m", np.full((12, 12, 3), np.inf)), "time index 0", "infinite"),
    "markers as numbers": (_replace("marker", np.arange(12.0)), f"a.nc: {GROUP}", "must hold text"),
    "unknown marker": (_rename_marker, f"a.nc: {GROUP}", "'m11'"),
    "repeated marker": (_repeat_marker, f"a.nc: {GROUP}", "appears twice"),
    "time": (_set_time, f"a.nc: {GROUP}, time index 5", "times must increase"),
    "external link": (_replace("time_s", h5py.ExternalLink("/etc/passwd", "/x")), f"a.nc: {GROUP}", "is a link"),
    "soft link": (_replace("time_s", h5py.SoftLink("/recordings")), f"a.nc: {GROUP}", "is a link"),
    "external data": (_external_data, f"a.nc: {GROUP}", "in other files"),
    "huge": (_huge, f"a.nc: {GROUP}", "1000000000 times"),
    "group for variable": (lambda f: _as_group(f), f"a.nc: {GROUP}", "must be a dataset"),
}


def _as_group(file: h5py.File) -> None:
    del file[f"{GROUP}/time_s"]
    file.create_group(f"{GROUP}/time_s")


@pytest.mark.parametrize("what", NETCDF)
def test_each_netcdf_mistake_is_named(what: str) -> None:
    change, place, word = NETCDF[what]
    error = error_of_zip(edited_netcdf(change), "a.nc")
    assert place in error.where, str(error)
    assert word in error.message, str(error)


def test_garbage_after_the_hdf5_signature() -> None:
    error = error_of_zip(b"\x89HDF\r\n\x1a\n" + bytes(500), "a.nc")
    assert "not a readable NetCDF-4 file" in error.message
