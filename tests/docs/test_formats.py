"""The published schema and docs/formats.md say what the code does."""

from __future__ import annotations

import json
import math
from decimal import Decimal
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from tests.docs.pages import blocks
from tests.records.malformed import YAML, error_of_zip, good_files, with_yaml, zipped
from tests.records.series_samples import good_series, series_yaml
from tests.records.vehicles import good_vehicle, vehicle_yaml
from wingfit.records import FourBarDrive, LowPass, SeriesDataset, load_archive, wing_or_vehicle
from wingfit.records import limits as limits_module
from wingfit.records.description.schema import dataset_schema, schema_text
from wingfit.records.description.yaml_text import read_yaml
from wingfit.records.limits import FORMAT_VERSION

jsonschema: Any = import_module("jsonschema")
DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "formats.md").read_text(encoding="utf-8")


def block(file: str) -> str:
    return next(block.text for block in blocks("docs/formats.md") if block.file == file)


def plain(value: Any) -> Any:
    if isinstance(value, Decimal):
        return float(value)
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list) else value


def example() -> dict[str, bytes]:
    tracks = block("falcon/recordings/vacuum-3hz.csv").encode()
    return {
        YAML: block("falcon/dataset.yaml").encode(),
        **{f"recordings/{n}-3hz.csv": tracks for n in ("vacuum", "tunnel")},
    }


def vehicle_example() -> dict[str, bytes]:
    forces = block("hoverer/recordings/hover.csv").encode()
    files = {f"recordings/{name}.csv": forces for name in ("hover", "forward")}
    return {YAML: block("hoverer/dataset.yaml").encode(), **files}


def series_example() -> dict[str, bytes]:
    samples = block("arm/recordings/light-1.csv").encode()
    files = {f"recordings/{name}.csv": samples for name in ("light-1", "light-2", "heavy")}
    return {YAML: block("arm/dataset.yaml").encode(), **files}


def test_the_published_schema_is_the_code_s() -> None:
    published = (DOCS / "schemas" / "dataset.schema.json").read_text(encoding="utf-8")
    assert published == schema_text(), (
        "run: python -m wingfit.records.description.schema > docs/schemas/dataset.schema.json"
    )


def test_the_schema_is_valid_and_versioned() -> None:
    schema = dataset_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for model in ("WingDatasetFile", "VehicleDatasetFile", "SeriesDatasetFile"):
        assert schema["$defs"][model]["properties"]["format_version"]["const"] == FORMAT_VERSION


@pytest.mark.parametrize(
    "raw",
    [
        *(good_files()[YAML], example()[YAML], good_vehicle()[YAML], vehicle_example()[YAML]),
        *(good_series()[YAML], series_example()[YAML]),
    ],
    ids=["wing", "page's wing", "vehicle", "page's vehicle", "series", "page's series"],
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


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("rig: motor arm\n", "rig: motor arm\nwing: {name: a}\n"),
        ("rig: motor arm\n", ""),
        ("unit: rad", "unit: 2"),
        ("unit: rad", 'unit: ""'),
        ("standard_deviation: 0.002", "standard_deviation: 0"),
        ("period_s: 0.25", "period_s: 0"),
        ("gear: 20.0}", "gear: high}"),
        ("repeats: light", "flap_frequency_hz: 3"),
    ],
)
def test_the_schema_refuses_the_same_of_a_series(old: str, new: str) -> None:
    files = series_yaml(old, new)
    error_of_zip(zipped(files))
    assert not jsonschema.Draft202012Validator(dataset_schema()).is_valid(plain(read_yaml(files[YAML], YAML).data))


def test_the_series_of_the_page_loads() -> None:
    dataset = load_archive(zipped(series_example()), "page.zip")
    assert isinstance(dataset, SeriesDataset)
    assert [r.name for r in dataset.fitted] == ["light-1", "light-2"]
    assert [(one.name, one.unit) for one in dataset.settings] == [("mass", "kg"), ("gear", "1")]
    light, _, heavy = dataset.recordings
    assert light.values[0].tolist() == [0.021, 0.31]
    assert light.inputs["voltage"][:3].tolist() == [0.0, 1.2, 2.4]
    assert (light.settings, light.estimates) == ({"mass": 0.1, "gear": 20.0}, {"angle0": 0.02})
    assert (light.repeats, heavy.period) == ("light", 0.5)
    assert [one.standard_deviation for one in dataset.channels] == [0.002, None]


def test_the_vehicle_of_the_page_loads() -> None:
    dataset = wing_or_vehicle(load_archive(zipped(vehicle_example()), "page.zip"))
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
    dataset = wing_or_vehicle(load_archive(zipped(example()), "page.zip"))
    assert [r.name for r in dataset.fitted] == ["vacuum-3hz"]
    assert math.isclose(dataset.recordings[0].condition.phase_lag, math.radians(7.0))
    assert dataset.recordings[0].condition.pressure == 1000.0
    assert not dataset.recordings[0].valid[2, 3:].any()
    assert dataset.recordings[1].standard_deviation is not None
    assert set(dataset.recordings[1].standard_deviation) == {0.0005}


def test_the_four_bar_of_the_page_loads() -> None:
    text = block("falcon/dataset.yaml")
    start, end = text.index("  drive:"), text.index("  estimates:")
    files = {**example(), YAML: (text[:start] + block("four-bar.yaml") + text[end:]).encode()}
    drive = wing_or_vehicle(load_archive(zipped(files), "page.zip")).wing.drive
    assert drive == FourBarDrive(0.06, 0.012, 0.055, 0.03, -math.pi / 2)


def test_every_limit_stands_in_the_table() -> None:
    names = [n for n in vars(limits_module) if n.isupper() and n not in {"MIB", "FORMAT_VERSION", "MAX_ERRORS"}]
    missing = [name for name in names if f"`{name}`" not in PAGE]
    assert missing == []
    for name in ("MAX_ROWS", "MAX_RECORDINGS", "MAX_VALUES", "MAX_ENTRIES", "MAX_STATIONS", "MIN_FRAMES"):
        row = next(line for line in PAGE.splitlines() if f"`{name}`" in line)
        assert str(getattr(limits_module, name)) in row
    assert json.loads(schema_text()) == dataset_schema()
