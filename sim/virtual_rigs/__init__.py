"""Simulated experiments that write datasets: the wing campaign of the thesis, and a balance with the DelFly."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

from wingfit.records import Dataset, save_dataset


def save_with_truth(dataset: Dataset, truth: Mapping[str, object], path: Path) -> Path:
    """Write ``dataset`` to ``path`` (folder, .zip or .nc) and ``truth``, its true parameters, to a JSON file there.

    Returns the path of the JSON file.
    """
    save_dataset(dataset, path)
    truth_path = path.with_name(path.stem + ".truth.json")
    truth_path.write_text(json.dumps(truth, indent=2) + "\n", encoding="utf-8")
    return truth_path
