"""Under each condition the model is one without the effect, with other coefficients: those that Eq. 23 gives there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.effects.rigs import vehicle_model
from wingfit.records import Recording
from wingfit.sim.effects.library.aerodynamics.varying_coefficients import REFERENCE_FREQUENCY, REFERENCE_PITCH
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import chosen
from wingfit.sim.virtual_rigs.balance import TRIALS, blank_recording, delfly

Array = npt.NDArray[np.float64]

NAME = "varying_coefficients"
SLOPES = {"lift_by_frequency": -3.0, "lift_by_pitch": 0.4, "fling_by_frequency": 2.0, "fling_by_pitch": -0.5}
OWN = {"C_l": 1.3, "C_r": 1.45, "C_F": 1.5, "K_l": 0.8, "K_d": 0.9, "C_Dpi2": 2.0}


def model_of(preset: str) -> BladeElementWing:
    return replace(vehicle_model(), terms=chosen(preset))


def genome(model: BladeElementWing, **values: float) -> list[float]:
    """At OWN, as far as the model has these, and ``values``; those of effects in the form effect__parameter."""
    described = OWN | {name.replace("__", "."): value for name, value in values.items()}
    return [described.get(gene.name, gene.nominal) for gene in model.genes]


def beat(model: BladeElementWing, recording: Recording, **values: float) -> Array:
    return np.asarray(model.beat([genome(model, **values)], recording)[0])


def varied(model: BladeElementWing, recording: Recording, slopes: dict[str, float], **values: float) -> Array:
    """Forces with the effect."""
    described = {f"{NAME}__{key}": value for key, value in slopes.items()}
    return beat(model.with_effects(NAME), recording, **values, **described)


def expected(recording: Recording, kind: str) -> float:
    """The factor in the words of Eq. 23: affine in frequency and pitch, one at 12 Hz and 1 rad."""
    here = recording.condition
    by_frequency, by_pitch = SLOPES[f"{kind}_by_frequency"], SLOPES[f"{kind}_by_pitch"]
    return 1.0 + by_frequency * (here.flap_frequency - 12.0) / 12.0 + by_pitch * (here.angle_of_attack - 1.0)


RECORDINGS = tuple(blank_recording(trial.condition, trial.name) for trial in TRIALS)


@pytest.mark.parametrize("recording", RECORDINGS, ids=lambda recording: recording.name)
def test_is_another_pair_of_coefficients_under_each_condition(recording: Recording) -> None:
    model = model_of("proposed")
    lift, fling = expected(recording, "lift"), expected(recording, "fling")
    other = beat(model, recording, C_l=lift * OWN["C_l"], C_F=fling * OWN["C_F"])
    np.testing.assert_allclose(varied(model, recording, SLOPES), other, atol=1e-13)
    assert np.abs(other - beat(model, recording)).max() > 1e-3


def test_scales_the_lift_of_a_measured_curve_and_not_its_drag() -> None:
    model, recording = model_of("dickinson"), RECORDINGS[0]
    other = beat(model, recording, K_l=expected(recording, "lift") * OWN["K_l"])
    np.testing.assert_allclose(varied(model, recording, SLOPES), other, atol=1e-13)


def test_scales_the_fling_of_an_effect() -> None:
    """Whichever of the two is named first."""
    recording, described = RECORDINGS[7], {f"{NAME}__{key}": value for key, value in SLOPES.items()}
    model = model_of("berman_wang").with_effects("clap_and_peel")
    lift, fling = expected(recording, "lift"), expected(recording, "fling")
    other = beat(model, recording, C_l=lift * OWN["C_l"], clap_and_peel__coefficient=fling * 2.7)
    np.testing.assert_allclose(
        varied(model, recording, SLOPES, clap_and_peel__coefficient=2.7), other, rtol=0, atol=1e-13
    )
    turned = model_of("berman_wang").with_effects(NAME, "clap_and_peel")
    np.testing.assert_allclose(beat(turned, recording, clap_and_peel__coefficient=2.7, **described), other, atol=1e-13)


@pytest.mark.parametrize("name", ["circulation_lag", "dynamic_stall", "induced_inflow", "wake_capture"])
def test_what_reads_the_flow_sees_the_coefficients_that_are_there(name: str) -> None:
    model, recording = model_of("proposed").with_effects(name), RECORDINGS[4]
    typical = {key.replace(".", "__"): value for key, value in EFFECTS[name].typical(delfly()).items()}
    lift, fling = expected(recording, "lift"), expected(recording, "fling")
    other = beat(model, recording, **typical, C_l=lift * OWN["C_l"], C_F=fling * OWN["C_F"])
    np.testing.assert_allclose(varied(model, recording, SLOPES, **typical), other, atol=1e-12)


def test_acts_in_free_flight_as_on_the_balance() -> None:
    """On the motion that a recording brings, and under its own frequency and pitch."""
    model, motion = model_of("proposed"), replace(delfly().motion, root_pitch=1.4)
    flown = replace(RECORDINGS[6], rig="free_flight", motion=motion)
    other = beat(model, flown, C_l=expected(flown, "lift") * OWN["C_l"], C_F=expected(flown, "fling") * OWN["C_F"])
    np.testing.assert_allclose(varied(model, flown, SLOPES), other, atol=1e-13)


def test_inertia_drag_and_rotation_stay() -> None:
    model, recording = model_of("proposed").with_effects(NAME), RECORDINGS[0]
    described = {f"{NAME}__{key}": value for key, value in SLOPES.items()}
    parts, bare = model.term_forces(genome(model, **described), recording), model.term_forces(genome(model), recording)
    assert not np.any(parts.pop("effects"))
    for name, force in parts.items():
        factor = {"translation": expected(recording, "lift"), "clap_and_peel": expected(recording, "fling")}.get(name)
        np.testing.assert_allclose(force, (1.0 if factor is None else factor) * bare[name], atol=1e-14)
        assert np.any(force)
    np.testing.assert_allclose(np.sum(list(parts.values()), axis=0), beat(model, recording, **described), atol=1e-14)


def test_no_coefficient_falls_below_zero() -> None:
    model, recording = model_of("proposed"), RECORDINGS[7]  # 10.3 Hz
    slopes = dict.fromkeys(SLOPES, 0.0) | {"lift_by_frequency": 8.0, "fling_by_pitch": 2.0, "fling_by_frequency": 8.0}
    np.testing.assert_allclose(varied(model, recording, slopes), beat(model, recording, C_l=0.0, C_F=0.0), atol=1e-13)


def test_nothing_changes_at_the_reference() -> None:
    here = replace(TRIALS[0].condition, flap_frequency=REFERENCE_FREQUENCY, angle_of_attack=REFERENCE_PITCH)
    recording = blank_recording(here)
    model = model_of("proposed")
    np.testing.assert_allclose(varied(model, recording, SLOPES), beat(model, recording), atol=1e-15)


def test_a_batch_has_slopes_of_its_own() -> None:
    """Individuals with the same motion: remembered elements must not be those of a neighbour."""
    model, recording = model_of("proposed").with_effects(NAME), RECORDINGS[0]
    sizes = [{}, SLOPES, {key: -value for key, value in SLOPES.items()}]
    batch = [genome(model, **{f"{NAME}__{key}": value for key, value in one.items()}) for one in sizes]
    found = model.beat(batch, recording)
    for row, one in zip(batch, found, strict=True):
        assert np.array_equal(model.beat([row], recording)[0], one)
    assert np.array_equal(found[0], beat(model_of("proposed"), recording))
    np.testing.assert_allclose(found[1] + found[2], 2.0 * found[0], atol=1e-13)


def test_one_recording_hides_what_all_together_show() -> None:
    """Coefficients fitted to one take all of it; one set for all leaves nearly all of the 12 mN that it moves."""
    model, typical = model_of("proposed"), {p.name: p.typical for p in EFFECTS[NAME].size}
    own = {"C_l": 1.0, "C_r": 1.6, "C_F": 1.0}

    def columns(recording: Recording) -> Array:
        """What the coefficients do, [D, 3]: forces are linear in them."""
        bare = beat(model, recording, **own).ravel()
        more = [beat(model, recording, **own | {name: value + 1.0}).ravel() for name, value in own.items()]
        return np.stack(more, axis=1) - bare[:, None]

    def left(slopes: Array, moved: Array) -> float:
        rest = moved - slopes @ np.linalg.lstsq(slopes, moved, rcond=None)[0]
        return float(np.linalg.norm(rest) / np.linalg.norm(moved))

    slopes = [columns(recording) for recording in RECORDINGS]
    moved = [(varied(model, r, typical, **own) - beat(model, r, **own)).ravel() for r in RECORDINGS]
    assert max(left(one, change) for one, change in zip(slopes, moved, strict=True)) < 1e-9
    assert left(np.concatenate(slopes), np.concatenate(moved)) == pytest.approx(0.96, abs=0.02)
    assert np.sqrt(np.mean(np.concatenate(moved) ** 2)) == pytest.approx(12e-3, abs=1e-3)


def test_typical_sizes_are_those_of_table_8() -> None:
    """Least squares on the eight tests; of C_r it finds next to nothing to vary with, so that it is left constant."""
    here = [trial.condition for trial in TRIALS]
    variables = np.array(
        [[1.0, c.flap_frequency / REFERENCE_FREQUENCY - 1.0, c.angle_of_attack - REFERENCE_PITCH] for c in here]
    )

    def fitted(name: str) -> tuple[Array, float]:
        """Both relative slopes, and the part of the variance that is left."""
        values = np.array([trial.coefficients[name] for trial in TRIALS])
        found = np.linalg.lstsq(variables, values, rcond=None)[0]
        return found[1:] / found[0], float(np.var(values - variables @ found) / np.var(values))

    typical = [p.typical for p in EFFECTS[NAME].size]
    (lift, lift_left), (fling, fling_left), (_, rotation_left) = (fitted(name) for name in ("C_l", "C_F", "C_r"))
    np.testing.assert_allclose([*lift, *fling], typical, atol=0.05)
    assert lift_left < 0.03
    assert fling_left < 0.25
    assert rotation_left > 0.7


def test_is_declared_as_what_it_is() -> None:
    effect = EFFECTS[NAME]
    assert effect.rigs == ("vehicle",)
    assert (effect.family, effect.port, effect.power, effect.memory) == ("aerodynamics", "air", "any", "")
    assert not effect.shape
