"""Writes the reference of the public names of the package, whose texts Sphinx takes from their docstrings."""

from __future__ import annotations

import inspect

import wingfit

# Every public name stands on one page, in the order in which one needs them.
PAGES: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "diagnosing": (
        "Calibrate, diagnose, plan",
        "They run in the calling process, without a server.",
        (
            "calibrate", "CalibrationSpec", "Result", "RecordingResult", "GeneResult", "ForceResult", "SeriesResult",
            "diagnose", "DiagnosisSpec", "Finding", "finding_json", "html", "plan", "PlanSpec", "Plan",
        ),
    ),
    "datasets": (
        "Datasets",
        "Recordings with the description of their rig, read and written.",
        (
            "load_dataset", "save_dataset", "check_dataset", "examine", "Mistake", "DatasetError", "DatasetWarning",
            "Dataset", "SeriesDataset", "Recording", "Series", "Condition", "Channel", "Quantity", "Gene", "Genome",
        ),
    ),
    "importing": (
        "Files of tracking systems, balances and cameras",
        "From the files of others to tracks, forces and the description of a wing.",
        (
            "import_tracks", "ImportedTracks", "align_tracks", "align_recordings", "AlignedTracks", "marker_noise",
            "MarkerNoise", "track_film", "TrackedFilm", "import_forces", "ImportedForces", "wing_template",
            "WingTemplate", "wing_drawing",
        ),
    ),
    "rigs": (
        "Rigs of your own",
        "A simulation of your own, of any rig; :doc:`/docs/rigs` explains the contract.",
        ("Rig", "Run", "Port", "Suspect", "SimulationError", "declaration", "drive"),
    ),
    "plots": (
        "Plots",
        "Figures of runs, findings and datasets; :doc:`/docs/plots` shows them.",
        ("plot",),
    ),
    "client": (
        "The client of a server",
        "Sends requests to ``wingfit serve``; :doc:`/docs/api` explains the calls.",
        ("Client", "WingfitError", "ServerAwayError"),
    ),
}  # fmt: skip
_INDEX = """Python
======

``import wingfit`` is fast: a module is imported when one of its names is first used. The names on these pages are
public; everything else in the package may change without notice.

.. toctree::

"""


def pages() -> dict[str, str]:
    """Return the pages in reStructuredText, by path below the folder of references.

    ValueError if a public name stands on no page, or on more than one.
    """
    listed = [name for _, _, names in PAGES.values() for name in names]
    wrong = set(listed) ^ set(wingfit.__all__) | {name for name in listed if listed.count(name) > 1}
    if wrong:
        raise ValueError(f"these must stand on one page of the manual, docs/manual/python.py: {sorted(wrong)}")
    index = _INDEX + "".join(f"   {name}\n" for name in PAGES)
    return {"python/index.rst": index} | {f"python/{name}.rst": _page(*one) for name, one in PAGES.items()}


def _function(name: str) -> str:
    """Return the section on a function of a module of the package, such as plot.history."""
    return f"{name}\n{'-' * len(name)}\n\n.. autofunction:: wingfit.{name}"


def _page(title: str, words: str, names: tuple[str, ...]) -> str:
    parts = [f"{title}\n{'=' * len(title)}", words]
    for name in names:
        found = getattr(wingfit, name)
        if inspect.ismodule(found):
            parts += [_function(f"{name}.{one}") for one in found.__all__]
            continue
        kind = "autofunction" if inspect.isfunction(found) else "autoclass"
        if isinstance(found, type) and issubclass(found, Exception):
            kind = "autoexception"
        members = "" if kind == "autofunction" else "\n   :members:"
        parts.append(f"{name}\n{'-' * len(name)}\n\n.. {kind}:: wingfit.{name}{members}")
    return "\n\n".join(parts) + "\n"
