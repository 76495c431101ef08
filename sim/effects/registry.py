"""All effects, in the order in which they act on a scene."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from wingfit.records import Vehicle, Wing
from wingfit.sim.effects.contract import Effect

# Files of the library, each of which declares EFFECT.
_PLACES: tuple[str, ...] = (
    # structure: changes of the springs before effects in proportion to their stiffness
    "structure.damage",
    "structure.cubic_stiffness",
    "structure.rod_slip",
    "structure.hysteresis",
    "structure.viscoelastic",
    "structure.tether",
    # inertia
    "inertia.lumped_mass",
    "inertia.mass_offset",
    # actuation
    "actuation.stroke_amplitude",
    "actuation.stroke_bias",
    "actuation.drive_harmonics",
    "actuation.phase_lag_error",
    "actuation.hinge_tilt",
    "actuation.hinge_offset",
    "actuation.compliant_drive",
    "actuation.backlash",
    # aerodynamics, each acting on the result of those before: stream, coefficients of the angle of attack, circulation,
    # wake
    "aerodynamics.residual_air",
    "aerodynamics.airspeed_error",
    "aerodynamics.added_mass",
    "aerodynamics.leading_edge_vortex",
    "aerodynamics.viscous_drag",
    "aerodynamics.plate_drag",
    "aerodynamics.dynamic_stall",
    "aerodynamics.rotational_circulation",
    "aerodynamics.circulation_lag",
    "aerodynamics.clap_and_peel",
    "aerodynamics.varying_coefficients",
    "aerodynamics.tip_loss",
    "aerodynamics.induced_inflow",
    "aerodynamics.wake_capture",
    # measurement of tracks, along the path of the signal: wing, image, tracker, frame
    "cameras.marker_slip",
    "cameras.rolling_shutter",
    "cameras.camera_desync",
    "cameras.lens_distortion",
    "cameras.marker_swap",
    "cameras.tracker_lag",
    "cameras.camera_rotation",
    "cameras.camera_shift",
    # measurement of forces: axes, mount, amplifier
    "balance.balance_tilt",
    "balance.balance_resonance",
    "balance.filter_delay",
    "balance.balance_offset",
    "balance.balance_drift",
    # measurement of both
    "recording.scale_error",
    "recording.clock_offset",
    "recording.strobe_rate",
)

EFFECTS: dict[str, Effect] = {
    place.rpartition(".")[2]: import_module(f"wingfit.sim.effects.library.{place}").EFFECT for place in _PLACES
}


def chosen(names: Iterable[str], rig: Wing | Vehicle) -> tuple[Effect, ...]:
    """Effects by ``names``, in the order of the registry; ValueError if unknown, repeated or not for ``rig``."""
    wanted = list(names)
    for name in wanted:
        if name not in EFFECTS:
            raise ValueError(f"unknown effect {name!r}; there are {', '.join(EFFECTS)}")
        if wanted.count(name) > 1:
            raise ValueError(f"effect {name!r} is named {wanted.count(name)} times; name it once")
        if not EFFECTS[name].applies_to(rig):
            kind = "wing" if isinstance(rig, Wing) else "vehicle"
            known = ", ".join(n for n, effect in EFFECTS.items() if effect.applies_to(rig))
            raise ValueError(f"effect {name!r} does not apply to a {kind}; there are {known}: remove it")
    return tuple(effect for name, effect in EFFECTS.items() if name in wanted)
