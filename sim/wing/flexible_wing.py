"""The flexible wing as a model: from genomes to marker tracks, with the instants and the phase of a recording."""

from __future__ import annotations

import pickle
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np

from wingfit.records import CameraPose, Condition, Gene, Recording, Wing
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
from wingfit.sim.wing.beat_series import SlowChange, aligned_values, distinct, on_grid, series_of
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.genes import AERODYNAMIC, FACTOR, ROD_GENES, STRUCTURAL, lanes, wing_genes
from wingfit.sim.wing.rigid import rigid_beats
from wingfit.sim.wing.structure import Structure, build

Key = TypeVar("Key")
Value = TypeVar("Value")

_DEFINITION = ("wing", "division", "bounds_factor", "numerics", "effects", "probe", "near", "differentiates", "cameras")
_OWN_GENES = len(STRUCTURAL + AERODYNAMIC)  # the other genes are those of effects
_MAX_STARTS = 256
# Solutions used as warm starts, by wing and condition; shared by models that differ only in their effects.
_STARTS: OrderedDict[tuple[bytes, Condition], Course | None] = OrderedDict()
_MAX_BEATS = 64
# Beats of wings without effects on the wing, which are reused when only effects of the cameras differ.
_BEATS: OrderedDict[tuple[bytes, Condition, bytes], Beat] = OrderedDict()


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
        cameras: which filmed the wing, for the effects of cameras; empty: they assume a pair.
    """

    wing: Wing
    division: str = "11"
    bounds_factor: float = FACTOR
    numerics: Numerics = field(default_factory=Numerics)
    effects: tuple[str, ...] = ()
    probe: Probe | None = None
    near: tuple[float, ...] = ()
    differentiates: bool = False
    cameras: tuple[CameraPose, ...] = ()

    def __post_init__(self) -> None:
        chosen(self.effects, self.wing)

    def __getstate__(self) -> dict[str, object]:
        """Pickle the definition only; everything else is derived from it."""
        return {name: self.__dict__[name] for name in _DEFINITION}

    @cached_property
    def genes(self) -> tuple[Gene, ...]:
        """Structural genes (thesis Eq. 18), aerodynamic genes (Eq. 19), then those of the effects and the probe."""
        own = wing_genes(self.wing.estimates, self.bounds_factor)
        return (*own, *(gene for effect in self.chosen for gene in effect.genes(self.wing, self.cameras)))

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
        """Names of the genes that a calibration estimates: all that have an influence."""
        return tuple(gene.name for gene in self.genes if gene.name not in self.idle)

    @property
    def idle(self) -> tuple[str, ...]:
        """Names of the genes without influence: those of rods in a sheet, and all of the wing's own if it is rigid."""
        return {None: (), "sheet": ROD_GENES, "rigid": STRUCTURAL + AERODYNAMIC}[self.wing.structure]

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

    def scene(self, genome: ArrayLike, condition: Condition) -> WingScene:
        """Return the scene of ``genome`` [G] under ``condition``, as in the middle of a recording."""
        now = self._at(0.0, np.asarray(genome, float)[None])
        return self.subject(self._switched_on(now[0]), condition).scene(now)

    def _switched_on(self, genome: Array) -> tuple[Effect, ...]:
        """The effects that are on in ``genome`` [G] and act on the wing itself, not on its observation by cameras."""
        return tuple(e for e in self.chosen if e.wing and e.on(self.genes, genome[None])[0])

    @one_blas_thread
    def beats(self, genomes: ArrayLike, recording: Recording, *, with_motion: bool = False) -> tuple[Beat, ...]:
        """One periodic beat of each of ``genomes`` [B, G] under the recording's condition, with loads and energies.

        With ``with_motion``, the motion of all bodies is included. Individuals with the same effects on are simulated
        together; effects that are off are omitted. Individuals that differ only in effects of the observation share one
        beat.
        """
        beats, wing = self._beats(genome_batch(self.genes, genomes), recording, with_motion=with_motion)
        return tuple(beats[k] for k in wing)

    def _beats(
        self, batch: Array, recording: Recording, moment: float = 0.0, *, with_motion: bool = False
    ) -> tuple[list[Beat], Index]:
        """Simulate a beat of each distinct wing in ``batch`` [B, G] at a ``moment`` of the recording, -1/2 to 1/2.

        Returns the beats, and the index [B] of each individual's beat among them.
        """
        batch = self._at(moment, batch)
        first, wing = distinct(self._acting(batch, [effect for effect in self.chosen if effect.wing]))
        wings, found = batch[first], dict[int, Beat]()
        if self.wing.structure == "rigid":
            for effects, rows in by_active([effect for effect in self.chosen if effect.wing], self.genes, wings):
                beats = rigid_beats(self.subject(effects, recording.condition), wings[rows])
                found.update(zip(rows, beats, strict=True))
            return [found[k] for k in range(len(wings))], wing
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
        acting, near = self._switched_on(wings[0]), self._start_near(condition)
        subject, same = self.subject(acting, condition), not acting and tuple(wings[0, :_OWN_GENES]) == self.near
        if near is None:
            return periodic_beats(subject, wings, self.numerics)
        unit = np.array([gene.to_unit(column) for gene, column in zip(self.genes, wings[alike].T, strict=True)]).T
        apart = np.abs(unit[1:] - unit[0]).max(axis=1)
        found = iter(neighbouring_beats(subject, wings[alike], apart, self.numerics, near, same=same))
        first = next(found)
        kinked = replace(first, reason="an effect that is off has no derivative")
        return (first, *(next(found) if smooth else kinked for smooth in alike[1:]))

    def _at(self, moment: float, batch: Array) -> Array:
        """``batch`` [B, G] with the wings as they are at a ``moment`` of the recording, from -1/2 to 1/2."""
        names = {f"{one.name}.{p.name}" for one in self.chosen if one.during for p in one.size}
        if not names:
            return batch
        now = batch.copy()
        now[:, [gene.name in names for gene in self.genes]] *= moment
        return now

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
            parameters = effect.parameters_of(self.wing, self.cameras)
            columns = [place[f"{effect.name}.{parameter.name}"] for parameter in parameters]
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
        first, same = distinct(self._acting(whole, self.chosen))
        batch = whole[first]
        beats, wing = self._beats(batch, recording)
        series, times, added = self._observed(batch, recording, beats, wing)
        changes, failed = self._changes(batch, recording, series)
        height = np.mean([series[:, :, 3 * c + 2] for c in reference_columns(self.wing, recording)], axis=0)
        own = upstroke_crossing(height[:, : REFERENCE_HARMONICS + 1], self.wing.hinge.z)
        shift = (times - recording.times).mean(axis=1, keepdims=True)  # mean clock error, which alignment removes
        angles = 2 * np.pi * recording.condition.flap_frequency * (times - shift)
        since = angles - recorded_crossing(self.wing, recording)
        reasons = [
            beats[k].reason
            or failed.get(b)
            or (None if np.isfinite(phase) else "the reference markers never cross the hinge height")
            for b, (k, phase) in enumerate(zip(wing, own, strict=True))
        ]
        channels = aligned_values(series, since, own, recording.values, changes)
        channels += added
        solutions = [Solution(len(beats[k].tracks), beats[k].beats, beats[k].error) for k in wing]
        return Observation(channels[same], tuple(reasons[k] for k in same), tuple(solutions[k] for k in same))

    def _changes(
        self, batch: Array, recording: Recording, middle: Complex
    ) -> tuple[dict[int, SlowChange], dict[int, str]]:
        """Slow changes of individuals in ``batch`` [B, G] during a recording, and why they could not be simulated.

        Both by individual. ``middle`` [B, K + 1, C]: series of the beat in the middle of the recording.
        """
        on = [effect.on(self.genes, batch) for effect in self.chosen if effect.during]
        changing = np.flatnonzero(np.any(on, axis=0)) if on else np.empty(0, np.intp)
        if not len(changing):
            return {}, {}
        part, ends, failed = batch[changing], list[Complex](), dict[int, str]()
        for moment in (-0.5, 0.5):
            beats, wing = self._beats(part, recording, moment)
            ends.append(self._observed(part, recording, beats, wing)[0])
            failed |= {int(b): why for b, k in zip(changing, wing, strict=True) if (why := beats[k].reason)}
        times = recording.times
        found = {
            int(b): SlowChange.through(early, middle[b], late, times)
            for b, early, late in zip(changing, *ends, strict=True)
        }
        return found, failed

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
        series = np.stack([series_of(beat.tracks[:, columns].reshape(len(beat.tracks), -1)) for beat in beats])[wing]
        times, added = np.tile(recording.times, (len(batch), 1)), np.zeros((len(batch), *recording.values.shape))
        changed = affected(self.chosen, self.genes, batch)
        grids = {k: on_grid(beats[k].tracks) for k in dict.fromkeys(wing[changed].tolist())}
        for start in range(0, len(changed), LANES):  # blocks that stay in the cache
            block = changed[start : start + LANES]
            beat = np.stack([grids[k] for k in wing[block].tolist()])
            sampling = Sampling(self.wing, recording, beat, times[block], added[block], self.cameras)
            apply(self.chosen, self.genes, batch[block], sampling)
            shown = sampling.beat[:, :, columns].reshape(*sampling.beat.shape[:2], -1)
            series[block] = [series_of(one) for one in shown]
            times[block], added[block] = sampling.times, sampling.added
        return series, times, added


def _remember(known: OrderedDict[Key, Value], key: Key, value: Value, most: int) -> None:
    """Store ``value`` under ``key`` in ``known``, and remove the oldest entries beyond ``most``."""
    known[key] = value
    while len(known) > most:
        known.popitem(last=False)
