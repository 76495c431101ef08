from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from tests.sim.kernels.marching import driven
from wingfit.records import FourierDrive, Recording
from wingfit.sim.kernels.arrays import AREA
from wingfit.sim.solver import simulate
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.virtual_rigs.campaign import (
    Tracking,
    blank_recording,
    record,
    robird_wing,
    true_genome,
    tunnel,
    vacuum,
)
from wingfit.sim.wing import flexible_wing
from wingfit.sim.wing.alignment import recorded_crossing, upstroke_crossing
from wingfit.sim.wing.beat_series import MAX_SHIFT, aligned_values
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.genes import AERODYNAMIC, STRUCTURAL

QUICK = Numerics(steps=80, periodic=1e-4)
CONDITION = tunnel(0.05, 3.0, 6.0)


@pytest.fixture(scope="module")
def model() -> FlexibleWing:
    return FlexibleWing(robird_wing(), "4", numerics=QUICK)


@pytest.fixture(scope="module")
def recording(model: FlexibleWing) -> Recording:
    return record(model, true_genome(model, 3), CONDITION, Tracking(), np.random.default_rng(3))


def random_genomes(model: FlexibleWing, count: int) -> np.ndarray:
    rng = np.random.default_rng(5)
    return np.array([[gene.from_unit(rng.uniform(0.2, 0.8)) for gene in model.genes] for _ in range(count)], float)


def test_genes_are_those_of_the_thesis(model: FlexibleWing) -> None:
    assert STRUCTURAL == ("E_f", "E_r", "G_f", "G_r", "D_E", "D_G")
    assert [g.name for g in model.genes] == [*STRUCTURAL, *AERODYNAMIC]
    assert len(AERODYNAMIC) == 12
    for gene in model.genes:
        assert gene.lower == pytest.approx(gene.nominal / 5)
        assert gene.upper == pytest.approx(gene.nominal * 5)


def test_same_bits_for_any_batch_lane_and_neighbour(model: FlexibleWing, recording: Recording) -> None:
    genomes = random_genomes(model, 11)
    whole = model.observe(genomes, recording).channels
    alone = np.concatenate([model.observe(g[None], recording).channels for g in genomes])
    turned = model.observe(genomes[::-1], recording).channels[::-1]
    assert whole.tobytes() == alone.tobytes()
    assert whole.tobytes() == np.ascontiguousarray(turned).tobytes()


def test_a_diverging_individual_is_reported_and_does_not_affect_others(
    model: FlexibleWing, recording: Recording
) -> None:
    genomes = random_genomes(model, 3)
    clean = model.observe(genomes, recording)
    wild = genomes.copy()
    column = [g.name for g in model.genes].index("L_a")
    wild[1, column] = 1e6
    mixed = model.observe(wild, recording)
    assert mixed.reasons[1] is not None
    assert "diverged" in mixed.reasons[1] or "not periodic" in mixed.reasons[1]
    assert np.isnan(mixed.channels[1]).all()
    for k in (0, 2):
        assert mixed.reasons[k] is None
        assert mixed.channels[k].tobytes() == clean.channels[k].tobytes()


def test_survives_pickling(model: FlexibleWing, recording: Recording) -> None:
    genomes = random_genomes(model, 1)
    copy = pickle.loads(pickle.dumps(model))  # noqa: S301
    assert copy.observe(genomes, recording).channels.tobytes() == model.observe(genomes, recording).channels.tobytes()


def test_recordings_of_the_true_wing_differ_by_their_noise_only(model: FlexibleWing, recording: Recording) -> None:
    """Aligned by the crossing, the true genome's tracks differ from the recorded ones by the tracking noise."""
    truth = true_genome(model, 3)
    difference = model.observe([truth.values], recording).channels[0] - recording.values
    scatter = np.nanstd(difference.reshape(len(recording.times), -1, 3), axis=(0, 1))
    np.testing.assert_allclose(scatter, Tracking().noise, rtol=0.15)


@pytest.mark.parametrize("shift", [0.0, 0.123, 0.789])
def test_alignment_does_not_depend_on_the_trigger(model: FlexibleWing, recording: Recording, shift: float) -> None:
    """Shifting all times by any fraction of a beat shifts the crossing and leaves the aligned tracks as they are."""
    later = replace(recording, times=recording.times + shift / CONDITION.flap_frequency)
    turn = recorded_crossing(model.wing, later) - recorded_crossing(model.wing, recording)
    assert np.angle(np.exp(1j * (turn - 2 * np.pi * shift))) == pytest.approx(0, abs=1e-9)
    genomes = random_genomes(model, 1)
    a, b = (model.observe(genomes, r).channels for r in (recording, later))
    np.testing.assert_allclose(a, b, atol=1e-9)


def test_crossing_of_a_known_wave() -> None:
    """sin(psi - 0.7) rises through zero at 0.7; offset 0.2 rises through 0.2 at 0.7 + 0; falling ones do not count."""
    series = np.array([[0.2, np.exp(-1j * (0.7 + np.pi / 2))]])
    assert upstroke_crossing(series, 0.2)[0] == pytest.approx(0.7, abs=1e-12)
    assert np.isnan(upstroke_crossing(np.array([[2.0, 1.0 + 0j]]), 0.0)[0])


def test_shares_sum_to_one_for_every_genome() -> None:
    from wingfit.sim.wing.genes import lanes

    for division in ("4", "11", "24", "3x5"):
        model = FlexibleWing(robird_wing(), division)
        group = lanes(model.structure, model.genes, random_genomes(model, 8))
        starts = model.structure.wiring.strip_start[:-1]
        for share in (group.lift_share, group.drag_share):
            np.testing.assert_allclose(np.add.reduceat(share, starts), 1, rtol=1e-12)


def test_scaling_all_weights_of_a_share_group_changes_nothing(model: FlexibleWing, recording: Recording) -> None:
    genomes = random_genomes(model, 1)
    scaled = genomes.copy()
    columns = [k for k, g in enumerate(model.genes) if g.share_of == "L"]
    scaled[:, columns] *= 2.0
    a, b = model.observe(genomes, recording).channels, model.observe(scaled, recording).channels
    np.testing.assert_allclose(a, b, atol=1e-9)


def test_air_density_matters_and_vacuum_is_not_empty(model: FlexibleWing) -> None:
    """At 10 mbar one per cent of the air is left: the tip differs from no air at all, but far less than at 1000."""
    nominal = [g.nominal for g in model.genes]
    tracks = [
        model.beat(nominal, blank_recording(model.wing, vacuum(p, 0.05, 3.0))).tracks for p in (1e-9, 10.0, 1000.0)
    ]
    low, high = (np.abs(t - tracks[0]).max() for t in tracks[1:])
    assert 1e-5 < low < 0.05 * high


def test_air_takes_energy_from_a_wing_flapping_in_still_air(model: FlexibleWing) -> None:
    """Power test: with no wind the air can only be paid, however the shares and slopes are set (no camber lift)."""
    genomes = random_genomes(model, 4)
    fine = replace(model, numerics=Numerics(steps=320))
    beats = fine.beats(genomes, blank_recording(model.wing, vacuum(1000.0, 0.05, 3.0)))
    power = np.array([beat.power for beat in beats])
    assert np.all(power[:, :, 3].mean(axis=1) < 0)
    assert np.all(power[:, :, 0] <= 0)
    np.testing.assert_allclose(power.sum(axis=2).mean(axis=1), 0, atol=1e-4 * np.abs(power).mean(axis=1).max())


def test_lift_points_up_when_the_stream_comes_from_below(model: FlexibleWing) -> None:
    """Sign test on a wing held still in the stream: lift up, drag aft."""
    still = replace(model, wing=replace(model.wing, drive=FourierDrive(0.0, (0.0,), (0.0,))))
    beat = still.beat([g.nominal for g in model.genes], blank_recording(model.wing, CONDITION))
    air = beat.air[-1]
    assert air[2] > 0
    assert air[0] > 0
    area = still.structure.wiring.geometry[:, AREA].sum()
    rho, v, alpha = 1.204, 6.0, np.radians(4.0)
    expected = 0.5 * rho * v**2 * area * (4.0 * alpha + 0.3)
    assert air[2] == pytest.approx(expected, rel=0.1), "affine law on the undeformed wing, up to its small deflection"


def test_rear_rod_lags(model: FlexibleWing) -> None:
    table = driven(model.structure, tunnel(0.1, 3.0, 6.0), 80, 2)[80:]
    front, rear = table[:, 0, 0, 0, 0], table[:, 0, 1, 0, 0]
    cross = [np.dot(front, np.roll(rear, -k)) for k in range(-5, 6)]
    assert int(np.argmax(cross)) - 5 == round(0.1 / (2 * np.pi) * len(table))


@pytest.mark.parametrize("text", ["", "0", "5", "a", "3,x", "1x99", "-2x3", "4x", "2;3"])
def test_bad_division_names_the_presets(text: str) -> None:
    with pytest.raises(ValueError, match="preset"):
        FlexibleWing(robird_wing(), text).structure  # noqa: B018


def test_unknown_estimate_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown gene 'E_x'"):
        FlexibleWing(replace(robird_wing(), estimates={"E_x": 1.0})).genes  # noqa: B018


def test_recording_without_reference_markers_says_so(model: FlexibleWing, recording: Recording) -> None:
    keep = [k for k, m in enumerate(recording.markers) if m not in model.wing.reference_markers]
    cut = replace(
        recording,
        markers=tuple(recording.markers[k] for k in keep),
        values=recording.positions[:, keep].reshape(len(recording.times), -1),
    )
    with pytest.raises(ValueError, match="reference"):
        recorded_crossing(model.wing, cut)


def of_effects(model: FlexibleWing, rows: list[dict[str, float]]) -> np.ndarray:
    """Genomes: nominal but for what each row names."""
    return np.array([[row.get(gene.name, gene.nominal) for gene in model.genes] for row in rows])


def test_each_distinct_wing_is_simulated_once(
    model: FlexibleWing, recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Faults of the cameras, and places of a mass that is not there, make no other wing; the mass itself does."""
    loaded = model.with_effects("lumped_mass", "camera_shift", "strobe_rate")
    rows = [
        {},
        {"camera_shift.x": 0.004},
        {"lumped_mass.station": 0.3},
        {"lumped_mass.mass": 0.004},
        {"lumped_mass.mass": 0.004, "lumped_mass.station": 0.3},
        {"strobe_rate.part": 1e-4, "lumped_mass.mass": 0.004},
        {"E_f": model.genes[0].nominal * 1.1},
        {"camera_shift.x": 0.004},
    ]
    genomes, simulated = of_effects(loaded, rows), []
    original = simulate.periodic_beats

    def counted(subject: object, batch: np.ndarray, *args: object, **options: object) -> object:
        simulated.append(len(batch))
        return original(subject, batch, *args, **options)  # type: ignore[arg-type]

    monkeypatch.setattr(flexible_wing, "periodic_beats", counted)
    beats = loaded.beats(genomes, recording)
    assert sum(simulated) == 4
    groups = [next(i for i, other in enumerate(beats) if other is beat) for beat in beats]
    assert groups == [0, 0, 0, 3, 4, 3, 6, 0]
    together = loaded.observe(genomes, recording)
    assert sum(simulated) == 2 * 4
    for k, genome in enumerate(genomes):
        alone = loaded.observe(genome[None], recording)
        assert alone.channels[0].tobytes() == together.channels[k].tobytes()
        assert alone.solutions[0] == together.solutions[k]
    same = [together.channels[k].tobytes() for k in (0, 1, 2, 3, 5, 7)]
    assert same[0] == same[2]
    assert same[1] == same[5]
    assert len(set(same)) == 4


def test_the_common_phase_is_the_one_that_fits_best() -> None:
    """Against a search by trial: the misfit over what was recorded, gaps left out, is least where the tracks are."""
    rng = np.random.default_rng(4)
    k = np.arange(31)
    drawn = rng.standard_normal((31, 6)) + 1j * rng.standard_normal((31, 6))
    series = np.asarray(drawn * (0.1 / (1 + k[:, None]) ** 3), np.complex128)
    phases = np.sort(rng.uniform(0, 8 * np.pi, 90))

    def wave(psi: np.ndarray) -> np.ndarray:
        return np.asarray((np.exp(1j * k * psi[:, None]) @ series).real)

    recorded = wave(phases + 0.02) + 1e-3 * rng.standard_normal((90, 6))
    recorded[rng.uniform(size=recorded.shape) < 0.2] = np.nan
    found = aligned_values(series[None], phases[None] - 0.7, np.array([0.7]), recorded, {})[0]
    best = minimize_scalar(
        lambda shift: np.nansum((wave(phases + shift) - recorded) ** 2), bounds=(-0.05, 0.05), options={"xatol": 1e-12}
    )
    np.testing.assert_allclose(found, wave(phases + best.x), atol=2e-7)
    far = aligned_values(series[None], phases[None] - 0.5, np.array([0.0]), recorded, {})[0]
    np.testing.assert_allclose(far, wave(phases - 0.5 + 2 * MAX_SHIFT), atol=1e-12)


def test_a_recording_without_data_begins_at_the_crossing(model: FlexibleWing) -> None:
    empty = blank_recording(model.wing, CONDITION, frames=60)
    tracks = model.observe(random_genomes(model, 2), empty).channels.reshape(2, 60, -1, 3)
    columns = [empty.markers.index(name) for name in model.wing.reference_markers]
    height = tracks[:, :, columns, 2].mean(axis=2)
    series = np.fft.rfft(height, axis=1)[:, :5] / 60
    series[:, 1:] *= 2
    np.testing.assert_allclose(upstroke_crossing(series, model.wing.hinge.z), 0.0, atol=1e-9)
