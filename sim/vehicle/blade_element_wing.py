"""Model of a flapping vehicle: it computes the forces of the wings from genomes, sampled and filtered like a recording.

Quasi-steady blade elements with clap-and-peel (Armanini et al. 2016). Forces are sums of coefficients times terms that
depend on the motion alone, so that a search over coefficients computes these terms only once.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping, Set
from dataclasses import dataclass, replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from wingfit.records import EstimateError, Gene, Recording, Vehicle
from wingfit.records.array_types import Array, ArrayLike, Index
from wingfit.records.blas_threads import one_blas_thread
from wingfit.sim.effects import registry
from wingfit.sim.effects.apply import affected, apply, by_active
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.ports.observation import Sampling
from wingfit.sim.effects.ports.vehicle import ROTATION_POINT, Setting, VehicleScene
from wingfit.sim.kernels import LANES
from wingfit.sim.model import Observation, genome_batch
from wingfit.sim.vehicle.elements import CURVE_ROWS, PEELED, ROWS, Constants, synthesise, synthesise_at, wing_forces
from wingfit.sim.vehicle.motion import Angles, motion_genes
from wingfit.sim.vehicle.rows import mirrored
from wingfit.sim.vehicle.sampling import basis_of, passed, phases, series_of
from wingfit.sim.vehicle.terms import SEARCHED, TERMS, chosen

ADDED_MASS_POINT = 0.5  # d, chords: point whose acceleration the added mass has (Armanini et al. 2016, below Eq. 19)
MULTIPLE = 8  # of instants, on any processor
BLOCK = 8  # individuals whose forces stay in the cache
_MAX_MOTIONS = 64  # per recording, whose elements are cached
_DEFINITION = ("vehicle", "terms", "elements", "instants", "peel_width", "effects")


@dataclass(frozen=True)
class BladeElementWing:
    """Model of the forces of a vehicle's wings, on a balance or in flight, with prescribed motion of the wings.

    ``terms`` are names of :data:`wingfit.sim.vehicle.terms.TERMS`. A beat is computed at ``instants`` equal steps with
    ``elements`` along each wing. The peel ends smoothly within ``peel_width`` beats (0: in one step, as printed).
    ``effects`` are names of :data:`wingfit.sim.effects.registry.EFFECTS` whose genes are appended.
    """

    vehicle: Vehicle
    terms: tuple[str, ...] = chosen("proposed")
    elements: int = 40
    instants: int = 400
    peel_width: float = 0.0
    effects: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in self.terms:
            if name not in TERMS:
                raise ValueError(f"unknown term {name!r}; there are {', '.join(TERMS)}")
        if self.elements < 1 or self.instants < 1 or self.instants % MULTIPLE:
            raise ValueError(
                f"{self.elements} elements and {self.instants} instants; there must be at least one element, and a "
                f"positive multiple of {MULTIPLE} instants"
            )
        if not 0 <= self.peel_width <= 0.5:
            raise ValueError(f"peel_width is {self.peel_width:g} beats; it must lie in [0, 0.5]")
        _check_effects(self)

    def __getstate__(self) -> dict[str, object]:
        """Pickle the definition only; everything else is derived from it."""
        return {name: self.__dict__[name] for name in _DEFINITION}

    @cached_property
    def genes(self) -> tuple[Gene, ...]:
        """Genes of a genome: coefficients of the terms, parameters of the wings' motion, then genes of the effects.

        EstimateError if the vehicle has an invalid estimate.
        """
        coefficients = [gene for name in TERMS for gene in TERMS[name].genes if name in self.terms]
        if not self.vehicle.claps:
            coefficients = [gene for gene in coefficients if gene.name != "C_F"]
        genes = (*coefficients, *motion_genes(self.vehicle.motion))
        _check_estimates(self.vehicle, genes)
        own = tuple(replace(gene, nominal=self.vehicle.estimates.get(gene.name, gene.nominal)) for gene in genes)
        return (*own, *(gene for effect in self.chosen for gene in effect.genes(self.vehicle)))

    @cached_property
    def chosen(self) -> tuple[Effect, ...]:
        """The effects named in ``effects``, in the order in which they act."""
        return registry.chosen(self.effects, self.vehicle)

    def with_effects(self, *names: str) -> BladeElementWing:
        """Copy of this model with the effects ``names`` added; their genes are appended, nominally switched off."""
        return replace(self, effects=(*self.effects, *names))

    @cached_property
    def searched(self) -> tuple[str, ...]:
        """Names of the model's genes that a search estimates by default: C_l, C_r, C_F, K_l, K_d and those of effects.

        The coefficients of viscous drag and the motion are fixed, as in Armanini et al. (2016); a fit to two force axes
        also searches those of drag.
        """
        added = {gene.name for effect in self.chosen for gene in effect.genes(self.vehicle)}
        return tuple(gene.name for gene in self.genes if gene.name in added.union(SEARCHED))

    @one_blas_thread
    def beat(self, genomes: ArrayLike, recording: Recording) -> Array:
        """Forces [B, n, 2] along body x and z (N) over one beat from t* = 0, unfiltered, of ``genomes`` [B, G]."""
        batch = genome_batch(self.genes, genomes)
        out = np.empty((len(batch), 2, self.instants))
        for effects, members in self._by_active_effects(batch):
            for start in range(0, len(members), BLOCK):
                block = members[start : start + BLOCK]
                if effects:
                    weights, rows, added = self._rows_with_effects(effects, batch[block], recording)
                    out[block] = [_sum(w, row) + more for w, row, more in zip(weights, rows, added, strict=True)]
                else:
                    weights = self._weights(self._values(batch[block], _COEFFICIENTS), len(block))
                    found = self._cached_rows(batch[block], recording)
                    out[block] = [_sum(w, row) for w, row in zip(weights, found, strict=True)]
        return out.transpose(0, 2, 1)

    def angles(self, genome: ArrayLike, recording: Recording) -> Angles:
        """Flap angle and wing pitch over one beat, with the effects of the drive that are on in ``genome`` [G]."""
        batch = genome_batch(self.genes, np.asarray(genome, float)[None])
        ((effects, _),) = self._by_active_effects(batch)
        return self._changed_scene(effects, batch, recording).angles

    def term_forces(self, genome: ArrayLike, recording: Recording) -> dict[str, Array]:
        """Forces [n, 2] (N) by name of the term, for one ``genome`` [G]; they add up to those of :meth:`beat`.

        The entry "effects" holds the forces that effects add; it is absent if no effect is on.
        """
        batch = genome_batch(self.genes, np.asarray(genome, float)[None])
        ((effects, _),) = self._by_active_effects(batch)
        parts = dict[str, Array]()
        if effects:
            weights, rows, added = self._rows_with_effects(effects, batch, recording)
            parts["effects"] = added[0].T
        else:
            weights = self._weights(self._values(batch, _COEFFICIENTS), len(batch))
            rows = self._rows(batch, recording)
        for name, weight, row in zip(self._active, weights[0], rows[0], strict=True):
            term = _ROWS[name][0]
            parts[term] = parts.get(term, 0.0) + weight * row.T
        return parts

    @one_blas_thread
    def observe(self, genomes: ArrayLike, recording: Recording) -> Observation:
        """Forces [B, T, C] (N) of ``genomes`` [B, G] at the recording's instants, along its axes, low-passed like it.

        ValueError for a recording of tracks.
        """
        if recording.kind != "forces":
            raise ValueError(f"recording {recording.name!r} holds tracks; a vehicle is compared with forces")
        batch = genome_batch(self.genes, genomes)
        beat = self.beat(batch, recording)
        changed, sampling = self._observed(batch, beat, recording)
        beat[changed] = sampling.beat
        basis, wanted = basis_of(recording, self._harmonics)
        axes = ["xz".index(axis) for axis in recording.forces]
        series = series_of(beat[:, :, axes].transpose(0, 2, 1), self._harmonics, recording)[:, :, wanted]
        series = np.ascontiguousarray(series)
        channels = np.empty((len(batch), len(recording.times), len(axes)))
        synthesise(basis, series, channels)
        for k, times, added in zip(changed, sampling.times, sampling.added, strict=True):
            if not np.array_equal(times, recording.times):
                synthesise_at(phases(recording, times), series[k], channels[k])
            channels[k] += passed(added, recording)
        good = [bool(np.isfinite(forces).all()) for forces in channels]
        return Observation(channels, tuple(None if fine else "the forces are not finite" for fine in good))

    # -- effects -----------------------------------------------------------------------------------------------

    def _by_active_effects(self, batch: Array) -> list[tuple[tuple[Effect, ...], list[int]]]:
        """Sets of effects on the vehicle, each with the indices in ``batch`` [B, G] where exactly these are on."""
        return by_active([effect for effect in self.chosen if effect.vehicle], self.genes, batch)

    def _rows_with_effects(
        self, effects: tuple[Effect, ...], batch: Array, recording: Recording
    ) -> tuple[Array, Array, Array]:
        """Weights [B, rows], forces [B, rows, 2, n] that they multiply, and added forces [B, 2, n], N, for ``effects``.

        The force of the vehicle is the sum over the rows of weights times forces, plus the added forces.
        """
        scene = self._changed_scene(effects, batch, recording)
        return self._weights(scene.genes, len(batch), scene.behind), self._wings(scene), scene.finish()

    def _changed_scene(self, effects: tuple[Effect, ...], batch: Array, recording: Recording) -> VehicleScene:
        """The scene of the individuals in ``batch`` [B, G] with all changes by ``effects``."""
        moving = {} if recording.motion else self._values(batch, self._motion_names)
        scene = self._scene(moving | self._values(batch, _COEFFICIENTS), len(batch), recording)
        for effect in effects:
            if effect.vehicle:
                effect.vehicle(scene, effect.values(self.genes, batch))
        scene.settle()
        return scene

    def _observed(self, batch: Array, beat: Array, recording: Recording) -> tuple[Index, Sampling]:
        """Indices in ``batch`` [B, G] of individuals with an effect on the observation, and their changed sampling.

        ``beat`` [B, n, 2]: forces of all individuals over one beat, N.
        """
        changed = affected(self.chosen, self.genes, batch)
        times, added = (np.zeros((len(changed), *shape)) for shape in (recording.times.shape, recording.values.shape))
        sampling = Sampling(self.vehicle, recording, beat[changed], times + recording.times, added)
        apply(self.chosen, self.genes, batch[changed], sampling)
        return changed, sampling

    # -- rows: forces of each term for a coefficient of one ----------------------------------------------------

    def _values(self, batch: Array, names: Set[str]) -> dict[str, Array]:
        """Values [B] in ``batch`` [B, G] by name of the gene, for the genes called ``names``, in the model's order."""
        return {gene.name: batch[:, k] for k, gene in enumerate(self.genes) if gene.name in names}

    def _weights(self, coefficients: Mapping[str, Array], count: int, behind: ArrayLike = 0.0) -> Array:
        """Factors [count, rows] by which the forces of each active term are multiplied; see :meth:`_rows`.

        ``behind`` [count]: as of a scene.
        """
        zero, one = np.zeros(count), np.ones(count)
        scale = {row: coefficients.get(name, zero) if name else one for row, (_, name) in _ROWS.items()}
        scale["rotation"] = scale["rotation"] * (ROTATION_POINT - self.vehicle.pitch_axis + np.asarray(behind))
        scale["clap_and_peel"] = -scale["clap_and_peel"]  # theta_fling' = -theta_w'
        return np.stack([scale[row] for row in self._active], axis=1)

    @cached_property
    def _active(self) -> tuple[str, ...]:
        """Names of the active rows: the parts of the force, each with its own coefficient, that belong to ``terms``."""
        return tuple(row for row, (term, _) in _ROWS.items() if term in self.terms)

    @cached_property
    def _cache(self) -> WeakKeyDictionary[Recording, OrderedDict[bytes, Array]]:
        return WeakKeyDictionary()

    @cached_property
    def _motion_names(self) -> frozenset[str]:
        return frozenset(gene.name for gene in motion_genes(self.vehicle.motion))

    def _cached_rows(self, batch: Array, recording: Recording) -> list[Array]:
        """Forces as of :meth:`_rows`, one array [rows, 2, n] per individual; those of recent motions are cached."""
        cached = self._cache.setdefault(recording, OrderedDict())
        motions = np.stack(list(self._values(batch, self._motion_names).values()) or [np.zeros(len(batch))], axis=1)
        keys = [motion.tobytes() for motion in motions]
        new = {key: row for row, key in enumerate(keys) if key not in cached}
        found = dict(zip(new, self._rows(batch[list(new.values())], recording), strict=True)) if new else {}
        answer = [found[key] if key in found else cached[key] for key in keys]
        cached.update(found)
        while len(cached) > _MAX_MOTIONS:
            cached.popitem(last=False)
        return answer

    def _rows(self, batch: Array, recording: Recording) -> Array:
        """Forces [B, rows, 2, n] of each active row for a coefficient of one (N), all wings together."""
        moving = {} if recording.motion else self._values(batch, self._motion_names)
        found = self._wings(self._scene(moving, len(batch) if moving else 1, recording))
        return np.repeat(found, len(batch), axis=0) if len(found) < len(batch) else found

    def _scene(self, genes: dict[str, Array], count: int, recording: Recording) -> VehicleScene:
        """Scene of ``count`` individuals in the recording's condition, from the values [count] by name in ``genes``."""
        motion, r = recording.motion or self.vehicle.motion, self._span[0]
        setting = Setting(self.vehicle, self.terms, motion, recording.condition, self.instants, self.peel_width, r)
        return VehicleScene.of(setting, genes, count)

    def _wings(self, scene: VehicleScene) -> Array:
        """Forces [B, rows, 2, n] of each active row for a coefficient of one (N), all wings of ``scene`` together.

        The force of the fling circulation that effects add is added to ``scene.added``.
        """
        vehicle, n, motion = self.vehicle, self.instants, scene.setting.motion
        r, chord, mass, width = self._span
        first, step = np.array([r[0], width]) / (motion.pitch_station * vehicle.span)
        constants = Constants(vehicle.thickness, width, first, step, ADDED_MASS_POINT)
        curves = len(CURVE_ROWS) if "steady_curves" in self.terms else 0
        found = np.zeros((len(scene), len(ROWS) + curves, 2, n // LANES, LANES))
        rows = scene.rows(first)
        rows[:, PEELED] = scene.apart(rows)
        chords, masses = scene.chord[:, None] * chord, scene.mass_factor[:, None] * mass
        loading = scene.loading[:, : len(r)].copy()
        grouped = rows.reshape(*rows.shape[:2], -1, LANES)
        for side in scene.each_side(rows):
            air = (scene.density.copy(), scene.carried.copy())
            wing_forces(grouped, side, r, chords, masses, *air, loading, constants, found)
        each = found.reshape(len(found), -1, 2, n)
        each *= (mirrored(vehicle) * scene.length)[:, None, None, None]
        peel = scene.angles.peel[:, None] * ("clap_and_peel" in self.terms)
        out = np.empty((len(each), len(self._active), 2, n))
        for k, name in enumerate(self._active):
            factor = {"rotation": 1.0 - peel, "clap_and_peel": peel}.get(name)
            row = each[:, _INDEX[name]]
            out[:, k] = row if factor is None else row * factor
        turning = scene.lever[:, None, None]
        for name, gene in scene.included.items():
            row = each[:, ROWS.index(name)] * scene.genes[gene][:, None, None]
            scene.added += row * (turning * (1.0 - peel)) if name == "rotation" else row
        if scene.fling.any():
            scene.added -= scene.fling[:, None, None] * scene.angles.peel[:, None] * each[:, ROWS.index("rotation")]
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


# The term to which each row of the elements belongs, and its coefficient, if any.
_ROWS = {
    "inertial": ("inertial", ""), "translation": ("translation", "C_l"), "rotation": ("rotation", "C_r"),
    "clap_and_peel": ("clap_and_peel", "C_F"), "added_mass": ("added_mass", ""), "viscous_0": ("viscous", "C_D0"),
    "viscous_90": ("viscous", "C_Dpi2"), "wing_acceleration": ("wing_acceleration", ""),
    "lift_curve": ("steady_curves", "K_l"), "drag_curve": ("steady_curves", "K_d"),
}  # fmt: skip
# The row of the elements; clap_and_peel is that of rotation while the wings peel.
_INDEX = {name: (*ROWS, *CURVE_ROWS).index("rotation" if name == "clap_and_peel" else name) for name in _ROWS}


# Genes on which the flow at the stations depends; a scene without effects depends on the motion alone.
_COEFFICIENTS = {name for _, name in _ROWS.values() if name}


def _check_effects(model: BladeElementWing) -> None:
    """Raise ValueError if an effect is unknown, already a term of ``model``, or needs wings that meet where none do."""
    for effect in registry.chosen(model.effects, model.vehicle):
        if effect.term in model.terms:
            raise ValueError(f"effect {effect.name!r} is a term of this model already; remove the effect, or the term")
        if not effect.fits(model.terms):
            raise ValueError(
                f"effect {effect.name!r} changes the term {effect.of_term!r}, which this model does not have: add the "
                "term, or remove the effect"
            )
        if effect.name == "clap_and_peel" and not model.vehicle.claps:
            raise ValueError("effect 'clap_and_peel' needs wings that meet, but vehicle.claps is false: remove it")


def _check_estimates(vehicle: Vehicle, genes: tuple[Gene, ...]) -> None:
    """Raise EstimateError if an estimate of ``vehicle`` is outside its gene's bounds or names an unknown gene.

    Known are ``genes`` and the coefficients of all terms, active or not.
    """
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
    """Sum over the first axis of ``rows`` [R, ...] times ``weights`` [R], always in the same order of summation."""
    total = np.zeros(rows.shape[1:])
    for weight, row in zip(weights, rows, strict=True):
        if weight != 0.0:
            total += weight * row
    return total
