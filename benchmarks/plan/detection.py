"""Whether simulated recordings of a vehicle with a known effect agree with what a plan predicts of that effect.

The effect acts in a simulation with finer steps than the model's, at random sizes. The recordings have all random
errors of the balance, not those of the plan's noise model alone. Each is tested by likelihood ratios of nonlinear fits,
whose noise is estimated from the recordings themselves. The resonance of the balance, which enlarges forces by about a
per cent, is an effect of its own: it is left out, except in the draws that show what an unknown second effect does.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from scipy.stats import chi2

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.preparation import as_fitted
from wingfit.calibration.problem import base_genome
from wingfit.calibration.spec import CalibrationSpec
from wingfit.inference.campaign.noise_level import NoiseLevel
from wingfit.inference.design import detection_probability, odds_probability
from wingfit.inference.noise.mean_beat import fourier_basis
from wingfit.planning import PlanSpec
from wingfit.planning.effects import FALSE_ALARM, ODDS, Contrasts
from wingfit.planning.make import Making
from wingfit.planning.noise import noise_for
from wingfit.planning.rigs import BeatRig
from wingfit.records import Dataset, Gene, Recording, Vehicle
from wingfit.records.array_types import Array
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs import balance

EFFECTS = (
    "mass_offset", "stroke_amplitude", "stroke_bias", "wing_pitch_zero", "wing_pitch_amplitude", "airspeed_error",
    "body_pitch_error", "zero_lift_angle", "circulation_lag", "tip_loss",
)  # fmt: skip
SPREAD = 4.0  # sizes are drawn from 1 / SPREAD to SPREAD times the smallest that is detected, or distinguished
SETTINGS = balance.Balance(every=10, beats=28, decimals=4)
HARMONICS = 3  # that the filter of a calibration passes
CHOSEN = (1, 5, 6, 7)  # tests of the balance, with the coefficients of the first
CONFUSED = 0.999  # cosine: a pair beyond it is not drawn, since no size distinguishes it
PRIOR = 0.5


OnCase = Callable[[int], None]


@dataclass(frozen=True)
class Case:
    """One draw: the probability that the plan gives, and whether the recordings showed it."""

    what: str
    effect: str
    rival: str | None
    part: float
    predicted: float
    shown: bool

    @property
    def right(self) -> bool:
        """Whether the more probable outcome came true."""
        return (self.predicted >= 0.5) == self.shown


def cases(
    count: int, evaluator: Evaluator, seed: int = 11, *, resonance: bool = False, on_case: OnCase = lambda _: None
) -> list[Case]:
    """Draw ``count`` effects for a detection, and as many pairs that are to be distinguished.

    ``resonance``: whether the balance has its resonance, an effect that neither hypothesis contains.
    """
    settings = replace(SETTINGS, participation=SETTINGS.participation if resonance else 0.0)
    vehicle, rng = balance.delfly(), np.random.default_rng(seed)
    trials = [replace(balance.TRIALS[k], coefficients=balance.TRIALS[1].coefficients) for k in CHOSEN]
    truth = balance.DRAG | trials[0].coefficients
    plain = _recorded(vehicle, trials, truth, (), settings, rng)
    calibration = CalibrationSpec(axes=("x", "z"))
    spec = PlanSpec(calibration, EFFECTS, truth, add=0)
    making = Making("detection", BeatRig.of(Dataset("pilot", vehicle, plain), spec, evaluator), spec, None)
    making.plan()
    contrasts = making.contrasts
    found = list[Case]()
    for k in range(2 * count):
        on_case(k)
        suspect = contrasts.suspects[int(rng.integers(len(contrasts.suspects)))]
        others = [one.name for one in contrasts.suspects if one is not suspect]
        rivals = [name for name in others if contrasts.cosine(suspect.name, name) < CONFUSED]
        rival = None if k < count else rivals[int(rng.integers(len(rivals)))]
        distance = contrasts.distance(suspect.name, rival)
        part = float(np.sqrt(_typical_distance(contrasts, suspect.name, rival) / distance))
        part *= float(SPREAD ** rng.uniform(-1.0, 1.0))
        sizes = {name: part * suspect.typical[name] for name in suspect.size_genes}
        shape = {name: suspect.typical[name] for name in suspect.shape_genes}
        recordings = _recorded(vehicle, trials, truth | sizes | shape, (suspect.name,), settings, rng)
        test = _Test.of(vehicle, recordings, truth)
        if rival is None:
            level = FALSE_ALARM / len(contrasts.suspects)
            chance = detection_probability(distance * part**2, contrasts.freedom(suspect), level)
            gain = test.cost(()) - test.cost((suspect.name,))
            shown = gain > chi2.isf(level, contrasts.freedom(suspect))
            found.append(Case("detected", suspect.name, None, part, chance, bool(shown)))
        else:
            chance = odds_probability(distance * part**2, ODDS)
            odds = 0.5 * (test.cost((rival,)) - test.cost((suspect.name,)))
            found.append(Case("distinguished", suspect.name, rival, part, chance, bool(odds > np.log(ODDS))))
    return found


def _typical_distance(contrasts: Contrasts, name: str, rival: str | None) -> float:
    """Return the squared distance about which sizes are drawn: that of a probability of one half."""
    suspect = next(one for one in contrasts.suspects if one.name == name)
    level = FALSE_ALARM / len(contrasts.suspects)
    if rival is not None:
        return float(2.0 * np.log(ODDS))
    goal = scipy.optimize.brentq(lambda d: detection_probability(d, contrasts.freedom(suspect), level) - 0.5, 1e-6, 1e3)
    return float(goal)


def _recorded(
    vehicle: Vehicle,
    trials: Sequence[balance.Trial],
    values: dict[str, float],
    effects: tuple[str, ...],
    settings: balance.Balance,
    rng: np.random.Generator,
) -> tuple[Recording, ...]:
    """Simulate recordings of a vehicle with ``values`` of genes and with ``effects``, finely, on the balance."""
    model = BladeElementWing(vehicle, elements=balance.ELEMENTS, instants=balance.INSTANTS, effects=effects)
    genome = base_genome(model, values)
    beats = [np.asarray(model.beat([list(genome.values)], balance.blank_recording(one.condition))[0]) for one in trials]
    return tuple(balance.record(beat, one, settings, rng) for beat, one in zip(beats, trials, strict=True))


@dataclass(eq=False)
class _Test:
    """Fits models to the mean beats of recordings; cost: squared residuals over the noise, plus that of the prior."""

    vehicle: Vehicle
    recordings: tuple[Recording, ...]
    truth: dict[str, float]
    whitening: list[Array]
    projections: list[Array]

    @classmethod
    def of(cls, vehicle: Vehicle, raw: tuple[Recording, ...], truth: dict[str, float]) -> _Test:
        dataset = Dataset("test", vehicle, raw)
        noise = noise_for(dataset, raw, PlanSpec())
        spec = CalibrationSpec(axes=("x", "z"), mode="joint", method="gauss_newton")
        filtered = tuple(as_fitted(spec, one) for one in raw)
        whitening, projections, kept = list[Array](), list[Array](), list[Recording]()
        for one in filtered:
            inner = np.flatnonzero(one.valid.all(axis=1))
            part = replace(one, times=one.times[inner], values=one.values[inner])
            psi = 2 * np.pi * part.condition.flap_frequency * part.times
            project = np.asarray(np.linalg.pinv(fourier_basis(psi, HARMONICS)), float)
            mean = project @ part.values
            projections.append(project)
            kept.append(part)
            factor = np.linalg.cholesky(_covariance(noise, mean, project, part))
            whitening.append(np.asarray(np.linalg.solve(factor, np.eye(len(factor))), float))
        return cls(vehicle, tuple(kept), truth, whitening, projections)

    def cost(self, effects: tuple[str, ...]) -> float:
        """Return the least cost of the model with ``effects``, from their typical and from their zero sizes."""
        model = BladeElementWing(self.vehicle, effects=effects)
        base = base_genome(model, self.truth)
        free = [g for g in model.genes if g.name in ("C_l", "C_r", "C_F") or g.name.partition(".")[0] in effects]
        start = np.array([float(gene.to_unit(base[gene.name])) for gene in free])
        starts = [start] if not effects else []
        for side in (0.01, -0.01) if effects else ():
            other = start.copy()
            for k, gene in enumerate(free):
                if gene.nominal == 0.0:
                    other[k] = np.clip(other[k] + side, 0.001, 0.999)
            starts.append(other)
        return min(self._least(model, free, one) for one in starts)

    def _least(self, model: BladeElementWing, free: list[Gene], start: Array) -> float:
        names = [gene.name for gene in model.genes]
        base = np.array([base_genome(model, self.truth)[name] for name in names])
        columns = [names.index(gene.name) for gene in free]

        def residuals(unit: Array) -> Array:
            genome = base.copy()
            genome[columns] = [float(gene.from_unit(u)) for gene, u in zip(free, unit, strict=True)]
            parts = [(unit - 0.5) / PRIOR]
            for one, white, project in zip(self.recordings, self.whitening, self.projections, strict=True):
                channels = model.observe(genome[None], one).channels[0]
                parts.append(white @ (project @ (channels - one.values)).T.ravel())
            return np.concatenate(parts)

        inside = np.clip(start, 1e-6, 1 - 1e-6)
        found = scipy.optimize.least_squares(residuals, inside, bounds=(0.0, 1.0), diff_step=1e-4, max_nfev=12)
        return 2.0 * float(found.cost)


def _covariance(noise: NoiseLevel, mean: Array, project: Array, recording: Recording) -> Array:
    """Return the covariance of the coefficients of the mean beat [P, 2], x first, by the estimated noise."""
    beats = len(recording.times) * float(np.median(np.diff(recording.times))) * recording.condition.flap_frequency
    white = np.einsum("pt,qt->pq", project, project)
    total = np.kron(np.diag(noise.deviation**2), white)
    order = np.arange(1, HARMONICS + 1)
    late = np.zeros_like(mean)
    late[1 : 1 + HARMONICS] = 2 * np.pi * order[:, None] * mean[1 + HARMONICS :]
    late[1 + HARMONICS :] = -2 * np.pi * order[:, None] * mean[1 : 1 + HARMONICS]
    for shape, size in ((mean, noise.scatter_of_mean), (late, noise.timing)):
        column = shape.T.ravel() * size / np.sqrt(beats)
        total += np.outer(column, column)
    for axis in range(2):
        column = np.zeros_like(mean)
        column[0, axis] = noise.zero
        total += np.outer(column.T.ravel(), column.T.ravel())
    return np.asarray(total)
