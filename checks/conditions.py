"""Conditions and the description, against physics that needs no recording: air, masses, densities."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from wingfit.checks.mistake import Edit, KeyEdit, Kind, Mistake, change_of
from wingfit.records import Dataset, Recording, Vehicle, Wing
from wingfit.sim.atmosphere import density

GROUND = (600.0, 1085.0)  # mbar: laboratories on the ground, from 4000 m above the sea to below it
ROOM = (-30.0, 45.0)  # degrees Celsius
ZERO_C = 273.15
FASTEST = 25.0  # m/s in a wind tunnel with flapping wings: beyond, the unit is likely km/h
LIGHTEST_ROD, LIGHTEST_FOAM = 60.0, 1.3  # kg/m^3: balsa has 100, air 1.2
MEMBRANE = (15.0, 30_000.0)  # kg/m^3, of wing mass over area times thickness
# Mass (kg) of flying animals with the span b (m) of one wing is about 2.5 (2 b)^2.5 (Greenewalt 1962); vehicles with
# batteries and toys lie within a factor of 40.
ALLOMETRY, SPREAD = (0.67, 2.56), 60.0
STREAM = 1.0  # m/s
ATMOSPHERE_MMHG, NEAR_ATMOSPHERE = 760.0, 0.3  # as a pressure in mbar, that of a place 2360 m above the sea
PRESSURES = ((10.0, "kPa"), (1000.0, "bar"), (1.333224, "mmHg"), (0.01, "Pa"))


def check_conditions(dataset: Dataset) -> Iterator[Mistake]:
    """Yield mistakes in conditions and description of ``dataset``."""
    for index, recording in enumerate(dataset.recordings):
        yield from _air(index, recording)
    if isinstance(dataset.rig, Wing):
        yield from _wing(dataset.rig)
    else:
        yield from _vehicle(dataset.rig)


def _key(
    kind: Kind, path: tuple[str | int, ...], where: str, value: str, expected: str, cause: str, new: float | None,
    old: float, *, certain: bool = False,
) -> Mistake:  # fmt: skip
    edits: tuple[Edit, ...] = () if new is None else (KeyEdit(path, f"{old:.9g}", f"{new:.9g}"),)
    change = change_of(edits) if edits else f"dataset.yaml, {path[-1]}"
    return Mistake(kind, where, value, expected, cause, change, certain, edits)


def _air(index: int, recording: Recording) -> Iterator[Mistake]:
    condition, where = recording.condition, f"recording {recording.name!r}"
    mbar, celsius, at = condition.pressure / 100.0, condition.temperature - ZERO_C, ("recordings", index)
    rho = f"air of {density(condition.pressure, condition.temperature):.3g} kg/m^3"
    streaming = recording.rig in ("wind_tunnel", "free_flight") or condition.airspeed > STREAM
    if streaming and not GROUND[0] <= mbar <= GROUND[1]:
        fits = [(factor, unit) for factor, unit in PRESSURES if 900.0 <= mbar * factor <= 1060.0]
        factor, unit = fits[0] if fits else (0.0, "")
        yield _key(
            "air pressure", (*at, "pressure_mbar"), where, f"pressure_mbar is {mbar:.6g} with a stream: {rho}",
            f"{GROUND[0]:g} to {GROUND[1]:g} mbar", f"the pressure is in {unit}" if unit else "another unit than mbar",
            mbar * factor if unit else None, mbar,
        )  # fmt: skip
    elif streaming and abs(mbar - ATMOSPHERE_MMHG) <= NEAR_ATMOSPHERE:
        yield _key(
            "air pressure", (*at, "pressure_mbar"), where,
            f"pressure_mbar is {mbar:.6g}, the number of the standard atmosphere in mmHg: {rho}",
            "1013.25 mbar, unless the rig stands 2360 m above the sea", "the pressure is in mmHg",
            round(mbar * 1.333224, 2), mbar,
        )  # fmt: skip
    if not ROOM[0] <= celsius <= ROOM[1]:
        fahrenheit = (celsius - 32.0) / 1.8
        american = 5.0 <= fahrenheit <= 40.0
        yield _key(
            "air temperature", (*at, "temperature_c"), where, f"temperature_c is {celsius:.6g}",
            f"{ROOM[0]:g} to {ROOM[1]:g} degrees Celsius",
            "the temperature is in degrees Fahrenheit" if american else "another unit, or an unusual rig",
            round(fahrenheit, 6) if american else None, celsius,
        )  # fmt: skip
    if condition.airspeed > FASTEST:
        yield _key(
            "airspeed", (*at, "airspeed_m_s"), where, f"airspeed_m_s is {condition.airspeed:.6g}",
            f"at most {FASTEST:g} m/s for flapping wings", "the airspeed is in km/h", condition.airspeed / 3.6,
            condition.airspeed,
        )  # fmt: skip
    if recording.rig == "vacuum_chamber" and condition.airspeed > STREAM:
        yield Mistake(
            "pressure and rig", where, f"rig is vacuum_chamber with an airstream of {condition.airspeed:g} m/s",
            "no stream in a vacuum chamber", "the rig or the airspeed belongs to another recording",
            f"dataset.yaml, recordings[{index}]: rig or airspeed_m_s",
        )  # fmt: skip


def _wing(wing: Wing) -> Iterator[Mistake]:
    materials = wing.materials
    if 0.0 < materials.foam_density < LIGHTEST_FOAM:  # 0: all mass is that of the skin
        yield _key(
            "density", ("wing", "materials", "foam_density_kg_m3"), "dataset.yaml: wing.materials",
            f"foam_density_kg_m3 is {materials.foam_density:.6g}, less than air", "10 to 200 kg/m^3",
            "the density is in g/cm^3", 1000.0 * materials.foam_density, materials.foam_density, certain=True,
        )  # fmt: skip
    for index, rod in enumerate(wing.rods):
        if rod.density < LIGHTEST_ROD:
            yield _key(
                "density", ("wing", "rods", index, "density_kg_m3"), f"dataset.yaml: wing.rods[{index}]",
                f"density_kg_m3 is {rod.density:.6g}, of rod {rod.name!r}", "500 to 8000 kg/m^3; balsa has 100",
                "the density is in g/cm^3", 1000.0 * rod.density, rod.density, certain=True,
            )  # fmt: skip
    yield from _thickness(wing)
    yield from _marker_masses(wing)


def _thickness(wing: Wing) -> Iterator[Mistake]:
    """Foam thicker than a third of the chord is no wing; 10 mm written as 0.1 m is."""
    ratios = np.array([station.thickness / station.chord for station in wing.stations])
    if np.median(ratios) > 0.35:
        edits = tuple(
            KeyEdit(("wing", "stations", k, "thickness_m"), f"{s.thickness:.9g}", f"{s.thickness / 10:.9g}")
            for k, s in enumerate(wing.stations)
        )
        yield Mistake(
            "thickness", "dataset.yaml: wing.stations",
            f"the wing is {np.median(ratios):.2g} chords thick", "at most a third of the chord",
            "the thickness is in another unit than metres (10 times too large)", change_of(edits), False, edits,
        )  # fmt: skip


def _marker_masses(wing: Wing) -> Iterator[Mistake]:
    y = np.array([station.y for station in wing.stations])
    chord, thick = (np.array([getattr(s, name) for s in wing.stations]) for name in ("chord", "thickness"))
    area = float(np.trapezoid(chord, y))
    own = wing.materials.foam_density * float(np.trapezoid(chord * thick, y)) + wing.materials.skin_areal_density * area
    own += sum(
        np.hypot(r.x_tip - r.x_root, r.y_tip - r.y_root)
        * (r.density * np.pi / 4 * r.diameter**2 + r.glue_linear_density)
        for r in wing.rods
    )
    total = sum(marker.mass for marker in wing.markers)
    if total > 2.0 * own:
        edits = tuple(
            KeyEdit(("wing", "markers", k, "mass_kg"), f"{m.mass:.9g}", f"{m.mass / 1000:.9g}")
            for k, m in enumerate(wing.markers)
        )
        yield Mistake(
            "mass", "dataset.yaml: wing.markers", f"all markers together weigh {total:.3g} kg, the wing {own:.3g} kg",
            "markers that are lighter than the wing", "the masses of the markers are in grams", change_of(edits),
            total > 5.0 * own, edits,
        )  # fmt: skip


def _vehicle(vehicle: Vehicle) -> Iterator[Mistake]:
    usual = ALLOMETRY[0] * (2.0 * vehicle.span) ** ALLOMETRY[1]
    ratio = vehicle.mass / usual
    if not 1 / SPREAD <= ratio <= SPREAD:
        grams = 1 / SPREAD <= ratio / 1000.0 <= SPREAD
        yield _key(
            "mass", ("vehicle", "mass_kg"), "dataset.yaml: vehicle.mass_kg",
            f"is {vehicle.mass:.6g} kg with wings of {vehicle.span:.3g} m",
            f"about {usual:.2g} kg, within a factor of {SPREAD:g}",
            "the mass is in grams" if grams else "another unit of mass or of length",
            vehicle.mass / 1000.0 if grams else None, vehicle.mass,
        )  # fmt: skip
    r, chord = (np.array([getattr(s, name) for s in vehicle.stations]) for name in ("r", "chord"))
    material = vehicle.wing_mass / (float(np.trapezoid(chord, r)) * vehicle.thickness)
    if not MEMBRANE[0] <= material <= MEMBRANE[1]:
        heavy = material > MEMBRANE[1]
        by_mass = heavy and vehicle.wing_mass > 0.3 * vehicle.mass / vehicle.wings
        yield _key(
            "mass" if by_mass else "thickness",
            ("vehicle", "wing_mass_kg" if by_mass else "thickness_m"),
            f"dataset.yaml: vehicle.{'wing_mass_kg' if by_mass else 'thickness_m'}",
            f"wing_mass_kg and thickness_m give a wing material of {material:.3g} kg/m^3",
            f"{MEMBRANE[0]:g} to {MEMBRANE[1]:g} kg/m^3",
            "the mass of a wing is in grams" if by_mass else "the thickness, or the mass, is in another unit",
            vehicle.wing_mass / 1000.0 if by_mass else None,
            vehicle.wing_mass if by_mass else vehicle.thickness,
        )  # fmt: skip
