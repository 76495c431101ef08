"""Data classes of wingfit: wings, vehicles, conditions, recordings, genes; and their files. No physics is computed.

All quantities are SI, angles in radians; unit suffixes appear only in files and over HTTP.
Axes (docs/notation.md) of a wing: x aft along the chord, y outboard along the span, z up, the hinge axis parallel to x;
of a vehicle: x forward to the nose, z down.
"""

from wingfit.records.camera_pose import CameraPose
from wingfit.records.dataset import (
    AnyDataset,
    AnyRecording,
    Condition,
    Dataset,
    FrameError,
    LowPass,
    Recording,
    RigLimits,
    wing_or_vehicle,
)
from wingfit.records.drive import Drive, FourBarDrive, FourierDrive
from wingfit.records.errors import DatasetError, Fault
from wingfit.records.files.storage import load_archive, load_dataset, save_dataset
from wingfit.records.genes import EstimateError, Gene, Genome
from wingfit.records.series import Channel, Quantity, Series, SeriesDataset
from wingfit.records.vehicle import (
    ChordStation,
    Flap,
    FourierFlap,
    FourierPitch,
    PassivePitch,
    Pitch,
    SplitCycleFlap,
    Vehicle,
    WingMotion,
)
from wingfit.records.wing import Hinge, Marker, Materials, Rod, Station, Wing

__all__ = [
    "AnyDataset",
    "AnyRecording",
    "CameraPose",
    "Channel",
    "ChordStation",
    "Condition",
    "Dataset",
    "DatasetError",
    "Drive",
    "EstimateError",
    "Fault",
    "Flap",
    "FourBarDrive",
    "FourierDrive",
    "FourierFlap",
    "FourierPitch",
    "FrameError",
    "Gene",
    "Genome",
    "Hinge",
    "LowPass",
    "Marker",
    "Materials",
    "PassivePitch",
    "Pitch",
    "Quantity",
    "Recording",
    "RigLimits",
    "Rod",
    "Series",
    "SeriesDataset",
    "SplitCycleFlap",
    "Station",
    "Vehicle",
    "Wing",
    "WingMotion",
    "load_archive",
    "load_dataset",
    "save_dataset",
    "wing_or_vehicle",
]  # fmt: skip
