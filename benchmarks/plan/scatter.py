"""Standard errors of plans over the scatter of the estimates of many simulated campaigns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.calibration.estimates.likelihood import iterate
from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.preparation import as_fitted
from wingfit.calibration.problem import Problem, base_genome
from wingfit.calibration.spec import CalibrationSpec, resolved
from wingfit.planning import PlanSpec, plan_dataset
from wingfit.records import Dataset, Recording
from wingfit.records.array_types import Array
from wingfit.sim.model import Model
from wingfit.sim.virtual_rigs import balance, campaign
from wingfit.sim.wing.flexible_wing import FlexibleWing

BEATS = {"long": 28, "short": 10}
WING_GENES = ("E_f", "E_r", "G_f", "D_E", "D_G", "L_a", "L_b", "ID_a")
WING_DESIGNS = {
    "three in vacuum, three in the tunnel": (0, 1, 2, 5, 6, 7),
    "one in vacuum, one in the tunnel": (2, 7),
}
Simulate = Callable[[int], tuple[Recording, ...]]
OnCampaign = Callable[[str], None]


@dataclass(frozen=True)
class Compared:
    """One gene in one design: standard error of the plan, and scatter and bias of the estimates, in its unit."""

    rig: str
    design: str
    noise: str
    gene: str
    predicted: float
    scatter: float
    bias: float

    @property
    def ratio(self) -> float:
        """Predicted standard error over scatter."""
        return self.predicted / self.scatter


def vehicles(count: int, evaluator: Evaluator, on_campaign: OnCampaign) -> list[Compared]:
    """Compare plans with ``count`` recordings of each test of the balance, and of three that are fitted together."""
    found, vehicle = list[Compared](), balance.delfly()
    for trial in balance.TRIALS:
        beat = balance.true_beat(vehicle, trial)
        length = "long" if int(trial.name[-1]) % 2 else "short"
        settings = balance.Balance(every=10, beats=BEATS[length], decimals=4)

        def simulate(seed: int, beat: Array = beat, trial: balance.Trial = trial, s: balance.Balance = settings):  # type: ignore[no-untyped-def]
            return (balance.record(beat, trial, s, np.random.default_rng([seed, 71])),)

        truth = balance.DRAG | trial.coefficients
        found += _compared("vehicle", f"{trial.name}, {length}", vehicle, simulate, truth, count, evaluator)
        on_campaign(trial.name)
    together = [replace(one, coefficients=balance.TRIALS[3].coefficients) for one in balance.TRIALS[2:8:2]]
    beats = [balance.true_beat(vehicle, one) for one in together]
    settings = balance.Balance(every=10, beats=BEATS["short"], decimals=4)

    def joint(seed: int) -> tuple[Recording, ...]:
        rng = np.random.default_rng([seed, 72])
        return tuple(balance.record(b, t, settings, rng) for b, t in zip(beats, together, strict=True))

    truth = balance.DRAG | together[0].coefficients
    found += _compared("vehicle", "three together, short", vehicle, joint, truth, count, evaluator)
    on_campaign("three together")
    return found


def wings(count: int, evaluator: Evaluator, on_campaign: OnCampaign) -> list[Compared]:
    """Compare plans with ``count`` campaigns of a wing of four bodies, for each of WING_DESIGNS."""
    found, wing = list[Compared](), campaign.robird_wing()
    exact = FlexibleWing(wing, "4", numerics=campaign.REFERENCE)
    truth = campaign.true_genome(exact, 5)
    for design, chosen in WING_DESIGNS.items():
        conditions = [campaign.SMALL[k][0] for k in chosen]
        known = _Known(exact, np.array(truth.values))

        def simulate(seed: int, conditions=conditions, known=known):  # type: ignore[no-untyped-def]
            rng = np.random.default_rng([seed, 73])
            return tuple(campaign.record(known, truth, one, campaign.Tracking(), rng) for one in conditions)

        found += _compared("wing", design, wing, simulate, truth.as_dict(), count, evaluator)
        on_campaign(design)
    return found


class _Known:
    """The true wing, each beat of which is simulated once."""

    def __init__(self, model: FlexibleWing, genome: Array) -> None:
        self.model, self.wing = model, model.wing
        self.genome = genome
        self.beats = dict[str, object]()

    def beat(self, genome: Array, blank: Recording) -> object:
        del genome
        key = campaign.name_of(blank.condition)
        if key not in self.beats:
            self.beats[key] = self.model.beat(self.genome, blank)
        return self.beats[key]


def _compared(
    kind: str,
    design: str,
    rig: object,
    simulate: Simulate,
    truth: dict[str, float],
    count: int,
    evaluator: Evaluator,
) -> list[Compared]:
    """Plan with stated noise and with that of the first campaign; estimate ``count`` campaigns; compare."""
    wing = kind == "wing"
    spec = CalibrationSpec(division="4", genes=WING_GENES) if wing else CalibrationSpec()
    first = Dataset(design, rig, simulate(0))  # type: ignore[arg-type]
    blank = replace(
        first, recordings=tuple(replace(r, values=np.full_like(r.values, np.nan)) for r in first.recordings)
    )
    frames = 31 if wing else round(np.median([1250.0 / r.condition.flap_frequency for r in first.recordings]))
    beats = round(len(first.recordings[0].times) / frames)
    own = {"noise_mm": 1e3 * float(np.sqrt(np.mean(np.square(campaign.Tracking().noise)))), "correlation": 0.6}
    plans = {
        "stated": plan_dataset(
            blank,
            PlanSpec(
                spec,
                None,
                truth,
                beats=beats,
                frames=frames,
                add=0,
                markers=40 if wing else None,
                **(own if wing else {}),
            ),
            evaluator,
        ),
        "seen": plan_dataset(first, PlanSpec(spec, None, truth, add=0), evaluator),
    }
    ready = resolved(replace(spec, mode="joint", method="gauss_newton"), first)
    model = _model(first, ready)
    estimates = list[list[float]]()
    for seed in range(1, count + 1):
        recordings = tuple(as_fitted(ready, one) for one in simulate(seed))
        free = tuple(one.name for one in plans["seen"].genes)
        base = base_genome(model, truth)
        problem = Problem(model, recordings, free, base, () if wing else ready.axes)
        *_, last = iterate(problem, evaluator, truth)
        estimates.append([last.values[name] for name in free])
    values = np.array(estimates)
    return [
        Compared(
            kind,
            design,
            noise,
            gene.name,
            gene.standard_error,
            float(values[:, k].std(ddof=1)),
            float(values[:, k].mean() - truth[gene.name]),
        )
        for noise, plan in plans.items()
        for k, gene in enumerate(plan.genes)
    ]


def _model(dataset: Dataset, spec: CalibrationSpec) -> Model:
    from wingfit.calibration.spec import model_for

    return model_for(dataset, spec)


def ratios(found: Sequence[Compared]) -> Array:
    """Return the ratios of all genes."""
    return np.array([one.ratio for one in found])
