"""Hostile archives, and damaged copies of valid ones, for upload as a dataset."""

from __future__ import annotations

import io
import stat
import struct
import zipfile
from collections.abc import Iterator, Mapping

import numpy as np

from benchmarks.abuse.cases import Case, upload
from benchmarks.common.files import EXAMPLES
from wingfit.records import load_archive, save_dataset

EXAMPLE = EXAMPLES / "robird"
TRACKS = "recordings/vac-0010mbar-lag0-2.0hz.csv"
YAML = "dataset.yaml"
FLIPS = 60
CUTS = 30
CELLS = (
    "NaN NaN",
    "inf",
    "-inf",
    "1e400",
    "-1e400",
    "1e308",
    "0x10",
    "1,5",
    "1_000",
    "١٢",
    "１.５",
    "true",
    "=1+1",
    '"',
    "\0",
    "9" * 400,
    "∞",
    "1e-400",
    "--1",
    "None",
    " ",
)
TEXTS = (
    ("chord_m: 0.2\n", "chord_m: .nan\n"),
    ("chord_m: 0.2\n", "chord_m: .inf\n"),
    ("chord_m: 0.2\n", "chord_m: -1\n"),
    ("chord_m: 0.2\n", "chord_m: 1e400\n"),
    ("chord_m: 0.2\n", "chord_m: [1]\n"),
    ("chord_m: 0.2\n", "chord_m: 1000\n"),
    ("name: robird-11\n", "name: !!python/object/apply:os.system [id]\n"),
    ("name: robird-11\n", "name: !!binary aGk=\n"),
    ("name: robird-11\n", "name: &a [*a]\n"),
    ("name: robird-11\n", "name: 2026-01-01\n"),
    ("name: robird-11\n", 'name: "\\ud800"\n'),
    ("name: robird-11\n", 'name: "a\\0b"\n'),
    ("name: robird-11\n", "name: {<<: *x}\n"),
)


def cases(seed: int) -> Iterator[Case]:
    """Yield all hostile uploads; the same seed gives the same bytes."""
    good = example_files()
    yield from _archives(good)
    yield from _damaged("zip", zipped(good), np.random.default_rng([seed, 1]))
    yield from _damaged("netcdf", _netcdf(good), np.random.default_rng([seed, 2]), ".nc")
    yield from _cells(good)
    yield from _descriptions(good)
    yield from _forms(good)


def small_archive() -> bytes:
    """Return a valid dataset with one recording, as the bytes of a zip archive."""
    return zipped(example_files())


def netcdf_example() -> bytes:
    """Return the dataset of :func:`small_archive` as the bytes of a NetCDF file."""
    return _netcdf(example_files())


def example_files() -> dict[str, bytes]:
    """Return the files of the example dataset, by name in the archive, with its first recording only."""
    import yaml

    description = yaml.safe_load((EXAMPLE / YAML).read_text(encoding="utf-8"))
    description["recordings"] = description["recordings"][:1]
    description.pop("held_out", None)
    text = yaml.safe_dump(description, sort_keys=False, allow_unicode=True)
    return {YAML: text.encode(), TRACKS: (EXAMPLE / TRACKS).read_bytes()}


def zipped(files: Mapping[str, bytes]) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data)
    return packed.getvalue()


def zipped_with(good: Mapping[str, bytes], name: str, data: bytes = b"x", mode: int = 0) -> bytes:
    packed = io.BytesIO(zipped(good))
    with zipfile.ZipFile(packed, "a") as archive:
        entry = zipfile.ZipInfo(name)
        entry.filename = entry.orig_filename = name
        entry.create_system, entry.external_attr = 3, mode << 16
        archive.writestr(entry, data)
    return packed.getvalue()


def _archives(good: Mapping[str, bytes]) -> Iterator[Case]:
    names = (
        "../evil",
        "a/../../evil",
        "/etc/passwd",
        "C:/evil",
        "..\\evil",
        "a\0b",
        "a//b",
        "\u202egnp.exe",
        "x" * 5000,
        "con",
    )
    for name in names:
        # unusual names may be accepted, but no file may be written under them
        yield upload(f"entry called {name[:20]!r}", zipped_with(good, name), answer="any")
    yield upload("symbolic link", zipped_with(good, "l", b"/etc/passwd", stat.S_IFLNK | 0o777))
    yield upload("device", zipped_with(good, "d", b"", stat.S_IFCHR | 0o666), answer="any")
    yield upload("bomb of one file", zipped({**good, "recordings/z.csv": b"," * 60_000_000}))
    yield upload("bomb of many files", zipped({**good, **{f"r/{k}.csv": b"0" * 2_000_000 for k in range(40)}}))
    yield upload("many entries", zipped({f"{k}.txt": b"" for k in range(6000)}))
    yield upload("archive in an archive", zipped({"inner.zip": zipped(good)}))
    yield upload("two of one name", zipped_with(good, YAML, good[YAML]))
    yield upload("names that differ in case only", zipped_with(good, YAML.upper(), good[YAML]), answer="any")
    yield upload("empty file", b"")
    yield upload("a text", b"hello")
    yield upload(
        "a pickle", b"\x80\x04\x95\x1f\x00\x00\x00\x00\x00\x00\x00\x8c\x05posix\x94\x8c\x06system\x94\x93\x94."
    )
    yield upload("a sqlite file", b"SQLite format 3\0" + b"\0" * 5000, "x.nc")
    yield upload("an empty archive", zipped({}))
    yield upload("no description", zipped({TRACKS: good[TRACKS]}))
    yield upload("no recording", zipped({YAML: good[YAML]}))
    yield upload("a gzip", b"\x1f\x8b\x08\0\0\0\0\0\0\3" + b"\0" * 100, "x.zip")
    for offset, value, what in (
        (8, b"\1\0", "encrypted"),
        (10, b"\x0e\0", "lzma"),
        (24, b"\xff\xff\xff\x7f", "wrong size"),
    ):
        yield upload(f"zip entry: {what}", _patched(zipped(good), offset, value))
    lie = bytearray(zipped(good))
    end = lie.rfind(b"PK\5\6")
    lie[end + 16 : end + 20] = struct.pack("<I", 0)  # all entries begin at 0
    yield upload("overlapping entries", bytes(lie))


def _patched(data: bytes, offset: int, value: bytes) -> bytes:
    changed, at = bytearray(data), -1
    while (at := changed.find(b"PK\1\2", at + 1)) >= 0:
        changed[at + offset : at + offset + len(value)] = value
    return bytes(changed)


def _netcdf(good: Mapping[str, bytes]) -> bytes:
    from pathlib import Path
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        path = Path(folder) / "good.nc"
        save_dataset(load_archive(zipped(good), "good.zip"), path)
        return path.read_bytes()


def _damaged(kind: str, data: bytes, rng: np.random.Generator, suffix: str = ".zip") -> Iterator[Case]:
    for cut in np.unique(rng.integers(1, len(data), CUTS)).tolist():
        yield upload(f"{kind} cut after {cut} bytes", data[:cut], f"x{suffix}")
    for k in range(FLIPS):
        changed = bytearray(data)
        for place in rng.integers(0, len(data), 1 + k % 8).tolist():
            changed[place] ^= 1 << int(rng.integers(8))
        yield upload(f"{kind} with flipped bits {k}", bytes(changed), f"x{suffix}", answer="any")
    for k in range(FLIPS // 3):
        changed = bytearray(data)
        start, size = int(rng.integers(0, len(data) - 64)), int(rng.integers(1, 64))
        changed[start : start + size] = rng.bytes(size)
        yield upload(f"{kind} with noise {k}", bytes(changed), f"x{suffix}", answer="any")


def _cells(good: Mapping[str, bytes]) -> Iterator[Case]:
    lines = good[TRACKS].decode().splitlines()
    for column in (0, 1):
        for cell in CELLS:
            row = lines[9].split(",")
            row[column] = cell
            yield _table(good, f"cell {cell[:20]!r} in column {column}", [*lines[:9], ",".join(row), *lines[10:]])
    header = lines[0].split(",")
    for what, first in (
        ("header of one name twice", [*header[:-1], header[-2]]),
        ("header without time", ["", *header[1:]]),
        ("header in millimetres", [name.replace("_x", "_x_mm") for name in header]),
        ("header of unknown markers", [f"?{name}" for name in header]),
        ("no header", []),
    ):
        yield _table(good, what, [",".join(first), *lines[1:]])
    yield _table(good, "time that stands still", [lines[0], *([lines[1]] * 40)])
    yield _table(good, "time that goes back", [lines[0], *reversed(lines[1:])])
    yield _table(good, "ragged rows", [line if k % 3 else line + ",1" for k, line in enumerate(lines)])
    yield _table(good, "one row", lines[:2])
    yield _table(good, "an open quote", [lines[0], '"' + lines[1], *lines[2:]])
    yield _table(good, "a line of 3 MB", [lines[0], "1" * 3_000_000, *lines[2:]])
    for what, data in (
        ("latin-1", "\n".join(lines).replace("e", "é").encode("latin-1")),
        ("utf-16", "\n".join(lines).encode("utf-16")),
        ("zeros", b"\0" * 100_000),
        ("noise", np.random.default_rng(3).bytes(50_000)),
    ):
        yield upload(f"table in {what}", zipped({**good, TRACKS: data}))


def _table(good: Mapping[str, bytes], what: str, lines: list[str]) -> Case:
    data = "\n".join([*lines, ""]).encode("utf-8", "surrogatepass")
    return upload(f"table: {what}", zipped({**good, TRACKS: data}), answer="any")


def _descriptions(good: Mapping[str, bytes]) -> Iterator[Case]:
    text = good[YAML].decode()
    for old, new in TEXTS:
        if old in text:
            changed = text.replace(old, new, 1).encode("utf-8", "surrogatepass")
            yield upload(f"description: {new[:30]!r}", zipped({**good, YAML: changed}), answer="any")
    laughs = "a0: &a0 [x, x]\n" + "".join(f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]\n" for k in range(1, 40))
    for what, data in (
        ("aliases of aliases", laughs.encode()),
        ("deep lists", b"[" * 50_000),
        ("deep maps", b"{a: " * 50_000),
        ("tabs", b"\tname: x"),
        ("not UTF-8", b"name: \xff\xfe"),
        ("nothing", b""),
        ("a number", b"42"),
        ("two documents", b"a: 1\n---\nb: 2\n"),
        ("one key twice", good[YAML] + b"name: again\n"),
        ("a key that is a list", b"? [a, b]\n: 1\n"),
        ("17 MB", b"# " + b"x" * 17_000_000),
        ("an integer of 5,000 digits", b"name: x\nversion: " + b"9" * 5000),
    ):
        yield upload(f"description: {what}", zipped({**good, YAML: data}))


def _forms(good: Mapping[str, bytes]) -> Iterator[Case]:
    data = zipped(good)
    for filename in ("", "x", "x.exe", "../../x.zip", "x.zip\0.nc", "x" * 3000 + ".zip", "é.zip", "con.zip"):
        yield upload(f"file called {filename[:20]!r}", data, filename, answer="any")
    for name in ("", "x" * 201, "\0", "\ud800"):
        form, file = {"name": name.encode("utf-8", "surrogatepass")}, {"file": ("x.zip", data)}
        yield Case(f"upload: named {name[:10]!r}", more={"files": file, "data": form}, answer="any")
    yield Case("upload: no file", more={"data": {"name": "x"}})
    yield Case(
        "upload: two files", more={"files": [("file", ("a.zip", data)), ("file", ("b.zip", data))]}, answer="any"
    )
    yield Case("upload: another field", more={"files": {"other": ("x.zip", data)}})
    for kind in ("application/json", "multipart/form-data", "multipart/form-data; boundary=", "text/plain", "x"):
        yield Case(f"upload: body called {kind}", more={"content": data, "headers": {"Content-Type": kind}})
    broken = b'--b\r\nContent-Disposition: form-data; name="file"; filename="x.zip"\r\n\r\n' + data[:100]
    form_of = {"Content-Type": "multipart/form-data; boundary=b"}
    yield Case("upload: form cut off", more={"content": broken, "headers": form_of})
    fields = (b'--b\r\nContent-Disposition: form-data; name="f%d"\r\n\r\n1\r\n' % k for k in range(5000))
    yield Case("upload: 5,000 fields", more={"content": b"".join(fields) + b"--b--\r\n", "headers": form_of})
    lines = b"".join(b"X-%d: 1\r\n" % k for k in range(20_000))
    whole = b"--b\r\n" + lines + b"\r\n1\r\n--b--\r\n"
    yield Case("upload: 20,000 headers of a part", more={"content": whole, "headers": form_of})
    yield Case("upload: too large", more={"files": {"file": ("x.zip", b"\0" * (65 * 2**20))}})
