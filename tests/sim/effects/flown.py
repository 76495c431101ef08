"""A vehicle under one effect: its forces over a beat, with and without, and as a model that has the same otherwise."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from tests.sim.vehicle.vehicles import COEFFICIENTS, genome, plate, recording
from tests.sim.vehicle.vehicles import DELFLY as DELFLY
from wingfit.records import FourierFlap, FourierPitch, Recording, Vehicle
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import chosen

Array = npt.NDArray[np.float64]
Values = dict[str, Any]

FAST = recording(12.5, 2.0, math.radians(30.0))
FOURIER = replace(
    DELFLY.motion, pitch=FourierPitch(1.5, (0.1, 0.05), (-0.7, 0.02)), flap=FourierFlap(0.3, (-0.34,), (0.05,))
)
# Effects of the flow at the stations, whose memory is measured in chords, of the wake, and of the wing's inertia.
BESIDE: tuple[Values, ...] = (
    {},
    {"circulation_lag__share": 0.5},
    {"stall_vortex__share": 0.5},
    {"elastic_twist__compliance": 0.1},
    {"wake_capture__share": 0.3},
    {"leading_edge_suction__change": 0.5},
    {"tip_loss__spacing": 0.03},
    {"wake_tip_loss__share": 1.0},
    {"induced_inflow__share": 1.0, "induced_inflow__outward": 0.5},
    {"downwash__share": 1.0},
    {"mass_offset__distance": 0.005, "wing_acceleration__share": 1.0},
)


def flown(
    vehicle: Vehicle = DELFLY, rec: Recording = FAST, terms: tuple[str, ...] = chosen("proposed"), **values: float
) -> Array:
    """Forces [n, 2] (N) over a beat; ``values`` of genes, those of effects as effect__parameter."""
    effects = tuple(dict.fromkeys(name.partition("__")[0] for name in values if "__" in name))
    model = BladeElementWing(vehicle, terms, effects=effects)
    known = {gene.name for gene in model.genes}
    own = {name: value for name, value in COEFFICIENTS.items() if name in known}
    named = {name.replace("__", "."): value for name, value in values.items()}
    return np.asarray(model.beat([genome(model, **(own | named))], rec)[0])


def check_outline(effect: str, side: str, part: float, beside: Values) -> None:
    """Forces with an ``effect`` of size ``part`` are those of a vehicle whose stations have another ``side``."""
    stations = (replace(one, **{side: (1.0 + part) * getattr(one, side)}) for one in DELFLY.stations)
    other, size = replace(DELFLY, stations=tuple(stations)), Values({f"{effect}__part": part})
    found = flown(DELFLY, FAST, **(size | beside))
    np.testing.assert_allclose(found, flown(other, FAST, **beside), atol=1e-14)
    assert np.sqrt(np.mean((found - flown(DELFLY, FAST, **beside)) ** 2)) > 1e-3


def without(*names: str) -> tuple[str, ...]:
    """Terms of the nominal model but ``names``."""
    return chosen("proposed", names)


def alone(*names: str) -> tuple[str, ...]:
    """``names`` only."""
    return names


def gliding(pitch: float, speed: float = 3.0, **changes: float) -> tuple[Vehicle, Recording]:
    """One rectangular wing at rest, its chord at ``pitch`` (rad) from the body, in a stream along the body."""
    vehicle = plate(FourierFlap(0.0, (1e-12,), (0.0,)), FourierPitch(math.pi / 2 + pitch, (), ()))
    return replace(vehicle, **changes), recording(10.0, speed)  # type: ignore[arg-type]


def density(rec: Recording) -> float:
    """Of the air of a recording, kg/m^3."""
    return float(rec.condition.pressure / (287.05 * rec.condition.temperature))


def refused(name: str, terms: tuple[str, ...]) -> bool:
    """Whether a model of these terms refuses the effect."""
    assert EFFECTS[name].fits(terms) != (EFFECTS[name].term in terms or EFFECTS[name].of_term not in ("", *terms))
    try:
        BladeElementWing(DELFLY, terms, effects=(name,))
    except ValueError:
        return True
    return False
