"""A flapping vehicle as a model: genomes in, forces of its wings out, sampled and filtered like a recording.

Quasi-steady blade elements with clap-and-peel (Armanini et al. 2016). Forces are sums of terms, each a coefficient
times what depends on the motion alone; so a search over coefficients computes the elements once.
"""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from records import Condition, EstimateError, Gene, Recording, Vehicle, WingMotion
from sim.atmosphere import density
from sim.blades.elements import (
    COSINE,
    CURVE_ROWS,
    DIHEDRAL,
    DIHEDRAL_RATE,
    FLAP_ACCELERATION,
    FLAP_RATE,
    PEELED,
    PITCH_ACCELERATION,
    PITCH_RATE,
    PROJECTION,
    ROWS,
    SINE,
    STEP_COSINE,
    STEP_SINE,
    Constants,
    Side,
    synthesise,
    wing_forces,
)
from sim.blades.motion import Angles, angles, motion_genes
from sim.blades.terms import SEARCHED, TERMS, chosen
from sim.filtering import gain, sampling_rate
from sim.kernels import LANES
from sim.model import Observation, genome_batch

Array = npt.NDArray[np.float64]

ADDED_MASS_POINT = 0.5  # d, chords: where the added mass's acceleration is taken (Armanini et al. 2016, below Eq. 19)
ROTATION_POINT = 0.75  # Eq. 4
_KEPT = 64  # motions whose elements are remembered, per recording
_NEGLIGIBLE = 1e-9  # of the largest: harmonics below are left out


@dataclass(frozen=True)
class BladeElementWing:
    """Vehicle whose wings move as prescribed, for forces on a balance or in flight.

    ``terms`` are names of :data:`sim.blades.terms.TERMS`. A beat is computed at ``instants`` equal steps with
    ``elements`` along each wing. ``peel_width`` in beats smooths the end of the peel (0: it switches, as printed).
    """

    vehicle: Vehicle
    terms: tuple[str, ...] = chosen("proposed")
    elements: int = 40
    instants: int = 400
    peel_width: float = 0.0

    def __post_init__(self) -> None:
        for name in self.terms:
            if name not in TERMS:
                raise ValueError(f"unknown term {name!r}; there are {', '.join(TERMS)}")
        if self.elements < 1 or self.instants < LANES or self.instants % LANES:
            raise ValueError(
                f"{self.elements} elements and {self.instants} instants; there must be at least one element, and a "
                f"positive multiple of {LANES} instants"
            )
        if not 0 <= self.peel_width <= 0.5:
            raise ValueError(f"peel_width is {self.peel_width:g} beats; it must lie in [0, 0.5]")

    def __getstate__(self) -> dict[str, object]:
        """Pickle the definition only; whatever was computed from it is computed again."""
        return {name: self.__dict__[name] for name in ("vehicle", "terms", "elements", "instants", "peel_width")}

    @cached_property
    def genes(self) -> tuple[Gene, ...]:
        """Coefficients of the terms, then parameters of the wings' motion; EstimateError for an estimate of no use."""
        coefficients = [gene for name in TERMS for gene in TERMS[name].genes if name in self.terms]
        if not self.vehicle.claps:
            coefficients = [gene for gene in coefficients if gene.name != "C_F"]
        genes = (*coefficients, *motion_genes(self.vehicle.motion))
        _check_estimates(self.vehicle, genes)
        return tuple(replace(gene, nominal=self.vehicle.estimates.get(gene.name, gene.nominal)) for gene in genes)

    @cached_property
    def searched(self) -> tuple[str, ...]:
        """What the seed estimates: lift, rotational and fling coefficients. Drag and motion are fixed beforehand."""
        return tuple(gene.name for gene in self.genes if gene.name in SEARCHED)

    def beat(self, genomes: npt.ArrayLike, recording: Recording) -> Array:
        """Forces [B, n, 2] along body x and z (N) over one beat from t* = 0, unfiltered, of ``genomes`` [B, G]."""
        batch = genome_batch(self.genes, genomes)
        weights, out = self._weights(batch), np.empty((len(batch), 2, self.instants))
        for start in range(0, len(batch), LANES):  # blocks that stay in the cache
            for k, rows in enumerate(self._remembered(batch[start : start + LANES], recording), start):
                out[k] = _sum(weights[k], rows)
        return out.transpose(0, 2, 1)

    def term_forces(self, genome: npt.ArrayLike, recording: Recording) -> dict[str, Array]:
        """Forces [n, 2] of each term (N); together they are :meth:`beat`."""
        batch = genome_batch(self.genes, np.asarray(genome, float)[None])
        rows, weights = self._rows(batch, recording)[0], self._weights(batch)[0]
        parts: dict[str, Array] = {}
        for name, weight, row in zip(self._active, weights, rows, strict=True):
            parts[_ROWS[name]] = parts.get(_ROWS[name], 0.0) + weight * row.T
        return parts

    def observe(self, genomes: npt.ArrayLike, recording: Recording) -> Observation:
        """Forces [B, T, C] of ``genomes`` [B, G] at the recording's instants and along its axes, low-passed like it."""
        if recording.kind != "forces":
            raise ValueError(f"recording {recording.name!r} holds tracks; a vehicle is compared with forces")
        batch = genome_batch(self.genes, genomes)
        basis, wanted = self._basis(recording)
        axes = ["xz".index(axis) for axis in recording.forces]
        series = self._series(self.beat(batch, recording)[:, :, axes].transpose(0, 2, 1), recording)
        channels = np.empty((len(batch), len(recording.times), len(axes)))
        synthesise(basis, np.ascontiguousarray(series[:, :, wanted]), channels)
        good = [bool(np.isfinite(forces).all()) for forces in channels]
        return Observation(channels, tuple(None if fine else "the forces are not finite" for fine in good))

    # -- rows: forces of each term for a coefficient of one ----------------------------------------------------

    def _weights(self, batch: Array) -> Array:
        """[B, rows]: what each row is multiplied by."""
        column = {gene.name: k for k, gene in enumerate(self.genes)}

        def value(name: str) -> Array:
            return batch[:, column[name]] if name in column else np.zeros(len(batch))

        one = np.ones(len(batch))
        lever = ROTATION_POINT - self.vehicle.pitch_axis
        scale = {
            "inertial": one,
            "translation": value("C_l"),
            "rotation": value("C_r") * lever,
            "clap_and_peel": -value("C_F"),  # theta_fling' = -theta_w'
            "added_mass": one,
            "viscous_0": value("C_D0"),
            "viscous_90": value("C_Dpi2"),
            "wing_acceleration": one,
            "lift_curve": value("K_l"),
            "drag_curve": value("K_d"),
        }
        return np.stack([scale[row] for row in self._active], axis=1)

    @cached_property
    def _active(self) -> tuple[str, ...]:
        """Rows of the terms that are on."""
        return tuple(row for row, term in _ROWS.items() if term in self.terms)

    @cached_property
    def _memory(self) -> WeakKeyDictionary[Recording, OrderedDict[bytes, Array]]:
        return WeakKeyDictionary()

    def _moving(self, batch: Array) -> dict[str, Array]:
        """Genes [B] of the wings' motion, in the order of the model."""
        names = {gene.name for gene in motion_genes(self.vehicle.motion)}
        return {gene.name: batch[:, k] for k, gene in enumerate(self.genes) if gene.name in names}

    def _remembered(self, batch: Array, recording: Recording) -> list[Array]:
        """Forces of each active row [rows, 2, n] of every individual; those of the last few motions are remembered."""
        kept = self._memory.setdefault(recording, OrderedDict())
        motions = np.stack(list(self._moving(batch).values()) or [np.zeros(len(batch))], axis=1)
        keys = [motion.tobytes() for motion in motions]
        new = {key: row for row, key in enumerate(keys) if key not in kept}
        found = dict(zip(new, self._rows(batch[list(new.values())], recording), strict=True)) if new else {}
        answer = [found[key] if key in found else kept[key] for key in keys]
        kept.update(found)
        while len(kept) > _KEPT:
            kept.popitem(last=False)
        return answer

    def _series(self, forces: Array, recording: Recording) -> Array:
        """Series [..., 2 K + 1] of periodic ``forces`` [..., n], filtered like the recording.

        Mean, then cosine and sine coefficients of each harmonic.
        """
        spectrum = np.fft.rfft(forces)[..., : self._harmonics + 1] / self.instants
        if recording.low_pass:
            frequency = np.arange(self._harmonics + 1) * recording.condition.flap_frequency
            spectrum = spectrum * gain(recording.low_pass, sampling_rate(recording), frequency)
        spectrum[..., 1:] *= 2
        return np.concatenate([spectrum.real, -spectrum.imag[..., 1:]], axis=-1)

    def _rows(self, batch: Array, recording: Recording) -> Array:
        """Forces of each active row [B, rows, 2, n] of all wings, for the motions that ``batch`` [B, G] prescribes."""
        motion, moving = (recording.motion, {}) if recording.motion else (self.vehicle.motion, self._moving(batch))
        found = self._wings(moving, motion, recording.condition)
        return np.repeat(found, len(batch), axis=0) if len(found) < len(batch) else found

    def _wings(self, moving: dict[str, Array], motion: WingMotion, condition: Condition) -> Array:
        """The same; one individual only where nothing is ``moving``."""
        vehicle, n = self.vehicle, self.instants
        prescribed = angles(motion, moving, condition.flap_frequency, n, vehicle.claps, self.peel_width)
        if "effective_chord" not in self.terms:
            prescribed = replace(prescribed, peeled=np.ones(n))
        r, chord, mass, width = self._span
        first, step = np.array([r[0], width]) / (motion.pitch_station * vehicle.span)
        rho = density(condition.pressure, condition.temperature)
        constants = Constants(rho, vehicle.thickness, width, first, step, ADDED_MASS_POINT)
        curves = len(CURVE_ROWS) if "steady_curves" in self.terms else 0
        found = np.zeros((len(prescribed.flap), len(ROWS) + curves, 2, n // LANES, LANES))
        rows = _motion_rows(prescribed, motion.root_pitch, first)
        zeta = prescribed.flap[:, 0]
        flap = (np.cos(zeta), np.sin(zeta), prescribed.flap[:, 1])
        for upper in (False, True) if vehicle.layout == "x4" else (False,):
            side = _set_side(rows, vehicle, flap, condition, upper)
            wing_forces(rows, side, r, chord, mass, constants, found)
        each = found.reshape(len(found), -1, 2, n)
        if vehicle.layout != "single":
            each *= 2.0  # left and right alike
        peel = prescribed.peel[:, None] * ("clap_and_peel" in self.terms)
        out = np.empty((len(each), len(self._active), 2, n))
        for k, name in enumerate(self._active):
            factor = {"rotation": 1.0 - peel, "clap_and_peel": peel}.get(name)
            row = each[:, _PLACES[name]]
            out[:, k] = row if factor is None else row * factor
        return out

    @cached_property
    def _span(self) -> tuple[Array, Array, Array, float]:
        """Middles of the elements (m), their chords (m) and masses per length (kg/m), and their common width (m)."""
        vehicle = self.vehicle
        width = vehicle.span / self.elements
        r = np.asarray((np.arange(self.elements) + 0.5) * width, np.float64)
        at, chords = [s.r for s in vehicle.stations], [s.chord for s in vehicle.stations]
        chord: Array = np.asarray(np.interp(r, at, chords))
        mass: Array = chord / float(np.trapezoid(chords, at)) * vehicle.wing_mass  # c / (c_mean R) M_wing (Eq. 14)
        return r, chord, mass, width

    @property
    def _harmonics(self) -> int:
        return (self.instants - 1) // 2

    def _basis(self, recording: Recording) -> tuple[Array, npt.NDArray[np.int64]]:
        """Cosines and sines [K, T] at the recording's instants, and their places in a series: only what passes."""
        k = np.arange(self._harmonics + 1)
        passing = np.ones(len(k))
        rate = sampling_rate(recording) if recording.low_pass else np.inf
        if recording.low_pass:
            passing = gain(recording.low_pass, rate, k * recording.condition.flap_frequency)
        kept = k[passing > _NEGLIGIBLE]
        kept_sines = kept[kept > 0]
        wanted = np.concatenate([kept, self._harmonics + kept_sines])
        if self._last_basis.get("recording") is not recording:
            psi = 2 * np.pi * recording.condition.flap_frequency * recording.times
            basis = np.concatenate([np.cos(kept[:, None] * psi), np.sin(kept_sines[:, None] * psi)])
            self._last_basis.update(recording=recording, basis=basis)
        return self._last_basis["basis"], wanted

    @cached_property
    def _last_basis(self) -> dict[str, Any]:
        return {}  # of one recording only: those of long unfiltered recordings fill memory


# What each row of the elements belongs to.
_ROWS = {
    "inertial": "inertial",
    "translation": "translation",
    "rotation": "rotation",
    "clap_and_peel": "clap_and_peel",
    "added_mass": "added_mass",
    "viscous_0": "viscous",
    "viscous_90": "viscous",
    "wing_acceleration": "wing_acceleration",
    "lift_curve": "steady_curves",
    "drag_curve": "steady_curves",
}
# Where the elements put it: peel decides at which instants the circulation of a pitching wing counts as which.
_PLACES = {name: (*ROWS, *CURVE_ROWS).index("rotation" if name == "clap_and_peel" else name) for name in _ROWS}


def _check_estimates(vehicle: Vehicle, genes: tuple[Gene, ...]) -> None:
    """Refuse estimates that no model of ``vehicle`` takes; those for terms that are off must be good as well."""
    known = {gene.name: gene for term in TERMS.values() for gene in term.genes} | {gene.name: gene for gene in genes}
    remedy = "change vehicle.estimates in dataset.yaml"
    for name, value in vehicle.estimates.items():
        if name not in known:
            raise EstimateError(
                f"estimate for unknown gene {name!r}; vehicles have {', '.join(sorted(known))}: {remedy}"
            )
        try:
            known[name].check(value)
        except ValueError as error:
            raise EstimateError(f"estimate of {error}: {remedy}") from None


def _sum(weights: Array, rows: Array) -> Array:
    """Weighted sum of ``rows`` [rows, ...], always in the same order, so that it does not depend on the batch."""
    total = np.zeros(rows.shape[1:])
    for weight, row in zip(weights, rows, strict=True):
        if weight != 0.0:
            total += weight * row
    return total


def _motion_rows(prescribed: Angles, root: float, half_step: float) -> Array:
    """Motion [B, 12, n / 8, 8] for :func:`wing_forces`, but for what depends on the side.

    The first element lies half a step from the root, so one pair of sine and cosine gives both of its turns.
    """
    flap, pitch = prescribed.flap, prescribed.pitch
    rows = np.empty((len(flap), 12, flap.shape[2]))
    half = half_step * (pitch[:, 0] - root)
    c, s = np.cos(half), np.sin(half)
    rows[:, [FLAP_RATE, FLAP_ACCELERATION]] = flap[:, 1:]
    rows[:, [PITCH_RATE, PITCH_ACCELERATION]] = pitch[:, 1:]
    rows[:, PEELED] = prescribed.peeled
    rows[:, COSINE], rows[:, SINE] = np.cos(root) * c - np.sin(root) * s, np.sin(root) * c + np.cos(root) * s
    rows[:, STEP_COSINE], rows[:, STEP_SINE] = c * c - s * s, 2 * c * s
    return rows.reshape(*rows.shape[:2], -1, LANES)


def _set_side(
    rows: Array, vehicle: Vehicle, flap: tuple[Array, Array, Array], condition: Condition, upper: bool
) -> Side:
    """Set the rows of the dihedral for the lower wings, or for the upper ones, and return the stream that they meet.

    In axes mirrored at the body's plane the upper wing moves like the lower one, in a stream from the other side. As
    printed, Eq. 18 has the stream along the upper wing's chord from behind (docs/decisions/0005). Wings that are no X
    move like lower ones. ``flap`` is the cosine and the sine of the flap angle, and its rate.
    """
    (cosine, sine, rate), shape = flap, (len(rows), *rows.shape[2:])
    sign, printed = -1.0 if upper else 1.0, vehicle.velocities == "printed"
    c, s = np.cos(vehicle.dihedral), np.sin(vehicle.dihedral)  # of the angle zeta_0 - sign zeta:
    rows[:, DIHEDRAL] = (c * cosine + sign * s * sine).reshape(shape)
    rows[:, DIHEDRAL_RATE] = ((sign * s * cosine - c * sine) * rate).reshape(shape)
    rows[:, PROJECTION] = cosine.reshape(shape) if printed else rows[:, DIHEDRAL]
    theta_b, speed = condition.angle_of_attack, condition.airspeed
    along = -1.0 if printed and upper else 1.0
    return Side(speed * np.cos(theta_b), sign * speed * np.sin(theta_b), along, float(printed), sign)
