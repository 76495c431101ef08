"""Recordings of the independent plants as a laboratory has them before any alignment, with the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from benchmarks.concealed.plant.continuum.simulate import simulate as simulate_rod
from benchmarks.concealed.plant.measurement.film import draw_filming, film, with_noise
from benchmarks.concealed.plant.wing.simulate import simulate as simulate_bodies
from benchmarks.concealed.rigs import WINGS, as_described, size_of
from wingfit.calibration.spec import CalibrationSpec, wing_model
from wingfit.records import Condition, Dataset, FourBarDrive, Wing

Array = npt.NDArray[np.float64]
Plant = Literal["bodies", "rod"]
Body = Literal["rests", "drifts", "flies"]
BODIES: tuple[Body, ...] = get_args(Body)

_DIVISION = "11"
_LOST_OF = 49  # markers for which the number of lost ones is drawn
_BODY_POINTS = np.array([[-0.1, -0.08, 0.02], [0.1, -0.1, 0.03], [0.0, -0.16, -0.04], [0.05, -0.12, 0.08]])  # spans


@dataclass(frozen=True, eq=False)
class Trial:
    """One recording in camera axes, with the truth.

    Attributes:
        label: rig, plant and what is special.
        wing, described: the wing as it is and as it is described.
        times, names, tracks: [T], [K], [T, K, 3] as the cameras have them.
        clean: [T, M, 3] what the cameras saw of each described marker before labels were mixed up; NaN: not seen.
        turn, hinge: true camera-to-wing axes [3, 3] and camera position of the hinge [3].
        left: whether it is a left wing.
        body: names of the tracks on the body.
        noise: RMS noise, m.
        seen: [T, M, 3] measured positions in the true wing frame, m.
    """

    label: str
    wing: Wing
    described: Wing
    times: Array
    names: tuple[str, ...]
    tracks: Array
    clean: Array
    turn: Array
    hinge: Array
    left: bool
    body: tuple[str, ...]
    noise: float
    seen: Array

    def true_positions(self) -> Array:
        """Return the measured positions [T, M, 3] in the true wing frame, m."""
        return self.seen


@lru_cache(maxsize=64)
def _beat(rig: str, plant: Plant, frequency: float, speed: float, stroke: float) -> tuple[Wing, Array]:
    """Return the wing with its stroke multiplied by ``stroke``, and the tracks [n, M, 3] of one beat, m."""
    wing = with_stroke(WINGS[rig][0], stroke)
    model = wing_model(Dataset("nominal", wing, ()), CalibrationSpec(division="4"))
    genome = {gene.name: gene.nominal for gene in model.genes}
    pitched = np.radians(4.0) if speed else 0.0
    condition = Condition(frequency, np.radians(7.0), 101325.0 if speed else 1000.0, 293.0, speed, float(pitched))
    if plant == "rod":
        return wing, simulate_rod(wing, genome, condition).tracks
    return wing, simulate_bodies(wing, _DIVISION, genome, condition).tracks


def with_stroke(wing: Wing, factor: float) -> Wing:
    """Return ``wing`` with a drive whose amplitude is about ``factor`` times as large."""
    drive = wing.drive
    if isinstance(drive, FourBarDrive):
        return replace(wing, drive=replace(drive, crank=factor * drive.crank))
    cosine, sine = (tuple(factor * value for value in part) for part in (drive.cosine, drive.sine))
    return replace(wing, drive=replace(drive, cosine=cosine, sine=sine))


def make(seed: int, motion: Body | None = None) -> Trial:
    """Return the trial of a ``seed``, the same for the same seed, with this ``motion`` of the body or a drawn one."""
    rng = np.random.default_rng([seed, 25])
    rig = ("robird", "bird", "insect")[seed % 3]
    plant: Plant = ("bodies", "rod")[seed // 3 % 2]
    grid, windy = WINGS[rig][1], seed // 6 % 2 == 1
    frequency = float(rng.choice(grid.frequencies[:4]))
    speed = float(rng.choice(grid.speeds[:4])) if windy else 0.0
    wing, beat = _beat(rig, plant, frequency, speed, float(rng.choice([0.7, 0.85, 1.0])))
    filming = draw_filming(rng)
    filming = with_noise(filming, size_of(wing) * filming.noise.level)
    filming = replace(filming, lost=filming.lost * len(wing.markers) // _LOST_OF)
    recording = film(beat, wing, Condition(frequency, 0.0, 1e5, 293.0, speed), filming, rng).recording
    seen = recording.values.reshape(len(recording.times), -1, 3)
    left = bool(rng.integers(2))
    drawn: Body = ("rests", "rests", "drifts", "flies")[int(rng.integers(4))]
    body = motion or drawn
    return _mixed(
        f"{rig} {plant}", wing, recording.times, recording.markers, seen, left, body, filming.noise.level, rng
    )


def _mixed(
    label: str,
    wing: Wing,
    times: Array,
    markers: tuple[str, ...],
    seen: Array,
    left: bool,
    body: Body,
    noise: float,
    rng: np.random.Generator,
) -> Trial:
    """Put the recording [T, M', 3] into camera axes, move the body, and mix up the labels."""
    mirror = np.diag([1.0, -1.0 if left else 1.0, 1.0])
    axes = Rotation.random(random_state=int(rng.integers(2**31))).as_matrix()
    place = rng.normal(size=3)
    origin = np.array([0.0, wing.hinge.y, wing.hinge.z])
    points = _BODY_POINTS * wing.span + noise * rng.standard_normal((len(times), len(_BODY_POINTS), 3))
    R, p = _motion(body, times, wing.span, rng)

    def filmed(positions: Array) -> Array:
        on_body = positions @ mirror.T
        return np.asarray((np.einsum("tij,tkj->tki", R, on_body) + p[:, None]) @ axes.T + place)

    right = filmed(seen)
    clean = np.full((len(times), len(wing.markers), 3), np.nan)
    order = [one.name for one in wing.markers]
    clean[:, [order.index(name) for name in markers]] = right
    true = np.full_like(clean, np.nan)
    true[:, [order.index(name) for name in markers]] = seen
    tracks, swaps = right.copy(), int(rng.integers(4))
    for _ in range(swaps):
        a, b = rng.choice(len(markers), 2, replace=False)
        first = int(rng.integers(len(times)))
        part = slice(first, first + int(rng.integers(3, max(4, len(times) // 2))))
        tracks[part, [a, b]] = tracks[part, [b, a]]
    spurious = int(rng.integers(4))
    middle, still = np.nanmean(right, axis=(0, 1)), rng.normal(size=(spurious, 3)) * 0.25 * wing.span
    wander = np.cumsum(rng.normal(size=(len(times), spurious, 3)), axis=0) * 2e-3 * wing.span
    extra = middle + still + wander * rng.integers(2, size=(spurious, 1))
    shown = [tracks, extra] + ([filmed(points)] if body == "flies" else [])
    every = np.concatenate(shown, axis=1)
    named = bool(rng.integers(2))
    names = (
        [*markers, *(f"extra{k}" for k in range(spurious))] if named else [f"t{k:02d}" for k in range(every.shape[1])]
    )
    names = names[: len(markers) + spurious]
    held = [f"body{k}" for k in range(len(_BODY_POINTS))] if body == "flies" else []
    if not named:
        shuffled = rng.permutation(len(names))
        every = np.concatenate([every[:, : len(names)][:, shuffled], every[:, len(names) :]], axis=1)
    what = f"{label} {'left' if left else 'right'} {body} {'named' if named else 'unlabelled'} {swaps} swaps"
    described = as_described(wing, rng)
    turn, hinge = mirror @ axes.T, axes @ mirror @ origin + place
    return Trial(
        what, wing, described, times, (*names, *held), every, clean, turn, hinge, left, tuple(held), noise, true
    )


def _motion(body: Body, times: Array, span: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Rotation [T, 3, 3] and shift [T, 3] (m) of the body, whose means are none."""
    T = len(times)
    if body == "rests":
        return np.tile(np.eye(3), (T, 1, 1)), np.zeros((T, 3))
    s = np.linspace(-1.0, 1.0, T)
    way = 0.3 if body == "drifts" else 2.0
    powers = np.stack([s, s**2 - 1 / 3], axis=-1)
    shift = powers @ rng.normal(size=(2, 3)) * way * span / 2
    turning = powers @ rng.normal(size=(2, 3)) * np.radians(4.0 if body == "drifts" else 10.0)
    if body == "flies":
        heave = np.sin(2 * np.pi * np.arange(T) / 9.0)[:, None]
        shift, turning = shift + 0.02 * span * heave, turning + np.radians(1.5) * heave
    return Rotation.from_rotvec(turning).as_matrix(), shift
