"""All effects, in the order in which they act on a scene."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from records import Vehicle, Wing
from sim.effects.contract import Effect

# One line each: a file of this folder that declares EFFECT.
_NAMES: tuple[str, ...] = (
    # structure: what changes the springs before what takes its measure from them
    "damage",
    "cubic_stiffness",
    "rod_slip",
    "hysteresis",
    "viscoelastic",
    # inertia
    "lumped_mass",
    "mass_offset",
    # actuation
    "stroke_amplitude",
    "stroke_bias",
    "drive_harmonics",
    "phase_lag_error",
    "hinge_tilt",
    "hinge_offset",
    "compliant_drive",
    "backlash",
    # aerodynamics, in the order in which each sees what the last changed: stream, coefficients of the angle of attack,
    # circulation of all kinds, wake
    "residual_air",
    "airspeed_error",
    "added_mass",
    "leading_edge_vortex",
    "viscous_drag",
    "plate_drag",
    "dynamic_stall",
    "rotational_circulation",
    "circulation_lag",
    "clap_and_peel",
    "varying_coefficients",
    "tip_loss",
    "induced_inflow",
    "wake_capture",
    # measurement, on the way of a track: wing, image, tracker, frame
    "marker_slip",
    "rolling_shutter",
    "camera_desync",
    "lens_distortion",
    "marker_swap",
    "tracker_lag",
    "camera_rotation",
    "camera_shift",
    # of a force: axes, mount, amplifier
    "balance_tilt",
    "balance_resonance",
    "filter_delay",
    "balance_offset",
    "balance_drift",
    # of both
    "scale_error",
    "clock_offset",
    "strobe_rate",
)

EFFECTS: dict[str, Effect] = {name: import_module(f"sim.effects.{name}").EFFECT for name in _NAMES}


def chosen(names: Iterable[str], rig: Wing | Vehicle) -> tuple[Effect, ...]:
    """The effects called ``names``, in the order of the registry; ValueError for one unknown, repeated or of no use."""
    wanted = list(names)
    for name in wanted:
        if name not in EFFECTS:
            raise ValueError(f"unknown effect {name!r}; there are {', '.join(EFFECTS)}")
        if wanted.count(name) > 1:
            raise ValueError(f"effect {name!r} is named {wanted.count(name)} times; name it once")
        if not EFFECTS[name].applies_to(rig):
            kind = "wing" if isinstance(rig, Wing) else "vehicle"
            known = ", ".join(n for n, effect in EFFECTS.items() if effect.applies_to(rig))
            raise ValueError(f"effect {name!r} does not apply to a {kind}; there are {known}: leave it out")
    return tuple(effect for name, effect in EFFECTS.items() if name in wanted)
