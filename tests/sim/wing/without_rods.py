"""Wings without rods, and recordings of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from tests.records.samples import falcon_wing, rigid_tracks
from wingfit.records import Condition, Dataset, FourierDrive, Hinge, Marker, Materials, Recording, Station, Wing
from wingfit.records.array_types import Array
from wingfit.records.wing import Structure
from wingfit.sim.wing.flexible_wing import FlexibleWing

STIFF = {"E_f": 6e7, "G_f": 2.2e7, "D_E": 6e5, "D_G": 2.5e5}


def animal(structure: Structure) -> Wing:
    """The planform of the falcon without rods, 1.2 kg/m^2, flapping by 30 degrees."""
    drive = FourierDrive(0.0, (0.0,), (math.radians(30.0),))
    materials = Materials(foam_density=0.0, skin_areal_density=1.2)
    return replace(
        falcon_wing(), structure=structure, rods=(), driven_rods=(), materials=materials, drive=drive, estimates=STIFF
    )


def flat(chord: float = 0.08, span: float = 0.3, thickness: float = 0.004, areal_density: float = 0.5) -> Wing:
    """A rectangular sheet that is held still, with massless markers at mid-span and at the tip."""
    return replace(
        animal("sheet"),
        stations=(Station(0.0, 0.0, chord, thickness), Station(span, 0.0, chord, thickness)),
        materials=Materials(0.0, areal_density),
        markers=tuple(Marker(n, (chord / 2, y, 0.0), 0.0) for n, y in (("tip", span * 0.9999), ("mid", span / 2))),
        reference_markers=("tip",),
        hinge=Hinge(0.0, 0.0),
        drive=FourierDrive(0.0, (0.0,), (0.0,)),
        estimates={},
    )


def nominal(model: FlexibleWing, **values: float) -> Array:
    return np.array([values.get(gene.name.replace(".", "_"), gene.nominal) for gene in model.genes])


def blank(wing: Wing, frequency: float = 3.0, name: str = "r", frames: int = 90) -> Recording:
    """Three beats in vacuum of a wing that turns rigidly."""
    condition = Condition(frequency, 0.0, 1000.0, 293.15)
    times = np.arange(frames) * 3 / (frequency * frames)
    names = tuple(marker.name for marker in wing.markers)
    return Recording(name, "vacuum_chamber", condition, times, names, rigid_tracks(wing, condition, times))


def recorded(model: FlexibleWing, genome: Array, noise: float = 5e-4) -> Dataset:
    """Simulated recordings at three flap frequencies with noise, the last held out."""
    rng, recordings = np.random.default_rng(3), []
    for name, frequency in (("a", 2.0), ("b", 3.0), ("c", 4.0)):
        one = blank(model.wing, frequency, name)
        values = model.observe(genome[None], one).channels[0] + rng.normal(0.0, noise, one.values.shape)
        recordings.append(replace(one, values=values))
    return Dataset("animal", model.wing, tuple(recordings), ("c",))
