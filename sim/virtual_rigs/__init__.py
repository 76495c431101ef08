"""Simulated experiments that write datasets: the wing campaign of the thesis, and a balance with the DelFly."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from wingfit.records import Dataset, save_dataset

FILES = (".zip", ".nc")  # endings of the name of a dataset in one file


def save_with_truth(dataset: Dataset, truth: Mapping[str, object], path: Path) -> Path:
    """Write ``dataset`` to ``path`` (folder, .zip or .nc) and ``truth``, its true parameters, to a JSON file there.

    The dataset has the name of the folder or file, by which it differs from others of the same rig. Returns the path
    of the JSON file.
    """
    name = path.resolve().name
    save_dataset(replace(dataset, name=Path(name).stem if path.suffix in FILES else name), path)
    truth_path = path.with_name(path.stem + ".truth.json")
    truth_path.write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")
    return truth_path
