"""Sheets and rigid wings against closed forms: inertia about the hinge, rotation by the drive, sag of a cantilever."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.sim.wing.without_rods import animal, blank, flat, nominal
from wingfit.records import FourBarDrive, Hinge, Materials, Recording, Station, Wing
from wingfit.records.dataset import Condition
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.drive import flap_angle
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.loads import simulate_outputs
from wingfit.sim.wing.planform import Planform, bodies, wing_mass


def inertia_about_hinge(wing: Wing) -> float:
    planform = Planform(wing)
    parts = bodies(planform, planform.panels(Division((2, 2, 2, 2))))
    arm = np.array([wing.hinge.y, wing.hinge.z])
    return sum(float(p.inertia[0, 0] + p.mass * ((p.centre[1:] - arm) ** 2).sum()) for p in parts)


def test_mass_and_inertia_of_a_rectangle_about_the_hinge() -> None:
    c, length, d, sigma, h = 0.08, 0.3, 0.05, 0.5, 0.004
    wing = replace(flat(c, length, h, sigma), hinge=Hinge(-d, 0.0))
    assert math.isclose(wing_mass(wing), sigma * c * length, rel_tol=1e-9)
    faces = sigma * c * length * h**2 / 4  # half of the skin is on each face
    expected = sigma * c * ((length + d) ** 3 - d**3) / 3 + faces
    assert math.isclose(inertia_about_hinge(wing), expected, rel_tol=1e-9)


def test_a_density_times_thickness_distributes_the_mass() -> None:
    # thickness falls linearly to the tip: areal density rho h0 (1 - y / L), as in an arm with muscles at its root
    c, length, rho, h0 = 0.08, 0.3, 400.0, 0.012
    stations = (Station(0.0, 0.0, c, h0), Station(length, 0.0, c, 1e-9))
    wing = replace(flat(c, length), stations=stations, materials=Materials(rho, 0.0))
    assert math.isclose(wing_mass(wing), rho * h0 * c * length / 2, rel_tol=1e-6)
    through = rho * c * length * h0**3 / 12 / 4  # integral of h^3 / 12
    assert math.isclose(inertia_about_hinge(wing), rho * h0 * c * length**3 / 12 + through, rel_tol=1e-3)


@pytest.mark.parametrize("drive", ["fourier", "four-bar"])
def test_the_markers_of_a_rigid_wing_turn_with_the_drive_exactly(drive: str) -> None:
    wing = animal("rigid")
    if drive == "four-bar":
        wing = replace(wing, drive=FourBarDrive(0.06, 0.012, 0.055, 0.03, math.radians(-90.0)))
    model = FlexibleWing(wing, "4")
    beat = model.beat(nominal(model), blank(wing))
    angle = flap_angle(wing.drive, 2 * np.pi * np.arange(len(beat.tracks)) / len(beat.tracks))[:, 0, None]
    rest, hinge = np.array([marker.position for marker in wing.markers]), wing.hinge
    out, up = rest[:, 1] - hinge.y, rest[:, 2] - hinge.z
    assert np.abs(beat.tracks[:, :, 0] - rest[:, 0]).max() < 1e-15
    assert np.abs(beat.tracks[:, :, 1] - hinge.y - out * np.cos(angle) + up * np.sin(angle)).max() < 1e-14
    assert np.abs(beat.tracks[:, :, 2] - hinge.z - out * np.sin(angle) - up * np.cos(angle)).max() < 1e-14


def test_the_recording_of_a_rigid_wing_is_its_rotation_whatever_the_genes() -> None:
    wing = animal("rigid")
    model, recording = FlexibleWing(wing, "11"), blank(wing)
    genomes = np.stack([nominal(model), nominal(model, E_f=2e7, L_a=9.0)])
    seen = model.observe(genomes, recording)
    assert seen.reasons == (None, None)
    assert np.abs(seen.channels - recording.values).max() < 1e-12


def test_effects_of_the_drive_move_a_rigid_wing() -> None:
    wing = animal("rigid")
    model, recording = FlexibleWing(wing, "4", effects=("stroke_bias", "hinge_offset")), blank(wing)
    tracks = model.beat(nominal(model, stroke_bias_angle=0.1, hinge_offset_z=0.02), recording).tracks
    angle = 0.1 + flap_angle(wing.drive, 2 * np.pi * np.arange(len(tracks)) / len(tracks))[:, 0]
    x, y, z = wing.markers[4].position
    out, up = y - wing.hinge.y, z - wing.hinge.z - 0.02
    expected = wing.hinge.z + 0.02 + out * np.sin(angle) + up * np.cos(angle)
    assert np.abs(tracks[:, 4, 2] - expected).max() < 1e-14
    assert np.abs(tracks[:, 4, 0] - x).max() < 1e-14


def test_effects_that_cannot_show_are_refused() -> None:
    rigid = {name for name, effect in EFFECTS.items() if effect.applies_to(animal("rigid"))}
    sheet = {name for name, effect in EFFECTS.items() if effect.applies_to(animal("sheet"))}
    assert {"stroke_amplitude", "hinge_tilt", "scale_error", "tracker_lag"} < rigid
    assert rigid.isdisjoint({"added_mass", "lumped_mass", "damage", "compliant_drive", "backlash", "phase_lag_error"})
    assert {"added_mass", "damage", "compliant_drive"} < sheet
    assert sheet.isdisjoint({"rod_slip", "phase_lag_error"})
    with pytest.raises(ValueError, match="'added_mass' does not apply to a rigid wing; there are stroke_amplitude"):
        FlexibleWing(animal("rigid"), "4", effects=("added_mass",))
    with pytest.raises(ValueError, match="loads of a rigid wing are not computed"):
        simulate_outputs(
            FlexibleWing(animal("rigid"), "4"),
            nominal(FlexibleWing(animal("rigid"), "4")).tolist(),
            blank(animal("rigid")),
        )


def test_a_sheet_sags_like_a_cantilever() -> None:
    # Tip deflection w g L^4 / (8 E I) of a uniform cantilever; a chain of n springs converges with the second order.
    c, length, h, sigma, E = 0.08, 0.3, 0.004, 0.5, 2e8
    expected = sigma * c * 9.80665 * length**4 / (8 * E * c * h**3 / 12)
    wing = flat(c, length, h, sigma)
    still = Recording(
        "r", "vacuum_chamber", Condition(3.0, 0.0, 0.0, 293.15), np.arange(8) / 24, ("tip", "mid"), np.zeros((8, 6))
    )
    errors = []
    for division in ("8x1", "16x1"):
        model = FlexibleWing(wing, division)
        beat = model.beat(nominal(model, E_f=E, G_f=E / 2.6, D_E=E * 2e-3), still)
        assert beat.reason is None
        errors.append(-beat.tracks[:, 0, 2].mean() / expected - 1)
    assert abs(errors[1]) < 5e-3
    assert 3.5 < errors[0] / errors[1] < 6.5


def test_the_root_of_a_sheet_is_held_at_its_whole_chord() -> None:
    for division, held in (("4", 2), ("6x4", 4), ("3,3,3,2", 3)):
        structure = FlexibleWing(animal("sheet"), division).structure
        roots = [c for c in structure.connectors if c.first < 0]
        assert len(roots) == held
        assert {c.first for c in roots} == {-1, -2}
        chord = animal("sheet").stations[0].chord
        area = sum(float(c.foam[3]) for c in roots) * (structure.bodies[0].centroid[1] - animal("sheet").stations[0].y)
        assert math.isclose(area, chord * animal("sheet").stations[0].thickness, rel_tol=1e-9)


def test_genes_of_rods_have_no_influence_on_a_sheet() -> None:
    wing = animal("sheet")
    model, recording = FlexibleWing(wing, "4"), blank(wing)
    seen = model.observe(np.stack([nominal(model), nominal(model, E_r=3e11, G_r=9e9)]), recording)
    assert np.array_equal(seen.channels[0], seen.channels[1])
    assert not {"E_r", "G_r"} & set(model.searched)
    assert FlexibleWing(animal("rigid"), "4").searched == ()
