"""The flexible wing as a model: genomes in, marker tracks out, sampled and aligned like a recording."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from records import Gene, Recording, Wing
from sim.alignment import REFERENCE_HARMONICS, recorded_crossing, reference_columns, upstroke_crossing
from sim.division import Division
from sim.model import Observation, Solution, genome_batch
from sim.numerics import Numerics
from sim.simulate import Beat, periodic_beats
from sim.structure import Structure, build
from sim.wing_genes import FACTOR, wing_genes

Array = npt.NDArray[np.float64]

LARGEST_SHIFT = 0.05  # rad, about 3 degrees of the beat
_HARMONICS = 30  # of the periodic tracks that are kept; the rest is below the integrator's error


@dataclass(frozen=True)
class FlexibleWing:
    """Multi-body wing driven by two rods (thesis III) for markers seen by cameras.

    ``division`` as :meth:`sim.division.Division.parse` reads it; genes are bounded by ``bounds_factor`` around the
    wing's estimates.
    """

    wing: Wing
    division: str = "11"
    bounds_factor: float = FACTOR
    numerics: Numerics = field(default_factory=Numerics)

    def __getstate__(self) -> dict[str, object]:
        """Pickle the definition only; whatever was built from it is built again."""
        return {name: self.__dict__[name] for name in ("wing", "division", "bounds_factor", "numerics")}

    @cached_property
    def genes(self) -> tuple[Gene, ...]:
        """Structural genes (thesis Eq. 18), then aerodynamic ones (Eq. 19)."""
        return wing_genes(self.wing.estimates, self.bounds_factor)

    @property
    def searched(self) -> tuple[str, ...]:
        """All genes."""
        return tuple(gene.name for gene in self.genes)

    @cached_property
    def structure(self) -> Structure:
        """Bodies and connectors."""
        return build(self.wing, Division.parse(self.division))

    def beats(self, genomes: npt.ArrayLike, recording: Recording, *, with_motion: bool = False) -> tuple[Beat, ...]:
        """One periodic beat of each of ``genomes`` [B, G] under the recording's condition, with loads and energies."""
        batch = genome_batch(self.genes, genomes)
        return periodic_beats(
            self.structure, self.genes, batch, recording.condition, self.numerics, with_motion=with_motion
        )

    def beat(self, genome: npt.ArrayLike, recording: Recording, *, with_motion: bool = False) -> Beat:
        """The same for a single genome [G]."""
        (found,) = self.beats(np.asarray(genome, float)[None], recording, with_motion=with_motion)
        return found

    def observe(self, genomes: npt.ArrayLike, recording: Recording) -> Observation:
        """Tracks [B, T, C] of ``genomes`` [B, G] at the recording's frames.

        Beats are aligned by the upstroke crossing; what tracking noise leaves of a phase error is then fitted, the
        trigger of the cameras being unknown (docs/decisions/0001).
        """
        beats = self.beats(genomes, recording)
        names = [marker.name for marker in self.wing.markers]
        columns = [names.index(name) for name in recording.markers]
        series = np.stack([_series(beat.tracks[:, columns].reshape(len(beat.tracks), -1)) for beat in beats])
        height = np.mean([series[:, :, 3 * c + 2] for c in reference_columns(self.wing, recording)], axis=0)
        own = upstroke_crossing(height[:, : REFERENCE_HARMONICS + 1], self.wing.hinge.z)
        psi = 2 * np.pi * recording.condition.flap_frequency * recording.times
        since = psi - recorded_crossing(self.wing, recording)
        reasons = tuple(
            beat.reason or (None if np.isfinite(phase) else "the reference markers never cross the hinge height")
            for beat, phase in zip(beats, own, strict=True)
        )
        channels = np.stack([_laid_over(s, since + p, recording.values) for s, p in zip(series, own, strict=True)])
        solutions = tuple(Solution(len(beat.tracks), beat.beats, beat.error) for beat in beats)
        return Observation(channels, reasons, solutions)


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
