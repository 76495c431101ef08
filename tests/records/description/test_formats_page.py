"""The published schema and docs/formats.md say what the code does."""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Callable
from decimal import Decimal
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from tests.records.malformed import YAML, error_of_zip, good_files, with_yaml, zipped
from tests.records.vehicles import good_vehicle, vehicle_yaml
from wingfit.records import FourBarDrive, LowPass, load_archive
from wingfit.records import limits as limits_module
from wingfit.records.description.schema import dataset_schema, schema_text
from wingfit.records.description.yaml_text import read_yaml
from wingfit.records.files.tracks import read_tracks
from wingfit.records.limits import FORMAT_VERSION

jsonschema: Any = import_module("jsonschema")
DOCS = Path(__file__).parents[3] / "docs"
PAGE = (DOCS / "formats.md").read_text(encoding="utf-8")


def block(language: str, number: int = 0) -> str:
    return str(re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)[number])


def plain(value: Any) -> Any:
    if isinstance(value, Decimal):
        return float(value)
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list) else value


def example() -> dict[str, bytes]:
    tracks = block("csv").encode()
    return {YAML: block("yaml").encode(), **{f"recordings/{n}-3hz.csv": tracks for n in ("vacuum", "tunnel")}}


def vehicle_example() -> dict[str, bytes]:
    forces = block("csv", 1).encode()
    files = {f"recordings/{name}.csv": forces for name in ("hover", "forward")}
    return {YAML: block("yaml", 2).encode(), **files}


def test_the_published_schema_is_the_code_s() -> None:
    published = (DOCS / "schemas" / "dataset.schema.json").read_text(encoding="utf-8")
    assert published == schema_text(), (
        "run: python -m wingfit.records.description.schema > docs/schemas/dataset.schema.json"
    )


def test_the_schema_is_valid_and_versioned() -> None:
    schema = dataset_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for model in ("WingDatasetFile", "VehicleDatasetFile"):
        assert schema["$defs"][model]["properties"]["format_version"]["const"] == FORMAT_VERSION


@pytest.mark.parametrize(
    "raw",
    [good_files()[YAML], example()[YAML], good_vehicle()[YAML], vehicle_example()[YAML]],
    ids=["wing", "page's wing", "vehicle", "page's vehicle"],
)
def test_the_schema_accepts_what_is_read(raw: bytes) -> None:
    jsonschema.Draft202012Validator(dataset_schema()).validate(plain(read_yaml(raw, YAML).data))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("chord_m: 0.21", "chord_m: 210"),
        ("chord_m: 0.21", "chord_mm: 0.21"),
        ("temperature_c: 20.0", "temperature_c: 293.15"),
        ("kind: fourier", "kind: cam"),
        ("name: m2,", "name: a/b,"),
        ("format_version: 1", "format_version: 2"),
        ("rig: vacuum_chamber, ", ""),
    ],
)
def test_the_schema_refuses_what_is_refused(old: str, new: str) -> None:
    files = with_yaml(old, new)
    error_of_zip(zipped(files))
    assert not jsonschema.Draft202012Validator(dataset_schema()).is_valid(plain(read_yaml(files[YAML], YAML).data))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("vehicle:\n", "wing: {name: a}\nvehicle:\n"),
        ("body_pitch_deg: 83.0", "body_pitch_deg: 130"),
        ("body_pitch_deg: 83.0", "body_pitch_deg: 83, phase_lag_deg: 0"),
        ("claps: true", "claps: yes"),
        ("order: 2", "order: 9"),
        ("    root_pitch_deg: 90.0\n", ""),
    ],
)
def test_the_schema_refuses_the_same_of_a_vehicle(old: str, new: str) -> None:
    files = vehicle_yaml(old, new)
    error_of_zip(zipped(files))
    assert not jsonschema.Draft202012Validator(dataset_schema()).is_valid(plain(read_yaml(files[YAML], YAML).data))


def test_the_vehicle_of_the_page_loads() -> None:
    dataset = load_archive(zipped(vehicle_example()), "page.zip")
    assert [r.name for r in dataset.fitted] == ["hover"]
    assert math.isclose(dataset.recordings[0].condition.angle_of_attack, math.radians(83.0))
    assert dataset.vehicle.motion.root_pitch == math.pi / 2
    hover, forward = dataset.recordings
    assert hover.forces == ("x", "z")
    assert hover.values[0].tolist() == [0.168, 0.048]
    assert forward.low_pass == LowPass(40.0, 4)
    assert forward.mass == 0.0184
    assert forward.motion is not None
    assert forward.motion.peel_end == 0.17
    assert forward.standard_deviation is not None
    assert forward.standard_deviation.tolist() == [0.005, 0.004]


def test_the_example_of_the_page_loads() -> None:
    dataset = load_archive(zipped(example()), "page.zip")
    assert [r.name for r in dataset.fitted] == ["vacuum-3hz"]
    assert math.isclose(dataset.recordings[0].condition.phase_lag, math.radians(7.0))
    assert dataset.recordings[0].condition.pressure == 1000.0
    assert not dataset.recordings[0].valid[2, 3:].any()
    assert dataset.recordings[1].standard_deviation is not None
    assert set(dataset.recordings[1].standard_deviation) == {0.0005}


def test_the_four_bar_of_the_page_loads() -> None:
    text = block("yaml")
    start, end = text.index("  drive:"), text.index("  estimates:")
    files = {**example(), YAML: (text[:start] + block("yaml", 1) + text[end:]).encode()}
    drive = load_archive(zipped(files), "page.zip").wing.drive
    assert drive == FourBarDrive(0.06, 0.012, 0.055, 0.03, -math.pi / 2)


def test_the_converter_of_the_page_works(tmp_path: Path) -> None:
    source, target = tmp_path / "xyzpts.csv", tmp_path / "out.csv"
    with source.open("w", newline="") as file:
        rows = [[f"pt{p}_{axis}" for p in (1, 2) for axis in "XYZ"], *([["1", "2", "3", "NaN", "NaN", "NaN"]] * 8)]
        csv.writer(file).writerows(rows)
    scope: dict[str, Any] = {}
    exec(block("python"), scope)  # noqa: S102 - the page is ours
    convert: Callable[[Path, Path], None] = scope["convert"]
    convert(source, target)
    tracks = read_tracks(target.read_bytes(), "out.csv", ["root", "tip"])
    assert tracks.times[6] == 0.1
    assert tracks.values[0, :3].tolist() == [0.001, 0.002, 0.003]
    assert not (tracks.values[:, 3:] == tracks.values[:, 3:]).any()


def test_the_errors_of_the_page_are_the_real_ones() -> None:
    shown = [line for line in PAGE.splitlines() if line.startswith("dataset.yaml, line")]
    assert str(error_of_zip(zipped(with_yaml("chord_m: 0.21", "chord_m: 210")))) == shown[0]


def test_the_table_lists_every_limit() -> None:
    names = [n for n in vars(limits_module) if n.isupper() and n not in {"MIB", "FORMAT_VERSION", "MAX_ERRORS"}]
    missing = [name for name in names if f"`{name}`" not in PAGE]
    assert missing == []
    for name in ("MAX_ROWS", "MAX_RECORDINGS", "MAX_VALUES", "MAX_ENTRIES", "MAX_STATIONS", "MIN_FRAMES"):
        row = next(line for line in PAGE.splitlines() if f"`{name}`" in line)
        assert str(getattr(limits_module, name)) in row
    assert json.loads(schema_text()) == dataset_schema()
