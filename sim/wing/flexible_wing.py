"""The flexible wing as a model: from genomes to marker tracks, with the instants and the phase of a recording."""

from __future__ import annotations

import pickle
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from wingfit.records import Condition, Gene, Recording, Wing
from wingfit.records.array_types import Array, ArrayLike, Complex, Index
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.effects.apply import affected, apply, by_active
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.ports.observation import Sampling
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.effects.probe import Probe
from wingfit.sim.effects.registry import chosen
from wingfit.sim.kernels import LANES
from wingfit.sim.model import Observation, Solution, genome_batch
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.solver.settle import Course, Subject
from wingfit.sim.solver.simulate import Beat, neighbouring_beats, periodic_beats, settled_course
from wingfit.sim.wing.alignment import REFERENCE_HARMONICS, recorded_crossing, reference_columns, upstroke_crossing
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.genes import AERODYNAMIC, FACTOR, STRUCTURAL, lanes, wing_genes
from wingfit.sim.wing.structure import Structure, build

Key = TypeVar("Key")
Value = TypeVar("Value")

MAX_SHIFT = 0.05  # rad, about 3 degrees of the beat
_DEFINITION = ("wing", "division", "bounds_factor", "numerics", "effects", "probe", "near", "differentiates")
_OWN_GENES = len(STRUCTURAL + AERODYNAMIC)  # the other genes are those of effects
_MAX_STARTS = 256
# Solutions used as warm starts, by wing and condition; shared by models that differ only in their effects.
_STARTS: OrderedDict[tuple[bytes, Condition], Course | None] = OrderedDict()
_MAX_BEATS = 64
# Beats of wings without effects on the wing, which are reused when only effects of the cameras differ.
_BEATS: OrderedDict[tuple[bytes, Condition, bytes], Beat] = OrderedDict()
_GRID = 96  # instants of a beat at which effects of the observation act
_HARMONICS = 30  # of the periodic tracks; higher ones are below the integrator's error


@dataclass(frozen=True)
class FlexibleWing:
    """Wing of rigid bodies and springs, driven by two rods (thesis III), whose markers are recorded by cameras.

    Attributes:
        wing: description of the wing.
        division: discretisation, as text for :meth:`wingfit.sim.wing.division.Division.parse`.
        bounds_factor: ratio of each gene's upper bound to the wing's estimate, and of the estimate to the lower bound.
        numerics: settings of the solver.
        effects: names of :data:`wingfit.sim.effects.registry.EFFECTS`; their genes follow the wing's own.
        probe: a known load, whose genes come last; None: no load.
        near: values of the wing's own genes. The periodic motion of this genome is the warm start of all individuals.
            Empty: every simulation starts from rest.
        differentiates: whether individuals are neighbours of the first of their batch, whose motion is differentiated.
    """

    wing: Wing
    division: str = "11"
    bounds_factor: float = FACTOR
    numerics: Numerics = field(default_factory=Numerics)
    effects: tuple[str, ...] = ()
    probe: Probe | None = None
    near: tuple[float, ...] = ()
    differentiates: bool = False

    def __post_init__(self) -> None:
        chosen(self.effects, self.wing)

    def __getstate__(self) -> dict[str, object]:
        """Pickle the definition only; everything else is derived from it."""
        return {name: self.__dict__[name] for name in _DEFINITION}

    @cached_property
    def genes(self) -> tuple[Gene, ...]:
        """Structural genes (thesis Eq. 18), aerodynamic genes (Eq. 19), then those of the effects and the probe."""
        own = wing_genes(self.wing.estimates, self.bounds_factor)
        return (*own, *(gene for effect in self.chosen for gene in effect.genes(self.wing)))

    @cached_property
    def chosen(self) -> tuple[Effect, ...]:
        """The effects in the order in which they act, followed by those of the probe."""
        known = self.probe.effects() if self.probe else ()
        return (*chosen(self.effects, self.wing), *known)

    def with_effects(self, *names: str) -> FlexibleWing:
        """Return the same wing with more effects, which are switched off; their genes are appended."""
        return self._share_structure(replace(self, effects=(*self.effects, *names)))

    def beside(self, genome: ArrayLike) -> FlexibleWing:
        """Return the same wing, whose simulations start from the periodic motion of ``genome`` [G] without effects."""
        return self._share_structure(replace(self, near=tuple(np.asarray(genome, float)[:_OWN_GENES].tolist())))

    def tangent(self, genome: ArrayLike) -> FlexibleWing:
        """Return the same wing for batches of neighbours, found from the motion of ``genome`` [G] without effects.

        See :class:`wingfit.sim.model.DifferentiableModel`.
        """
        return self._share_structure(replace(self.beside(genome), differentiates=True))

    def _share_structure(self, other: FlexibleWing) -> FlexibleWing:
        """Return ``other``, a model of the same wing and division, after giving it this model's structures."""
        for name in ("structure", "_structure_in_air"):
            if name in self.__dict__:
                other.__dict__[name] = self.__dict__[name]
        return other

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the genes that a calibration estimates: all genes."""
        return tuple(gene.name for gene in self.genes)

    @cached_property
    def structure(self) -> Structure:
        """The bodies and connectors of the discretised wing."""
        return build(self.wing, Division.parse(self.division))

    @cached_property
    def _structure_in_air(self) -> Structure:
        """The structure, with matrix blocks between all bodies of a strip, which added mass couples."""
        return build(self.wing, Division.parse(self.division), whole_strips=True)

    def subject(self, effects: tuple[Effect, ...], condition: Condition) -> Subject:
        """Return what the solver needs to simulate the wing with ``effects`` on, under ``condition``.

        That is the structure, the condition, and a function that makes the kernels' inputs from up to LANES genomes.
        """
        moves_air = any(effect.port == "inertia" and effect.family == "aerodynamics" for effect in effects)
        structure = self._structure_in_air if moves_air else self.structure

        def scene(genomes: Array) -> WingScene:
            found = WingScene.of(structure, condition, lanes(structure, self.genes, genomes))
            filled = genomes[np.minimum(np.arange(LANES), len(genomes) - 1)]
            for effect in effects:
                if effect.wing:
                    effect.wing(found, effect.values(self.genes, filled))
            return found

        return Subject(structure, condition, scene)

    def switched_on(self, genome: Array) -> tuple[Effect, ...]:
        """The effects that are on in ``genome`` [G] and act on the wing itself, not on its observation by cameras."""
        return tuple(e for e in self.chosen if e.wing and e.on(self.genes, genome[None])[0])

    @one_blas_thread
    def beats(self, genomes: ArrayLike, recording: Recording, *, with_motion: bool = False) -> tuple[Beat, ...]:
        """One periodic beat of each of ``genomes`` [B, G] under the recording's condition, with loads and energies.

        With ``with_motion``, the motion of all bodies is included. Individuals with the same effects on are simulated
        together; effects that are off are omitted. Individuals that differ only in effects of the observation share one
        beat.
        """
        beats, wing = self._beats(genome_batch(self.genes, genomes), recording, with_motion)
        return tuple(beats[k] for k in wing)

    def _beats(self, batch: Array, recording: Recording, with_motion: bool) -> tuple[list[Beat], Index]:
        """Simulate a beat of each distinct wing in ``batch`` [B, G].

        Returns the beats, and the index [B] of each individual's beat among them.
        """
        first, wing = _distinct(self._acting(batch, [effect for effect in self.chosen if effect.wing]))
        wings, found = batch[first], dict[int, Beat]()
        if self.differentiates:
            return list(self._neighbours(wings, recording.condition)), wing
        for effects, rows in by_active([effect for effect in self.chosen if effect.wing], self.genes, wings):
            reused = self.near and not effects and not with_motion
            keys = {k: self._key(wings[k], recording.condition) for k in rows} if reused else {}
            found |= {k: _BEATS[key] for k, key in keys.items() if key in _BEATS}
            if new := [k for k in rows if k not in found]:
                subject = self.subject(effects, recording.condition)
                near = self._start_near(recording.condition) if self.near else None
                beats = periodic_beats(subject, wings[new], self.numerics, with_motion=with_motion, near=near)
                found.update(zip(new, beats, strict=True))
            for k, key in keys.items():
                _remember(_BEATS, key, found[k], _MAX_BEATS)
        return [found[k] for k in range(len(wings))], wing

    def _neighbours(self, wings: Array, condition: Condition) -> tuple[Beat, ...]:
        """Beats of the first of ``wings`` [B, G] and, by its derivatives, of its neighbours.

        A neighbour in which another effect is on fails: many laws have a kink where they are switched off.
        """
        on = np.array([effect.on(self.genes, wings) for effect in self.chosen if effect.wing], bool)
        alike = (on == on[:, :1]).all(axis=0) if len(on) else np.ones(len(wings), bool)
        acting, near = self.switched_on(wings[0]), self._start_near(condition)
        subject, same = self.subject(acting, condition), not acting and tuple(wings[0, :_OWN_GENES]) == self.near
        if near is None:
            return periodic_beats(subject, wings, self.numerics)
        unit = np.array([gene.to_unit(column) for gene, column in zip(self.genes, wings[alike].T, strict=True)]).T
        apart = np.abs(unit[1:] - unit[0]).max(axis=1)
        found = iter(neighbouring_beats(subject, wings[alike], apart, self.numerics, near, same=same))
        first = next(found)
        kinked = replace(first, reason="an effect that is off has no derivative")
        return (first, *(next(found) if smooth else kinked for smooth in alike[1:]))

    def _key(self, genome: Array, condition: Condition) -> tuple[bytes, Condition, bytes]:
        return self._plain_key, condition, genome[:_OWN_GENES].tobytes()

    def _start_near(self, condition: Condition) -> Course | None:
        """Periodic solution of the genome ``near`` under ``condition``, used as warm start; None if it fails."""
        wing, key = self._plain_wing, (self._plain_key, condition)
        if key not in _STARTS:
            found = settled_course(wing.subject((), condition), np.array(self.near), self.numerics)
            _remember(_STARTS, key, found, _MAX_STARTS)
        return _STARTS[key]

    @cached_property
    def _plain_wing(self) -> FlexibleWing:
        return self._share_structure(replace(self, effects=(), probe=None, differentiates=False))

    @cached_property
    def _plain_key(self) -> bytes:
        return pickle.dumps(self._plain_wing, 5)

    def _acting(self, batch: Array, effects: Sequence[Effect]) -> Array:
        """Copy of ``batch`` [B, G] with zeros for genes of effects that do not act on an individual.

        These are effects that are off in the individual's genome, and all that are not listed in ``effects``.
        """
        plain = np.zeros_like(batch)
        plain[:, :_OWN_GENES] = batch[:, :_OWN_GENES]
        place = {gene.name: k for k, gene in enumerate(self.genes)}
        for effect in effects:
            columns = [place[f"{effect.name}.{parameter.name}"] for parameter in effect.parameters]
            cells = np.ix_(np.flatnonzero(effect.on(self.genes, batch)), np.array(columns))
            plain[cells] = batch[cells]
        return plain

    def beat(self, genome: ArrayLike, recording: Recording, *, with_motion: bool = False) -> Beat:
        """Simulate a beat of a single ``genome`` [G]; see :meth:`beats`."""
        (found,) = self.beats(np.asarray(genome, float)[None], recording, with_motion=with_motion)
        return found

    @one_blas_thread
    def observe(self, genomes: ArrayLike, recording: Recording) -> Observation:
        """Simulated marker positions [B, T, C] of ``genomes`` [B, G] at the recording's frames, C as in the recording.

        Simulated and recorded beats are aligned where the reference markers cross the hinge height on the upstroke.
        Tracking noise makes a small error of this phase, which is then fitted, since the trigger of the cameras is
        unknown (docs/decisions/0001).
        """
        whole = genome_batch(self.genes, genomes)
        first, same = _distinct(self._acting(whole, self.chosen))
        batch = whole[first]
        beats, wing = self._beats(batch, recording, with_motion=False)
        series, times, added = self._observed(batch, recording, beats, wing)
        height = np.mean([series[:, :, 3 * c + 2] for c in reference_columns(self.wing, recording)], axis=0)
        own = upstroke_crossing(height[:, : REFERENCE_HARMONICS + 1], self.wing.hinge.z)
        shift = (times - recording.times).mean(axis=1, keepdims=True)  # mean clock error, which alignment removes
        angles = 2 * np.pi * recording.condition.flap_frequency * (times - shift)
        since = angles - recorded_crossing(self.wing, recording)
        reasons = [
            beats[k].reason or (None if np.isfinite(phase) else "the reference markers never cross the hinge height")
            for k, phase in zip(wing, own, strict=True)
        ]
        channels = _aligned_values(series, since, own, recording.values)
        channels += added
        solutions = [Solution(len(beats[k].tracks), beats[k].beats, beats[k].error) for k in wing]
        return Observation(channels[same], tuple(reasons[k] for k in same), tuple(solutions[k] for k in same))

    def _observed(
        self, batch: Array, recording: Recording, beats: Sequence[Beat], wing: Index
    ) -> tuple[Complex, Array, Array]:
        """Apply the effects of cameras and tracking to the ``beats``.

        ``wing`` [B]: index of each individual's beat in ``beats``. Returns Fourier series [B, K + 1, C] of the recorded
        coordinates over the beat (m), the instants [B, T] of the frames (s), and errors [B, T, C] to add after sampling
        (m).
        """
        names = [marker.name for marker in self.wing.markers]
        columns = [names.index(name) for name in recording.markers]
        series = np.stack([_series(beat.tracks[:, columns].reshape(len(beat.tracks), -1)) for beat in beats])[wing]
        times, added = np.tile(recording.times, (len(batch), 1)), np.zeros((len(batch), *recording.values.shape))
        changed = affected(self.chosen, self.genes, batch)
        grids = {k: _on_grid(beats[k].tracks) for k in dict.fromkeys(wing[changed].tolist())}
        for start in range(0, len(changed), LANES):  # blocks that stay in the cache
            block = changed[start : start + LANES]
            beat = np.stack([grids[k] for k in wing[block].tolist()])
            sampling = Sampling(self.wing, recording, beat, times[block], added[block])
            apply(self.chosen, self.genes, batch[block], sampling)
            shown = sampling.beat[:, :, columns].reshape(*sampling.beat.shape[:2], -1)
            series[block] = [_series(one) for one in shown]
            times[block], added[block] = sampling.times, sampling.added
        return series, times, added


def _distinct(rows: Array) -> tuple[Index, Index]:
    """Indices of the distinct ``rows``, and for every row the position of its equal among these (bit for bit)."""
    first = dict[bytes, int]()
    kinds = [first.setdefault(row.tobytes(), len(first)) for row in rows]
    return np.unique(kinds, return_index=True)[1], np.array(kinds, np.intp)


def _remember(known: OrderedDict[Key, Value], key: Key, value: Value, most: int) -> None:
    """Store ``value`` under ``key`` in ``known``, and remove the oldest entries beyond ``most``."""
    known[key] = value
    while len(known) > most:
        known.popitem(last=False)


def _on_grid(tracks: Array) -> Array:
    """Resample periodic ``tracks`` [n, M, 3] at _GRID equal steps, from their first _HARMONICS harmonics."""
    series = _series(tracks.reshape(len(tracks), -1))
    series[1:] *= 0.5
    return np.asarray(np.fft.irfft(series * _GRID, _GRID, axis=0)).reshape(_GRID, *tracks.shape[1:])


def _aligned_values(series: Complex, since: Array, own: Array, recorded: Array) -> Array:
    """Values [B, T, C] of the Fourier ``series`` [B, K + 1, C] of B individuals at the frames of a recording.

    The phase (rad) at a frame is ``since`` [B, T], since the recorded crossing, plus ``own`` [B], the simulated
    crossing, plus a common shift of each individual. Two Gauss-Newton steps fit the shift to ``recorded`` [T, C]; noise
    makes a shift of about a thousandth of a radian. Each step is limited to MAX_SHIFT, so that a larger shift remains
    visible as misfit. The series is shifted, not the frames, so that individuals can share the sines and cosines of the
    frames.
    """
    weight = np.isfinite(recorded).astype(float)
    target = np.where(np.isfinite(recorded), recorded, 0.0)
    first, which = _distinct(since)
    angles = since[first, :, None] * np.arange(series.shape[1])
    waves = np.concatenate([np.cos(angles), np.sin(angles)], axis=2)
    found = np.empty((len(series), *recorded.shape))
    for values, one, place, k in zip(found, series, own, which, strict=True):
        values[:] = _fitted(waves[k], _turned(one, place), target, weight)
    return found


def _fitted(waves: Array, series: Complex, target: Array, weight: Array) -> Array:
    """Values [T, C] of one ``series`` [K + 1, C], shifted in phase to fit ``target`` [T, C] by weighted least squares.

    ``weight`` [T, C]: 1 where recorded, 0 elsewhere. ``waves`` [T, 2 (K + 1)]: cosines, then sines, of k times the
    phase of each frame, k = 0 .. K.
    """
    order = 1j * np.arange(len(series))[:, None]
    for _ in range(2):
        slope = weight * (waves @ _parts(order * series))
        power = float((slope * slope).sum())
        shift = -float((slope * (waves @ _parts(series) - target)).sum()) / power if power > 0 else 0.0
        series = _turned(series, np.clip(shift, -MAX_SHIFT, MAX_SHIFT))
    return waves @ _parts(series)


def _turned(series: Complex, phase: float) -> Complex:
    """Fourier ``series`` [K + 1, C] of the same functions, advanced in phase by ``phase`` (rad)."""
    return np.asarray(series * np.exp(1j * np.arange(len(series)) * phase)[:, None])


def _parts(series: Complex) -> Array:
    """Real coefficients [2 (K + 1), C] of ``series`` [K + 1, C]: of cosines, then of sines.

    Re s exp(i x) = Re s cos x - Im s sin x.
    """
    return np.concatenate([series.real, -series.imag])


def _series(samples: Array) -> Complex:
    """Fourier series [_HARMONICS + 1, C] of periodic ``samples`` [n, C] over a beat.

    value(psi) = Re sum_k series_k exp(i k psi) at the drive phase psi.
    """
    n = len(samples)
    used = min(_HARMONICS, (n - 1) // 2) + 1
    series = np.zeros((_HARMONICS + 1, samples.shape[1]), np.complex128)
    series[:used] = np.fft.rfft(samples, axis=0)[:used] / n
    series[1:] *= 2
    return series
