"""Reads the description of a wing alone, from a file of its own or from ``dataset.yaml``."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from wingfit.records.description.convert import to_rig
from wingfit.records.description.dataset_file import WingDatasetFile
from wingfit.records.description.explain import check_description
from wingfit.records.description.yaml_text import Document, read_yaml
from wingfit.records.errors import fail
from wingfit.records.wing import Wing

# Completes a wing to a dataset, so that the same checks and messages serve for both.
_COMPLETED = {
    "format_version": 1,
    "name": "wing",
    "recordings": [
        {
            "name": "none",
            "rig": "vacuum_chamber",
            "flap_frequency_hz": 1,
            "phase_lag_deg": 0,
            "pressure_mbar": 1000,
            "temperature_c": 20,
        }
    ],
}


def read_wing(path: str | PathLike[str]) -> Wing:
    """Read the wing in a YAML file: that of ``wing:`` in ``dataset.yaml``, or its keys alone; or a dataset's folder.

    DatasetError lists what is wrong. Recordings in the file are not read.
    """
    place = Path(path)
    place = place / "dataset.yaml" if place.is_dir() else place
    try:
        raw = place.read_bytes()
    except OSError as error:
        raise fail(str(path), None, f"cannot be read: {error.strerror or error}; check the path") from None
    return parse_wing(raw, place.name)


def parse_wing(raw: bytes, name: str) -> Wing:
    """Return the wing that the bytes ``raw`` of the file ``name`` describe; as :func:`read_wing` of that file."""
    document = read_yaml(raw, name)
    data = document.data
    if not isinstance(data, dict):
        raise fail(name, None, "describes no wing: it must have the key 'wing', or the keys of a wing")
    for other in ("vehicle", "rig"):
        if other in data:
            raise fail(document.where((other,)), None, f"describes a {other}; tracks are aligned to a wing: give one")
    wing = data.get("wing", data)
    places = document.places if "wing" in data else {("wing", *key): at for key, at in document.places.items()}
    checked = check_description(Document(document.file, {**_COMPLETED, "wing": wing}, places))
    assert isinstance(checked, WingDatasetFile)  # noqa: S101 - vehicles and other rigs are refused above
    rig = to_rig(checked)
    assert isinstance(rig, Wing)  # noqa: S101
    return rig
