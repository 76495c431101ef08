"""List all effects, in the order in which they are applied to a simulation."""

from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from wingfit.records import Vehicle, Wing
from wingfit.sim.effects.contract import Effect

# Files of the library, each of which declares EFFECT, by folder.
FILES = (
    # changes of the springs before effects in proportion to their stiffness
    ("structure", "stiffness_drift damage cubic_stiffness rod_slip hysteresis viscoelastic tether cable"),
    ("inertia", "lumped_mass mass_offset"),
    ("terms", "inertial wing_acceleration wing_mass_error wing_length_error wing_chord_error"),
    ("actuation", "stroke_amplitude stroke_bias drive_harmonics phase_lag_error"),
    ("actuation", "wing_pitch_zero wing_pitch_amplitude wing_pitch_phase elastic_twist"),
    ("actuation", "hinge_tilt hinge_offset compliant_drive backlash"),
    # each acts on the result of those before: stream, coefficients of the angle of attack, circulation, wake
    ("stream", "residual_air airspeed_error body_pitch_convention body_pitch_error body_drag tail_lift"),
    ("aerodynamics", "added_mass"),
    ("terms", "added_mass_error pitch_axis_error effective_chord translation viscous"),
    (
        "aerodynamics",
        "zero_lift_angle lift_curve leading_edge_vortex viscous_drag plate_drag dynamic_stall stall_vortex "
        "leading_edge_suction",
    ),
    ("aerodynamics", "rotational_circulation circulation_lag clap_and_peel varying_coefficients"),
    ("wake", "tip_loss wake_tip_loss induced_inflow wake_capture downwash"),
    # along the path of the signal: wing, image, tracker, frame
    ("cameras", "marker_slip rolling_shutter camera_desync lens_distortion"),
    ("cameras", "marker_swap tracker_lag exponential_smoothing camera_rotation camera_shift"),
    # axes, mount, amplifier
    ("balance", "phase_reference axis_sign axis_swap unit_error"),
    ("balance", "balance_tilt balance_resonance filter_delay balance_offset balance_drift axis_scale"),
    ("recording", "scale_error clock_offset strobe_rate"),
)

EFFECTS: dict[str, Effect] = {
    name: import_module(f"wingfit.sim.effects.library.{folder}.{name}").EFFECT
    for folder, names in FILES
    for name in names.split()
}


def chosen(names: Iterable[str], rig: Wing | Vehicle) -> tuple[Effect, ...]:
    """Return the effects ``names``, in the registry's order; ValueError if unknown, repeated or not for ``rig``."""
    wanted = list(names)
    for name in wanted:
        if name not in EFFECTS:
            raise ValueError(f"unknown effect {name!r}; there are {', '.join(EFFECTS)}")
        if wanted.count(name) > 1:
            raise ValueError(f"effect {name!r} is named {wanted.count(name)} times; name it once")
        if not EFFECTS[name].applies_to(rig):
            kind = f"{rig.structure or ''} wing".strip() if isinstance(rig, Wing) else "vehicle"
            known = ", ".join(n for n, effect in EFFECTS.items() if effect.applies_to(rig))
            raise ValueError(f"effect {name!r} does not apply to a {kind}; there are {known}: remove it")
    return tuple(effect for name, effect in EFFECTS.items() if name in wanted)
