from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from tests.sim.effects.bench import AIR, scene_of
from wingfit.records import Genome, Recording
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import blank_recording, robird_wing
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.loads import crossing
from wingfit.sim.wing.structure import build

Array = npt.NDArray[np.float64]
PART = -0.4
STIFFNESSES = ("E_f", "G_f", "E_r", "G_r")
MODEL = FlexibleWing(robird_wing(), "4", numerics=Numerics(steps=200), effects=("stiffness_drift",))
_BLANK = blank_recording(MODEL.wing, AIR, frames=61)
RECORDING = replace(_BLANK, times=5 * _BLANK.times)  # of five beats


def genome(part: float = 0.0, factor: float = 1.0) -> Array:
    """Nominal genome; the moduli of foam and rods multiplied by ``factor``."""
    values = Genome.nominal(MODEL.genes).as_dict()
    scaled = {name: factor * values[name] for name in STIFFNESSES}
    return np.array([*(values | scaled | {"stiffness_drift.part": part}).values()])


def observed(part: float = 0.0, recording: Recording = RECORDING) -> Array:
    found = MODEL.observe(genome(part)[None], recording)
    assert found.reasons == (None,)
    return np.asarray(found.channels[0])


def at_frames(factor: float) -> Array:
    """Tracks [T, C] of a wing of other moduli, at the frames' phases of the nominal drive."""
    tracks = MODEL.beat(genome(factor=factor), RECORDING).tracks
    start = crossing(MODEL, RECORDING, MODEL.beat(genome(), RECORDING).tracks)
    n = len(tracks)
    spectrum = np.fft.rfft(tracks.reshape(n, -1), axis=0)[:31] / n
    spectrum[1:] *= 2
    psi = 2 * np.pi * (start + AIR.flap_frequency * RECORDING.times)
    return np.asarray((np.exp(1j * np.arange(31) * psi[:, None]) @ spectrum).real)


def test_the_stiffness_of_every_connector_changes_alike() -> None:
    structure = build(robird_wing(), Division.parse("4"))
    plain, soft = (scene_of("stiffness_drift", structure, part=part) for part in (0.0, -0.3))
    np.testing.assert_allclose(soft.lanes.stiffness, 0.7 * plain.lanes.stiffness, rtol=1e-15)
    np.testing.assert_array_equal(soft.lanes.damping, plain.lanes.damping)


def test_a_recording_begins_as_a_stiffer_wing_and_ends_as_a_softer_one() -> None:
    """First and last frame are those of wings whose moduli are multiplied by 1 -+ part / 2; the middle is nominal."""
    found = observed(PART)
    size = np.abs(at_frames(1 - PART / 2) - at_frames(1 + PART / 2)).max()
    assert size > 1e-3
    for frame, factor in ((0, 1 - PART / 2), (30, 1.0), (60, 1 + PART / 2)):
        np.testing.assert_allclose(found[frame], at_frames(factor)[frame], atol=2e-3 * size)


@pytest.mark.parametrize("frame", [15, 45])
def test_in_between_the_error_of_the_parabola_is_of_third_order(frame: int) -> None:
    """Against a wing of the stiffness at that time; of a drift by 20 %, 1 % of the largest change is left."""
    size = np.abs(at_frames(1 - PART / 4) - at_frames(1 + PART / 4)).max()
    large, small = (
        np.abs(observed(part)[frame] - at_frames(1 + part * (frame / 60 - 0.5))[frame]).max()
        for part in (PART, PART / 2)
    )
    assert small < 0.01 * size
    assert small < large / 4


def test_the_opposite_drift_is_the_recording_backwards_in_stiffness() -> None:
    """With its end as stiff as the other began: the changes are opposite in first order."""
    plain, fall, rise = observed(), observed(-0.05), observed(0.05)
    np.testing.assert_allclose(fall - plain, plain - rise, atol=0.1 * np.abs(fall - plain).max())


def test_a_single_frame_is_in_the_middle() -> None:
    one = replace(RECORDING, times=RECORDING.times[:1], values=RECORDING.values[:1])
    np.testing.assert_array_equal(observed(PART, one), observed(0.0, one))


def test_loads_are_those_of_the_middle() -> None:
    drifting, plain = (MODEL.beat(genome(part), RECORDING, with_motion=True) for part in (PART, 0.0))
    np.testing.assert_array_equal(drifting.tracks, plain.tracks)
    soft, nominal = (MODEL.scene(genome(part), AIR).lanes.stiffness for part in (PART, 0.0))
    np.testing.assert_array_equal(soft, nominal)


def test_an_end_that_cannot_be_simulated_fails_with_its_reason() -> None:
    """A wing that is nearly without stiffness at the end; its neighbour in the batch is as it was."""
    weak = FlexibleWing(
        robird_wing(), "4", numerics=Numerics(steps=200, max_beats=6), effects=("stiffness_drift", "tether")
    )
    names = [gene.name for gene in weak.genes]
    batch = np.tile(Genome.nominal(weak.genes).values, (2, 1))
    batch[0, names.index("stiffness_drift.part")] = 1.9
    found = weak.observe(batch, RECORDING)
    assert found.reasons[0]
    assert np.isnan(found.channels[0]).all()
    assert found.channels[1].tobytes() == weak.observe(batch[1:], RECORDING).channels[0].tobytes()


def test_an_effect_of_vehicles_cannot_change_during_a_recording() -> None:
    known = EFFECTS["mass_offset"]
    with pytest.raises(ValueError, match="leave out `during`"):
        replace(known, during=True)
    assert isinstance(known, Effect)
