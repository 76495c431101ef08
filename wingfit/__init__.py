"""wingfit calibrates simulations of flapping wings on recordings, and reports which physics they are missing.

The names below are public and documented; everything else in the package may change without notice.

- :class:`Client` sends requests to a wingfit server (``wingfit serve``); it raises :class:`WingfitError`.
- :func:`load_dataset` reads recordings from a folder, a zip file of a folder, or NetCDF. If they are not valid, it
raises :class:`DatasetError`, which lists what is wrong.
- :func:`import_tracks` reads marker tracks from the files of motion-capture systems and digitisers, and returns
:class:`ImportedTracks`; :func:`align_tracks` brings them to the frame of a described wing, :class:`AlignedTracks`;
:func:`align_recordings` those of several recordings to one frame; :func:`marker_noise` reads their covariances,
:class:`MarkerNoise`.
- :func:`import_forces` reads forces from the files of balances, and returns :class:`ImportedForces`.
- :func:`wing_template` describes a wing by an outline of its planform, and returns :class:`WingTemplate`;
:func:`wing_drawing` draws a described wing as SVG.
- :func:`calibrate` estimates the genes of a model in this process, without a server; :func:`diagnose` reports which
physics the model is missing; :func:`plan` predicts which genes and effects an experiment will identify.
- :func:`drive` simulates a rig of the user's own for a job on a server, which knows only its :func:`declaration`.
- :class:`Rig` is a rig with a simulation of the user's own; :class:`Suspect` an effect that it may be missing,
:class:`Port` a place where laws may act, :class:`Run` what its simulation computes.
- :mod:`wingfit.plot` draws runs, findings and datasets with plotly.

``import wingfit`` is fast: modules are imported when one of their names is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wingfit import plot
    from wingfit._align import align_recordings, align_tracks
    from wingfit._drive import drive
    from wingfit._film import track_film
    from wingfit._local import calibrate, diagnose, plan
    from wingfit.calibration.forces.result import ForceResult
    from wingfit.calibration.result import GeneResult, RecordingResult, Result
    from wingfit.calibration.series.result import SeriesResult
    from wingfit.calibration.spec import CalibrationSpec
    from wingfit.cameras.track.result import TrackedFilm
    from wingfit.checks import DatasetWarning, Mistake, check_dataset, examine, load_dataset
    from wingfit.client.client import Client
    from wingfit.client.transport import ServerAwayError, WingfitError
    from wingfit.diagnosis.finding import Finding
    from wingfit.diagnosis.spec import DiagnosisSpec
    from wingfit.importers import ImportedTracks, import_tracks
    from wingfit.importers.forces import ImportedForces, import_forces
    from wingfit.importers.planform import WingTemplate, wing_template
    from wingfit.planning.outcome import Plan
    from wingfit.planning.spec import PlanSpec
    from wingfit.records import (
        Channel,
        Condition,
        Dataset,
        DatasetError,
        Gene,
        Genome,
        Quantity,
        Recording,
        Series,
        SeriesDataset,
        save_dataset,
    )
    from wingfit.report import finding_json, html
    from wingfit.report.wing_drawing import wing_drawing
    from wingfit.rigs.declaration import declaration
    from wingfit.rigs.ports import Port
    from wingfit.rigs.rig import Rig
    from wingfit.rigs.run import Run, SimulationError
    from wingfit.rigs.suspect import Suspect
    from wingfit.tracking.alignment import AlignedTracks
    from wingfit.tracking.marker_noise import MarkerNoise, marker_noise

__all__ = [
    "AlignedTracks",
    "CalibrationSpec",
    "Channel",
    "Client",
    "Condition",
    "Dataset",
    "DatasetError",
    "DatasetWarning",
    "DiagnosisSpec",
    "Finding",
    "ForceResult",
    "Gene",
    "GeneResult",
    "Genome",
    "ImportedForces",
    "ImportedTracks",
    "MarkerNoise",
    "Mistake",
    "Plan",
    "PlanSpec",
    "Port",
    "Quantity",
    "Recording",
    "RecordingResult",
    "Result",
    "Rig",
    "Run",
    "Series",
    "SeriesDataset",
    "SeriesResult",
    "ServerAwayError",
    "SimulationError",
    "Suspect",
    "TrackedFilm",
    "WingTemplate",
    "WingfitError",
    "align_recordings",
    "align_tracks",
    "calibrate",
    "check_dataset",
    "declaration",
    "diagnose",
    "drive",
    "examine",
    "finding_json",
    "html",
    "import_forces",
    "import_tracks",
    "load_dataset",
    "marker_noise",
    "plan",
    "plot",
    "save_dataset",
    "track_film",
    "wing_drawing",
    "wing_template",
]

_MODULES = {
    "wingfit._align": ("align_recordings", "align_tracks"),
    "wingfit._drive": ("drive",),
    "wingfit._film": ("track_film",),
    "wingfit._local": ("calibrate", "diagnose", "plan"),
    "wingfit.calibration.forces.result": ("ForceResult",),
    "wingfit.calibration.result": ("GeneResult", "RecordingResult", "Result"),
    "wingfit.calibration.series.result": ("SeriesResult",),
    "wingfit.calibration.spec": ("CalibrationSpec",),
    "wingfit.cameras.track.result": ("TrackedFilm",),
    "wingfit.checks": ("DatasetWarning", "Mistake", "check_dataset", "examine", "load_dataset"),
    "wingfit.client.client": ("Client",),
    "wingfit.client.transport": ("ServerAwayError", "WingfitError"),
    "wingfit.diagnosis.finding": ("Finding",),
    "wingfit.diagnosis.spec": ("DiagnosisSpec",),
    "wingfit.importers": ("ImportedTracks", "import_tracks"),
    "wingfit.importers.forces": ("ImportedForces", "import_forces"),
    "wingfit.importers.planform": ("WingTemplate", "wing_template"),
    "wingfit.planning.outcome": ("Plan",),
    "wingfit.planning.spec": ("PlanSpec",),
    "wingfit.records": (
        "Channel",
        "Condition",
        "Dataset",
        "DatasetError",
        "Gene",
        "Genome",
        "Quantity",
        "Recording",
        "Series",
        "SeriesDataset",
        "save_dataset",
    ),
    "wingfit.report": ("finding_json", "html"),
    "wingfit.report.wing_drawing": ("wing_drawing",),
    "wingfit.rigs.declaration": ("declaration",),
    "wingfit.rigs.ports": ("Port",),
    "wingfit.rigs.rig": ("Rig",),
    "wingfit.rigs.run": ("Run", "SimulationError"),
    "wingfit.rigs.suspect": ("Suspect",),
    "wingfit.tracking.alignment": ("AlignedTracks",),
    "wingfit.tracking.marker_noise": ("MarkerNoise", "marker_noise"),
}
_MODULE_OF = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    """Import a public name when it is first used (PEP 562)."""
    if name == "plot":
        return import_module("wingfit.plot")  # which then is an attribute
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'wingfit' has no attribute {name!r}; it has {', '.join(__all__)}")
    found: object = getattr(import_module(_MODULE_OF[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted(__all__)
