"""Effects that can be hidden in the simulated flapping vehicle, from all files with laws.

The diagnosis has its own library of effects; an effect that both have follows an equation of another form here, where
the literature has one.
"""

from __future__ import annotations

from benchmarks.concealed.plant.law import Law
from benchmarks.concealed.plant.vehicle.flow import Array as Array
from benchmarks.concealed.plant.vehicle.flow import Complex as Complex
from benchmarks.concealed.plant.vehicle.flow import Flow as Flow
from benchmarks.concealed.plant.vehicle.laws_body import AFTERWARDS as AFTERWARDS
from benchmarks.concealed.plant.vehicle.laws_body import BODY
from benchmarks.concealed.plant.vehicle.laws_circulation import CIRCULATION as CIRCULATION
from benchmarks.concealed.plant.vehicle.laws_circulation import LOADING
from benchmarks.concealed.plant.vehicle.laws_circulation import fling as fling
from benchmarks.concealed.plant.vehicle.laws_circulation import tip as tip
from benchmarks.concealed.plant.vehicle.laws_inertia import INERTIA
from benchmarks.concealed.plant.vehicle.laws_motion import MOTION
from benchmarks.concealed.plant.vehicle.laws_motion import levered as levered
from benchmarks.concealed.plant.vehicle.laws_stream import GUSTS as GUSTS
from benchmarks.concealed.plant.vehicle.laws_stream import STREAM
from benchmarks.concealed.plant.vehicle.laws_stream import blocked as blocked
from benchmarks.concealed.plant.vehicle.laws_stream import disc_inflow as disc_inflow

LAWS: dict[str, Law] = {law.name: law for law in (*LOADING, *STREAM, *MOTION, *INERTIA, *BODY)}
"""All laws by name."""
