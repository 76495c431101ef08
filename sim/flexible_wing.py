"""The flexible wing as a model: genomes in, marker tracks out, sampled and aligned like a recording."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from records import Condition, Gene, Recording, Wing
from sim.alignment import REFERENCE_HARMONICS, recorded_crossing, reference_columns, upstroke_crossing
from sim.division import Division
from sim.effects.contract import Effect
from sim.effects.observation import Sampling, apply, observed
from sim.effects.registry import chosen
from sim.effects.wing import WingScene
from sim.kernels import LANES
from sim.model import Observation, Solution, genome_batch
from sim.numerics import Numerics
from sim.settle import Subject
from sim.simulate import Beat, periodic_beats
from sim.structure import Structure, build
from sim.wing_genes import FACTOR, lanes, wing_genes

Array = npt.NDArray[np.float64]

LARGEST_SHIFT = 0.05  # rad, about 3 degrees of the beat
_GRID = 96  # instants of a beat that effects of the observation see
_HARMONICS = 30  # of the periodic tracks that are kept; the rest is below the integrator's error


@dataclass(frozen=True)
class FlexibleWing:
    """Multi-body wing driven by two rods (thesis III) for markers seen by cameras.

    ``division`` as :meth:`sim.division.Division.parse` reads it; genes are bounded by ``bounds_factor`` around the
    wing's estimates. ``effects`` are names of :data:`sim.effects.registry.EFFECTS` whose genes are appended.
    """

    wing: Wing
    division: str = "11"
    bounds_factor: float = FACTOR
    numerics: Numerics = field(default_factory=Numerics)
    effects: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        chosen(self.effects, self.wing)

    def __getstate__(self) -> dict[str, object]:
        """Pickle the definition only; whatever was built from it is built again."""
        return {name: self.__dict__[name] for name in ("wing", "division", "bounds_factor", "numerics", "effects")}

    @cached_property
    def genes(self) -> tuple[Gene, ...]:
        """Structural genes (thesis Eq. 18), aerodynamic ones (Eq. 19), then those of the effects."""
        own = wing_genes(self.wing.estimates, self.bounds_factor)
        return (*own, *(gene for effect in self.chosen for gene in effect.genes(self.wing)))

    @cached_property
    def chosen(self) -> tuple[Effect, ...]:
        """The effects, in the order in which they act."""
        return chosen(self.effects, self.wing)

    def with_effects(self, *names: str) -> FlexibleWing:
        """The same wing with more effects; their genes are appended, switched off."""
        return replace(self, effects=(*self.effects, *names))

    @property
    def searched(self) -> tuple[str, ...]:
        """All genes."""
        return tuple(gene.name for gene in self.genes)

    @cached_property
    def structure(self) -> Structure:
        """Bodies and connectors."""
        return build(self.wing, Division.parse(self.division))

    @cached_property
    def _immersed(self) -> Structure:
        """The same, with room in the matrix for air that the bodies of a strip move together."""
        return build(self.wing, Division.parse(self.division), whole_strips=True)

    def subject(self, effects: tuple[Effect, ...], condition: Condition) -> Subject:
        """What is simulated where some of the effects are on."""
        moves_air = any(effect.port == "inertia" and effect.family == "aerodynamics" for effect in effects)
        structure = self._immersed if moves_air else self.structure

        def scene(genomes: Array) -> WingScene:
            found = WingScene.of(structure, condition, lanes(structure, self.genes, genomes))
            filled = genomes[np.minimum(np.arange(LANES), len(genomes) - 1)]
            for effect in effects:
                if effect.wing:
                    effect.wing(found, effect.values(self.genes, filled))
            return found

        return Subject(structure, condition, scene)

    def switched_on(self, genome: Array) -> tuple[Effect, ...]:
        """The effects on the wing itself that are on in ``genome`` [G]."""
        return tuple(e for e in self.chosen if e.wing and not e.off(e.values(self.genes, genome[None]))[0])

    def beats(self, genomes: npt.ArrayLike, recording: Recording, *, with_motion: bool = False) -> tuple[Beat, ...]:
        """One periodic beat of each of ``genomes`` [B, G] under the recording's condition, with loads and energies.

        Individuals with the same effects on are simulated together: one that is off costs nothing and changes nothing.
        """
        batch = genome_batch(self.genes, genomes)
        alike: dict[tuple[str, ...], list[int]] = {}
        for k, one in enumerate(batch):
            alike.setdefault(tuple(e.name for e in self.switched_on(one)), []).append(k)
        found: dict[int, Beat] = {}
        for rows in alike.values():
            subject = self.subject(self.switched_on(batch[rows[0]]), recording.condition)
            beats = periodic_beats(subject, batch[rows], self.numerics, with_motion=with_motion)
            found.update(zip(rows, beats, strict=True))
        return tuple(found[k] for k in range(len(batch)))

    def beat(self, genome: npt.ArrayLike, recording: Recording, *, with_motion: bool = False) -> Beat:
        """The same for a single genome [G]."""
        (found,) = self.beats(np.asarray(genome, float)[None], recording, with_motion=with_motion)
        return found

    def observe(self, genomes: npt.ArrayLike, recording: Recording) -> Observation:
        """Tracks [B, T, C] of ``genomes`` [B, G] at the recording's frames.

        Beats are aligned by the upstroke crossing; what tracking noise leaves of a phase error is then fitted, the
        trigger of the cameras being unknown (docs/decisions/0001).
        """
        batch = genome_batch(self.genes, genomes)
        beats = self.beats(batch, recording)
        series, times, added = self._seen(batch, recording, beats)
        height = np.mean([series[:, :, 3 * c + 2] for c in reference_columns(self.wing, recording)], axis=0)
        own = upstroke_crossing(height[:, : REFERENCE_HARMONICS + 1], self.wing.hinge.z)
        shift = (times - recording.times).mean(axis=1, keepdims=True)  # of the clock: alignment takes it, however large
        angles = 2 * np.pi * recording.condition.flap_frequency * (times - shift)
        since = angles - recorded_crossing(self.wing, recording)
        reasons = tuple(
            beat.reason or (None if np.isfinite(phase) else "the reference markers never cross the hinge height")
            for beat, phase in zip(beats, own, strict=True)
        )
        channels = np.stack(
            [_laid_over(s, t + p, recording.values) for s, t, p in zip(series, since, own, strict=True)]
        )
        channels += added
        solutions = tuple(Solution(len(beat.tracks), beat.beats, beat.error) for beat in beats)
        return Observation(channels, reasons, solutions)

    def _seen(
        self, batch: Array, recording: Recording, beats: tuple[Beat, ...]
    ) -> tuple[npt.NDArray[np.complex128], Array, Array]:
        """What the cameras make of the beats: series [B, K + 1, C], instants [B, T] (s), what is added [B, T, C]."""
        names = [marker.name for marker in self.wing.markers]
        columns = [names.index(name) for name in recording.markers]
        series = np.stack([_series(beat.tracks[:, columns].reshape(len(beat.tracks), -1)) for beat in beats])
        times, added = np.tile(recording.times, (len(batch), 1)), np.zeros((len(batch), *recording.values.shape))
        effects = observed(self.chosen, self.genes, batch, "tracks")
        if effects:
            changed = [k for k, one in enumerate(batch) if observed(effects, self.genes, one[None], "tracks")]
            beat = np.stack([_on_grid(beats[k].tracks) for k in changed])
            sampling = Sampling(self.wing, recording, beat, times[changed], added[changed])
            apply(effects, self.genes, batch[changed], sampling)
            shown = sampling.beat[:, :, columns].reshape(*sampling.beat.shape[:2], -1)
            series[changed] = [_series(one) for one in shown]
            times[changed], added[changed] = sampling.times, sampling.added
        return series, times, added


def _on_grid(tracks: Array) -> Array:
    """Periodic tracks [n, M, 3] at _GRID equal steps, by the harmonics that are kept."""
    series = _series(tracks.reshape(len(tracks), -1))
    series[1:] *= 0.5
    return np.asarray(np.fft.irfft(series * _GRID, _GRID, axis=0)).reshape(_GRID, *tracks.shape[1:])


def _laid_over(series: npt.NDArray[np.complex128], psi: Array, recorded: Array) -> Array:
    """Values [T, C] of the series [K + 1, C] at phases ``psi`` [T], moved together to where they fit ``recorded`` best.

    Least squares in the common phase by Gauss-Newton; one step is exact to second order in a shift that noise makes
    about a thousandth of a radian. A shift beyond LARGEST_SHIFT is a misfit and not noise, and is left to be seen.
    """
    k = np.arange(len(series))
    turn = np.exp(1j * k * psi[:, None])
    for _ in range(2):
        values, slope = (turn @ series).real, (turn @ (1j * k[:, None] * series)).real
        difference = np.where(np.isfinite(recorded), values - recorded, 0.0)
        seen = np.where(np.isfinite(recorded), slope, 0.0)
        power = float((seen * seen).sum())
        shift = -float((seen * difference).sum()) / power if power > 0 else 0.0
        turn = turn * np.exp(1j * k * np.clip(shift, -LARGEST_SHIFT, LARGEST_SHIFT))
    return np.asarray((turn @ series).real)


def _series(samples: Array) -> npt.NDArray[np.complex128]:
    """Fourier series [_HARMONICS + 1, C] of periodic samples [n, C]: value(psi) = Re sum_k series_k exp(i k psi)."""
    n = len(samples)
    kept = min(_HARMONICS, (n - 1) // 2) + 1
    series = np.zeros((_HARMONICS + 1, samples.shape[1]), np.complex128)
    series[:kept] = np.fft.rfft(samples, axis=0)[:kept] / n
    series[1:] *= 2
    return series
