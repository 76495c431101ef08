"""A stranger's NetCDF file is read in a process of its own: whatever is wrong with it, an answer comes in words."""

from __future__ import annotations

import errno
import io
import signal
import subprocess
import sys
import time
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from tests.records.compare import assert_same
from tests.records.samples import falcon_dataset
from tests.records.vehicles import delfly_dataset
from wingfit.records import Dataset, DatasetError, load_archive
from wingfit.records.files.confined import STORED, Limits, ReaderError, convert_netcdf, limits_of_upload
from wingfit.records.files.folder import DESCRIPTION
from wingfit.records.files.netcdf import write_netcdf
from wingfit.records.files.parsed import LAYOUT, load_parsed
from wingfit.records.limits import MIB

GROUP = "recordings/vacuum-2hz"
USUAL = limits_of_upload(0)


def netcdf() -> bytes:
    return write_netcdf(falcon_dataset(12))


def edited(change: Callable[[h5py.File], None], dataset: Dataset | None = None) -> bytes:
    buffer = io.BytesIO(write_netcdf(dataset or falcon_dataset(12)))
    with h5py.File(buffer, "r+") as file:
        change(file)
    return buffer.getvalue()


def with_positions(**options: Any) -> bytes:
    """The falcon with its first positions stored anew."""

    def change(file: h5py.File) -> None:
        data = file[f"{GROUP}/position_m"][:]
        del file[f"{GROUP}/position_m"]
        file[GROUP].create_dataset("position_m", data=data, **options)

    return edited(change)


def looping() -> bytes:
    """A file of which one bit, in the size of an object of a global heap, makes the library loop for ever."""
    data = bytearray(netcdf())
    data[data.rfind(b"GCOL") + 25] ^= 4
    return bytes(data)


def refused(data: bytes, limits: Limits | None = None) -> str:
    with pytest.raises(DatasetError) as caught:
        convert_netcdf(data, "wing.nc", limits)
    assert caught.value.where.startswith("wing.nc")
    return str(caught.value)


@pytest.mark.parametrize("make", [lambda: falcon_dataset(12), delfly_dataset], ids=["tracks", "forces"])
def test_the_form_that_is_stored_gives_the_same_dataset_to_the_bit(make: Callable[[], Dataset]) -> None:
    data = write_netcdf(make())
    form = convert_netcdf(data, "wing.nc")
    assert_same(load_parsed(form, "wing.nc"), load_archive(data, "wing.nc"))
    assert convert_netcdf(data, "other.nc") == form


def test_values_that_were_read_can_be_written_to() -> None:
    # Compiled kernels take an array that is read-only for another type.
    for recording in load_parsed(convert_netcdf(netcdf(), "wing.nc"), "wing.nc").recordings:
        assert recording.values.flags.writeable
        assert recording.values.dtype == np.float64
        assert recording.times.flags.writeable


def test_a_file_in_which_the_library_loops_for_ever_is_given_up() -> None:
    began = time.monotonic()
    assert "takes more than 2 s of processor time" in refused(looping(), replace(USUAL, processor_s=2))
    assert time.monotonic() - began < USUAL.wall_s


def test_a_file_that_is_not_read_in_time_is_given_up() -> None:
    assert "not read within 1 s" in refused(looping(), replace(USUAL, processor_s=60, wall_s=1))


def test_long_texts_of_fixed_length_are_refused_before_they_take_memory() -> None:
    def change(file: h5py.File) -> None:
        names = file[f"{GROUP}/marker"].asstr()[:]
        del file[f"{GROUP}/marker"]
        file[GROUP].create_dataset("marker", shape=names.shape, dtype="S100000000", chunks=(1,), compression="gzip")

    assert "each marker takes 100000000 bytes; at most 1024" in refused(edited(change))


def test_a_long_description_of_fixed_length_is_refused_before_it_takes_memory() -> None:
    def change(file: h5py.File) -> None:
        del file.attrs["dataset_yaml"]
        space, kind = h5py.h5s.create(h5py.h5s.SCALAR), h5py.h5t.C_S1.copy()
        kind.set_size(40 * MIB)
        h5py.h5a.create(file.id, b"dataset_yaml", kind, space)

    assert "attribute 'dataset_yaml' takes 40 MiB; at most 16 MiB" in refused(edited(change))


def test_a_filter_that_is_applied_twice_is_refused() -> None:
    pipeline = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    pipeline.set_chunk((1, 1, 3))
    for _ in range(2):
        pipeline.set_filter(h5py.h5z.FILTER_DEFLATE, 0, (6,))

    def change(file: h5py.File) -> None:
        shape = file[f"{GROUP}/position_m"].shape
        del file[f"{GROUP}/position_m"]
        space = h5py.h5s.create_simple(shape)
        h5py.h5d.create(file[GROUP].id, b"position_m", h5py.h5t.NATIVE_DOUBLE, space, dcpl=pipeline)

    assert "filters [1, 1]; pack it by deflate alone, once" in refused(edited(change))


def test_filters_that_others_provide_are_refused() -> None:
    assert "by the HDF5 filters [6]" in refused(with_positions(scaleoffset=4))


@pytest.mark.parametrize(
    "options", [{}, {"compression": "gzip", "shuffle": True, "fletcher32": True}, {"compression": "lzf"}]
)
def test_usual_ways_to_store_are_read(options: dict[str, Any]) -> None:
    assert load_parsed(convert_netcdf(with_positions(**options), "wing.nc"), "wing.nc").recordings


def test_what_was_stored_before_there_were_these_limits_is_still_read() -> None:
    data = with_positions(scaleoffset=4)
    assert "by the HDF5 filters" in refused(data)
    assert load_parsed(convert_netcdf(data, "wing.nc", STORED), "wing.nc").recordings


def test_the_environment_of_the_child_has_no_secrets(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "spy").write_text(f"#!/bin/sh\nenv > {tmp_path}/environment\nexit 1\n")
    (tmp_path / "spy").chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "spy"))
    monkeypatch.setenv("RAY_AUTH_TOKEN", "secret")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with pytest.raises(ReaderError):
        convert_netcdf(netcdf(), "wing.nc")
    known = (tmp_path / "environment").read_text()
    assert "secret" not in known
    assert f"TMPDIR={tmp_path}" in known


def test_a_large_chunk_is_refused_before_it_takes_memory() -> None:
    def change(file: h5py.File) -> None:
        shape = file[f"{GROUP}/position_m"].shape
        del file[f"{GROUP}/position_m"]
        file[GROUP].create_dataset(
            "position_m",
            shape=shape,
            maxshape=(None, None, None),
            chunks=(4096, 1024, 3),
            compression="gzip",
            dtype="f8",
        )

    assert "takes 96 MiB; at most 64 MiB" in refused(edited(change))


def test_a_chunk_that_unpacks_to_more_than_it_declares_ends_the_child_alone() -> None:
    packer = zlib.compressobj()
    bomb = b"".join([*(packer.compress(bytes(MIB)) for _ in range(512)), packer.flush()])

    def change(file: h5py.File) -> None:
        shape = file[f"{GROUP}/position_m"].shape
        del file[f"{GROUP}/position_m"]
        made = file[GROUP].create_dataset("position_m", shape=shape, chunks=shape, compression="gzip", dtype="f8")
        made.id.write_direct_chunk((0, 0, 0), bomb)

    message = refused(edited(change))
    assert "HDF5 library fails" in message or "not a readable" in message or "cannot be read" in message, message


def test_memory_is_limited() -> None:
    message = refused(netcdf(), replace(USUAL, memory_mib=1))
    assert (
        "takes more than 1 MiB of memory" in message or "HDF5 library fails" in message or "not a readable" in message
    )


def test_too_many_numbers_are_refused_by_the_limit_of_the_call() -> None:
    assert "more than 20 numbers" in refused(netcdf(), replace(USUAL, values=20))


def test_an_answer_that_is_too_large_is_refused() -> None:
    noise = np.random.default_rng(0).normal(0.1, 0.01, (20_000, 12, 3))

    def change(file: h5py.File) -> None:
        for name, data in (("position_m", noise), ("time_s", np.arange(20_000) / 100)):
            del file[f"{GROUP}/{name}"]
            file[GROUP][name] = data

    assert "takes more than 1 MiB unpacked" in refused(edited(change), replace(USUAL, output_mib=1))


def test_all_faults_come_with_their_place_as_without_a_process_of_its_own() -> None:
    def change(file: h5py.File) -> None:
        file[f"{GROUP}/time_s"][3] = 0.0
        file[f"{GROUP}/position_m"][2, 0, 0] = np.inf

    data = edited(change)
    with pytest.raises(DatasetError) as here:
        load_archive(data, "wing.nc")
    with pytest.raises(DatasetError) as there:
        convert_netcdf(data, "wing.nc")
    assert there.value.errors == here.value.errors
    assert len(here.value.errors) > 1


@pytest.mark.parametrize("label", ["a\0b.nc", "\ud800.nc", "--help", "x" * 5000])
def test_whatever_the_file_is_called(label: str) -> None:
    assert convert_netcdf(netcdf(), label)


def test_a_child_that_lies_is_not_believed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "liar").write_text("#!/bin/sh\necho '{\"faults\": 7}'\nexit 3\n")
    (tmp_path / "liar").chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "liar"))
    assert "HDF5 library fails" in refused(netcdf())


def test_a_full_temporary_folder_is_no_fault_of_the_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "full").write_text("#!/bin/sh\nexit 28\n")
    (tmp_path / "full").chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "full"))
    with pytest.raises(OSError, match="No space left on device") as caught:
        convert_netcdf(netcdf(), "wing.nc")
    assert caught.value.errno == errno.ENOSPC


@pytest.mark.parametrize(("ends", "why"), [("exit 1", "cannot start"), ("kill -9 $$", "want of memory")])
def test_a_reader_that_ends_before_it_reads_is_no_fault_of_the_file(
    ends: str, why: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "broken").write_text(f"#!/bin/sh\n{ends}\n")
    (tmp_path / "broken").chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "broken"))
    with pytest.raises(ReaderError, match=why):
        convert_netcdf(netcdf(), "wing.nc")


def test_an_upload_is_answered_within_20_seconds() -> None:
    for mib in (0, 1, 16, 64):
        limits = limits_of_upload(mib * MIB)
        assert limits.wall_s < 20
        assert limits.processor_s <= limits.wall_s
    assert STORED.values > limits.values


@pytest.mark.parametrize("damage", [lambda d: d[:-30], lambda d: d[:200] + b"\xff" * 8 + d[208:], lambda _: b"PK"])
def test_a_stored_form_that_is_damaged_says_so(damage: Callable[[bytes], bytes]) -> None:
    form = convert_netcdf(netcdf(), "wing.nc")
    with pytest.raises(DatasetError, match="stored form is damaged"):
        load_parsed(damage(form), "wing.nc")


def _crowded(form: bytes) -> bytes:
    with zipfile.ZipFile(buffer := io.BytesIO(form), "a") as archive:
        for number in range(1100):
            archive.writestr(f"recordings/{number}.f8", b"")
    return buffer.getvalue()


def _unpacked(form: bytes) -> bytes:
    with zipfile.ZipFile(io.BytesIO(form)) as given, zipfile.ZipFile(buffer := io.BytesIO(), "w") as made:
        for name in given.namelist():
            made.writestr(name, given.read(name))
    return buffer.getvalue()


def _commented(form: bytes) -> bytes:
    with zipfile.ZipFile(buffer := io.BytesIO(form), "a") as archive:
        archive.comment = b"a comment"
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("forge", "why"),
    [
        (_crowded, "it lists 110[0-9] entries"),
        (_unpacked, "not deflated"),
        (_commented, "lists|as it was"),
    ],
)
def test_a_stored_form_that_we_do_not_write_is_not_opened(forge: Callable[[bytes], bytes], why: str) -> None:
    form = convert_netcdf(netcdf(), "wing.nc")
    assert load_parsed(form, "wing.nc").recordings
    with pytest.raises(DatasetError, match=why):
        load_parsed(forge(form), "wing.nc")


@pytest.mark.parametrize("name", [DESCRIPTION, LAYOUT])
def test_a_stored_form_that_would_unpack_to_gigabytes_is_refused(name: str) -> None:
    lie = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(convert_netcdf(netcdf(), "wing.nc"))) as honest,
        zipfile.ZipFile(lie, "w", zipfile.ZIP_DEFLATED) as made,
    ):
        for entry in honest.namelist():
            made.writestr(entry, bytes(64 * MIB) if entry == name else honest.read(entry))
    with pytest.raises(DatasetError, match=f"damaged \\({name} is too large\\)"):
        load_parsed(lie.getvalue(), "wing.nc")


def test_no_process_remains(monkeypatch: pytest.MonkeyPatch) -> None:
    started: list[subprocess.Popen[bytes]] = []

    class Noted(subprocess.Popen[bytes]):
        def __init__(self, *args: Any, **options: Any) -> None:
            super().__init__(*args, **options)
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Noted)
    refused(looping(), replace(USUAL, processor_s=60, wall_s=1))
    (child,) = started
    assert child.returncode == -signal.SIGKILL
    assert not Path(f"/proc/{child.pid}").exists()
