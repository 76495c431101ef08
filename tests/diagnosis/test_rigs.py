"""The rigs as subjects of a diagnosis, and the pendulum against known solutions."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.diagnosis.pendulum_rig import (
    FREQUENCIES,
    GENES,
    MARKERS,
    REACH,
    SLIDING,
    SUSPECTS,
    TORQUE,
    Pendulum,
    PendulumRig,
    at,
    blank,
    recorded,
)
from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis import DiagnosisSpec, check
from wingfit.diagnosis.candidate_conditions import MAX_BETWEEN, MAX_BEYOND
from wingfit.diagnosis.rigs import MAX_BODIES, VehicleSubject, WingSubject, subject_of
from wingfit.diagnosis.subject import BeatSubject
from wingfit.records import Dataset, LowPass, Wing
from wingfit.sim.effects.ports.markers import nearest
from wingfit.sim.filtering import default_cutoff
from wingfit.sim.model import Array
from wingfit.sim.virtual_rigs.balance import TRIALS, delfly
from wingfit.sim.virtual_rigs.balance import blank_recording as blank_forces
from wingfit.sim.virtual_rigs.campaign import SMALL, blank_recording, name_of, robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

FOUR_BODIES = CalibrationSpec(division="4")
NOMINAL = {gene.name: gene.nominal for gene in GENES}
TYPICAL = {name: value for suspect in SUSPECTS for name, value in suspect.typical.items()}


@pytest.fixture(scope="module")
def wing() -> Dataset:
    robird = robird_wing()
    return Dataset("wing", robird, tuple(blank_recording(robird, c, name_of(c), frames=40) for c, _ in SMALL))


@pytest.fixture(scope="module")
def vehicle() -> Dataset:
    blanks = [blank_forces(trial.condition, trial.name, 64) for trial in TRIALS]
    return Dataset("vehicle", delfly(), tuple(replace(b, forces=("x",), values=b.values[:, :1]) for b in blanks))


@pytest.fixture(scope="module")
def subjects(wing: Dataset, vehicle: Dataset) -> dict[str, BeatSubject]:
    return {
        "wing": subject_of(wing, FOUR_BODIES),
        "vehicle": subject_of(vehicle, CalibrationSpec()),
        "pendulum": PendulumRig(),
    }


def nominal(subject: BeatSubject) -> Array:
    return np.array([[gene.nominal for gene in subject.model.genes]])


RIGS = ("wing", "vehicle", "pendulum")


@pytest.mark.parametrize("rig", RIGS)
def test_suspects_switched_off_change_nothing(subjects: dict[str, BeatSubject], rig: str) -> None:
    """Own genes come first, then those of the suspects; all at nominal they simulate the nominal model exactly."""
    subject = subjects[rig]
    names = [suspect.name for suspect in subject.suspects]
    extended = subject.extended(names)
    own = len(subject.model.genes)
    assert extended.genes[:own] == tuple(subject.model.genes)
    assert extended.genes[own:] == tuple(gene for suspect in subject.suspects for gene in suspect.genes)
    condition = subject.candidate_conditions()[0]
    with_all = subject.simulated_recording(extended, np.array([gene.nominal for gene in extended.genes]), condition)
    own_alone = subject.simulated_recording(subject.model, nominal(subject)[0], condition)
    assert with_all is not None
    assert own_alone is not None
    assert with_all.values.tobytes() == own_alone.values.tobytes()


@pytest.mark.parametrize("rig", RIGS)
def test_suspects_are_consistent(subjects: dict[str, BeatSubject], rig: str) -> None:
    for suspect in subjects[rig].suspects:
        names = [gene.name for gene in suspect.genes]
        assert set(suspect.size_genes) <= set(names) == set(suspect.typical)
        assert set(suspect.location_genes.values()) <= set(suspect.shape_genes)
        assert all(gene.nominal == 0.0 for gene in suspect.genes if gene.name in suspect.size_genes)
        assert any(suspect.typical[name] != 0.0 for name in suspect.size_genes)
        for gene in suspect.genes:
            gene.check(suspect.typical[gene.name])
        assert suspect.source
        assert suspect.signature


@pytest.mark.parametrize("rig", RIGS)
def test_simulated_recordings_are_complete_and_aligned(subjects: dict[str, BeatSubject], rig: str) -> None:
    """All channels under every candidate condition: the model reproduces its recording, which starts at a beat."""
    subject = subjects[rig]
    conditions = subject.candidate_conditions()
    assert 5 < len(conditions) <= MAX_BETWEEN + MAX_BEYOND
    assert len(set(conditions)) == len(conditions)
    for condition in conditions[::13]:
        shown = subject.simulated_recording(subject.model, nominal(subject)[0], condition)
        assert shown is not None
        assert shown.condition == condition
        assert shown.valid.all()
        assert len(subject.channel_locations(shown)) == shown.values.shape[1] == len(shown.channels)
        np.testing.assert_allclose(subject.model.observe(nominal(subject), shown).channels[0], shown.values, atol=1e-9)
        assert subject.beat_start_phase(shown) == pytest.approx(0.0, abs=1e-6)


def test_a_failed_simulation_gives_no_recording(subjects: dict[str, BeatSubject]) -> None:
    subject = subjects["wing"]
    genome = nominal(subject)[0]
    genome[[gene.name for gene in subject.model.genes].index("L_a")] = 1e6
    assert subject.simulated_recording(subject.model, genome, subject.candidate_conditions()[0]) is None


def test_requested_effects_are_in_the_nominal_wing(wing: Dataset) -> None:
    subject = subject_of(wing, replace(FOUR_BODIES, effects=("hinge_offset",)))
    assert isinstance(subject, WingSubject)
    assert "hinge_offset" in subject.model.effects
    assert "hinge_offset" not in {suspect.name for suspect in subject.suspects}
    assert "hinge_offset" in {suspect.name for suspect in subject_of(wing, FOUR_BODIES).suspects}
    assert "Hinge offset" in subject.description


def test_a_vehicle_term_is_a_suspect_only_where_omitted(vehicle: Dataset) -> None:
    has = {s.name for s in subject_of(vehicle, CalibrationSpec()).suspects}
    lacks = {s.name for s in subject_of(vehicle, CalibrationSpec(without=("clap_and_peel",))).suspects}
    apart = replace(vehicle, rig=replace(vehicle.vehicle, claps=False))
    assert lacks - has == {"clap_and_peel"}
    assert {s.name for s in subject_of(apart, CalibrationSpec(without=("clap_and_peel",))).suspects} == has
    assert "berman_wang" in subject_of(vehicle, CalibrationSpec(preset="berman_wang")).description


def test_invalid_requests_are_refused_before_any_simulation(wing: Dataset) -> None:
    subject = subject_of(wing, FOUR_BODIES)
    genome = nominal(subject)
    moving = [replace(r, values=subject.model.observe(genome, r).channels[0]) for r in wing.recordings]
    known = replace(wing, recordings=tuple(moving))
    check(known, DiagnosisSpec(calibration=FOUR_BODIES))
    short = replace(moving[0], name="short", times=moving[0].times[:3], values=moving[0].values[:3])
    for dataset, spec, message in (
        (
            replace(known, recordings=(*moving, short), held_out=("short",)),
            DiagnosisSpec(),
            "'short': none of the reference markers",
        ),
        (known, DiagnosisSpec(start={"mass_of_nothing": 1.0}), "mass_of_nothing"),
        (known, DiagnosisSpec(refits=0), "refits is 0"),
        (known, DiagnosisSpec(suspects=("nothing",)), "unknown suspect 'nothing'"),
    ):
        with pytest.raises(ValueError, match=message):
            check(dataset, replace(spec, calibration=FOUR_BODIES))


def test_channel_locations_and_outline_of_a_wing(subjects: dict[str, BeatSubject], wing: Dataset) -> None:
    subject, recording = subjects["wing"], wing.recordings[0]
    places = subject.channel_locations(recording)
    stations = wing.wing.stations
    for place, channel in zip(places, recording.channels, strict=True):
        assert channel == f"{place.name}_{place.axis}"
        assert place.span is not None
        assert place.chord is not None
        assert place.y == pytest.approx(stations[0].y + place.span * wing.wing.span)
        y, leading, chord = ([getattr(s, name) for s in stations] for name in ("y", "leading_edge", "chord"))
        expected = np.interp(place.y or 0.0, y, leading) + place.chord * np.interp(place.y or 0.0, y, chord)
        assert place.x == pytest.approx(expected, abs=1e-5)
    x, y = np.array(subject.outline).T
    assert subject.outline[0] == subject.outline[-1]
    area = abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2
    assert area == pytest.approx(np.trapezoid([s.chord for s in stations], [s.y for s in stations]))


def test_a_marker_fault_is_tested_at_every_marker(wing: Dataset) -> None:
    rig, suspects = wing.rig, {s.name: s for s in subject_of(wing, CalibrationSpec()).suspects}
    assert isinstance(rig, Wing)
    for name in ("marker_slip", "marker_swap"):
        station, chord = np.array(suspects[name].candidate_shapes).T
        assert nearest(rig, {"station": station, "chord": chord})[:, 0].tolist() == list(range(len(rig.markers)))
    assert suspects["lumped_mass"].candidate_shapes == ()


def test_coefficients_that_vary_with_flight_are_the_only_description(subjects: dict[str, BeatSubject]) -> None:
    described = {s.name for s in subjects["vehicle"].suspects if s.descriptive}
    assert described == {"varying_coefficients"}


def test_finer_wings_refine_both_directions_up_to_a_limit(subjects: dict[str, BeatSubject], wing: Dataset) -> None:
    divisions, subject = [], subjects["wing"]
    assert isinstance(subject, WingSubject)
    while True:
        coarse = subject.model.structure.division
        divisions.append(coarse.total)
        finer = subject.finer_subjects()
        for one in finer:
            fine = one.model.structure.division
            assert len(fine.bodies) > len(coarse.bodies)
            assert max(fine.bodies) >= max(coarse.bodies)
            assert coarse.total < fine.total <= MAX_BODIES
        if not finer:
            break
        subject = finer[-1]
    assert divisions[0] == 4
    assert len(divisions) > 2
    eleven = subject_of(wing, CalibrationSpec(division="11"))
    assert isinstance(eleven, WingSubject)
    assert [one.model.structure.division.bodies for one in eleven.finer_subjects()] == [(3,) * 6, (4,) * 6]


def test_a_finer_discretisation_estimates_the_error_of_the_coarse_one(subjects: dict[str, BeatSubject]) -> None:
    """With 4 bodies, against a wing finer than any that a diagnosis uses."""
    subject = subjects["wing"]
    assert isinstance(subject, WingSubject)
    finer = subject.finer_subjects()[-1]
    best = FlexibleWing(subject.model.wing, "10x6")
    found = [
        subject.simulated_recording(model, nominal(subject)[0], SMALL[5][0])
        for model in (subject.model, finer.model, best)
    ]
    coarse, fine, true = (one.values for one in found if one is not None)
    estimated, error = (np.sqrt(np.mean((coarse - other) ** 2)) for other in (fine, true))
    assert estimated == pytest.approx(error, rel=0.5)
    assert np.sqrt(np.mean((fine - true) ** 2)) < 0.7 * error


def test_a_vehicle_is_refined_only_where_forces_change(vehicle: Dataset) -> None:
    subject = subject_of(vehicle, CalibrationSpec())
    assert isinstance(subject, VehicleSubject)
    assert subject.finer_subjects() == (), "40 elements are enough"
    coarse = replace(subject, model=replace(subject.model, elements=3, instants=80))
    (finer,) = coarse.finer_subjects()
    assert finer.model.elements == 6


# -- the third rig ---------------------------------------------------------------------------------------------


def angle(values: Mapping[str, float], frequency: float, torque: tuple[float, ...] = TORQUE) -> Array:
    """Fourier series of the angle: cosines, then sines."""
    return Pendulum(torque=torque).angle(NOMINAL | dict(values), at(frequency))


def sampled(series: Array, phase: Array) -> Array:
    harmonics = len(series) // 2
    turn = phase[:, None] * np.arange(harmonics + 1)
    found: Array = np.cos(turn) @ series[: harmonics + 1] + np.sin(turn[:, 1:]) @ series[harmonics + 1 :]
    return found


@pytest.mark.parametrize("frequency", FREQUENCIES)
def test_a_linear_pendulum_follows_its_transfer_function(frequency: float) -> None:
    rate = 2 * np.pi * frequency
    expected = TORQUE[0] / (NOMINAL["stiffness"] - NOMINAL["inertia"] * rate**2 + 1j * rate * NOMINAL["damping"])
    series = angle({}, frequency)
    assert series[1] == pytest.approx(expected.real, rel=1e-12)
    assert series[1 + len(series) // 2] == pytest.approx(-expected.imag, rel=1e-12)


def test_a_hardening_spring_has_the_exact_motion() -> None:
    """theta = a cos psi without damping needs (k - I w^2) a + 3/4 k_3 a^3 and 1/4 k_3 a^3 (Hsu 1960)."""
    a, k3, frequency = 0.3, 0.4, 1.5
    rate = 2 * np.pi * frequency
    first = (NOMINAL["stiffness"] - NOMINAL["inertia"] * rate**2) * a + 0.75 * k3 * a**3
    series = angle({"cubic.k3": k3, "damping": 0.0}, frequency, (first, 0.0, 0.25 * k3 * a**3))
    assert series[1] == pytest.approx(a, rel=1e-9)
    np.testing.assert_allclose(np.delete(series, 1), 0.0, atol=1e-9)


def test_dry_friction_has_den_hartogs_amplitude() -> None:
    """x_0 = (P / k) sqrt(V^2 - (F / P)^2 U^2), V = 1 / (1 - b^2), U = sin(pi / b) / (b (1 + cos(pi / b))) (1931)."""
    friction, frequency = 1.5e-3, 1.7
    b = 2 * np.pi * frequency / np.sqrt(NOMINAL["stiffness"] / NOMINAL["inertia"])
    v, u = 1 / (1 - b**2), np.sin(np.pi / b) / (b * (1 + np.cos(np.pi / b)))
    expected = TORQUE[0] / NOMINAL["stiffness"] * np.sqrt(v**2 - (friction / TORQUE[0] * u) ** 2)
    series = angle({"friction.torque": friction, "damping": 0.0}, frequency)
    found = np.abs(sampled(series, np.linspace(0, 2 * np.pi, 2000))).max()
    assert found == pytest.approx(expected, rel=2e-3)
    assert found < 0.999 * np.abs(angle({"damping": 0.0}, frequency)).max()


def test_a_point_mass_sags_by_its_weight_over_the_stiffness() -> None:
    """At rest m g r cos theta = -k theta."""
    mass, station = 4e-3, 0.6
    series = angle({"point_mass.mass": mass, "point_mass.station": station}, 1.2, (0.0,))
    moment = mass * at(1.2).gravity * station * REACH
    assert series[0] < 0
    assert NOMINAL["stiffness"] * series[0] == pytest.approx(-moment * np.cos(series[0]), rel=1e-9)


@pytest.mark.parametrize("frequency", [1.2, 2.0, 3.4])
def test_all_effects_agree_with_time_integration(frequency: float) -> None:
    values = NOMINAL | TYPICAL
    mass, lever = values["point_mass.mass"], REACH * values["point_mass.station"]
    inertia, rate = values["inertia"] + mass * lever**2, 2 * np.pi * frequency

    def course(t: float, y: Array) -> list[float]:
        pull = values["damping"] * y[1] + values["stiffness"] * y[0] + values["cubic.k3"] * y[0] ** 3
        pull += values["friction.torque"] * np.tanh(y[1] / SLIDING) + mass * 9.80665 * lever * np.cos(y[0])
        return [y[1], (TORQUE[0] * np.cos(rate * t) - pull) / inertia]

    beats, phase = 25, np.arange(20) / 20
    times = (beats + phase) / frequency
    solved = solve_ivp(course, (0.0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(sampled(angle(values, frequency), 2 * np.pi * phase), solved.y[0], atol=1e-5)


def test_camera_faults_move_markers_not_the_arm() -> None:
    empty = blank(at(2.0))
    part, delay = 0.03, 4e-3
    rig = PendulumRig()
    base = rig.model.observe(nominal(rig), empty).channels[0]
    scaled = rig.extended(["gain"]).observe([[*nominal(rig)[0], part]], empty).channels[0]
    np.testing.assert_allclose(scaled, base * (1 + part), atol=1e-15)
    late = replace(empty, times=empty.times + delay)
    delayed = rig.extended(["delay"]).observe([[*nominal(rig)[0], delay]], late).channels[0]
    np.testing.assert_allclose(delayed, base, atol=1e-13)
    reach = np.linalg.norm(base.reshape(len(base), -1, 3), axis=2)
    np.testing.assert_allclose(reach, np.tile(list(MARKERS.values()), (len(base), 1)), rtol=1e-12)


def test_recordings_are_motion_plus_noise() -> None:
    truth = {"cubic.k3": 0.3, "stiffness": 0.22}
    noise, clean = (recorded(truth, noise=level) for level in (3e-4, 0.0))
    left = np.concatenate([a.values - b.values for a, b in zip(noise, clean, strict=True)])
    assert np.std(left) == pytest.approx(3e-4, rel=0.05)
    memory = np.mean(left[1:] * left[:-1]) / np.mean(left**2)
    assert memory == pytest.approx(0.5, abs=0.06)
    model = PendulumRig().extended(["cubic"])
    for recording in clean:
        values = model.observe([[0.22, *nominal(PendulumRig())[0, 1:], 0.3]], recording).channels[0]
        np.testing.assert_allclose(values, recording.values, atol=1e-13)


def test_the_pendulum_is_fast_and_robust() -> None:
    model = PendulumRig().extended([suspect.name for suspect in SUSPECTS])
    rng = np.random.default_rng(3)
    batch = np.array([[TYPICAL.get(g.name, g.nominal) * rng.uniform(0.7, 1.3) for g in model.genes] for _ in range(60)])
    batch[:, [g.name for g in model.genes].index("point_mass.station")] = rng.uniform(0, 1, 60)
    begun = time.process_time()
    reasons = [model.observe(batch, blank(at(f))).reasons for f in FREQUENCIES]
    spent = (time.process_time() - begun) / (len(FREQUENCIES) * len(batch))
    assert all(reason is None for each in reasons for reason in each)
    assert spent < 5e-3, "a millisecond on a free core"


def test_simulated_forces_are_low_passed_like_fitted_ones(vehicle: Dataset) -> None:
    through, whole = (subject_of(vehicle, CalibrationSpec(low_pass=low_pass)) for low_pass in (None, 0.0))
    condition, genome = through.candidate_conditions()[0], nominal(through)[0]
    filtered, plain = (one.simulated_recording(one.model, genome, condition) for one in (through, whole))
    assert filtered is not None
    assert plain is not None
    assert plain.low_pass is None
    assert filtered.low_pass == LowPass(default_cutoff(condition.flap_frequency))
    assert np.std(filtered.values, axis=0)[1] < 0.99 * np.std(plain.values, axis=0)[1]
