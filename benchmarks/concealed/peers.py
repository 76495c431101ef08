"""Two general methods applied to the same blind trials for comparison: sparse regression and a Gaussian process.

Both get the input of a diagnosis: the residual of the refitted nominal model, and the change that each effect of the
library (the effects that a diagnosis can name) makes to the recordings. pysindy (de Silva et al. 2020; Kaptanoglu et
al. 2022) is used as documented: sequentially thresholded least squares with a cross-validated threshold. scikit-learn's
Gaussian process models the discrepancy (Kennedy and O'Hagan 2001): it can detect and predict missing physics, but not
name it.
"""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from pysindy import STLSQ
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from benchmarks.concealed.answer import Answer
from benchmarks.concealed.run_diagnosis import Task
from benchmarks.concealed.score import WORSE, Mark, blank, side_of
from benchmarks.concealed.strength import Refit, rms, stacked
from wingfit.calibration.spec import CalibrationSpec, model_for
from wingfit.diagnosis.rigs import subject_of
from wingfit.records import Recording, load_dataset, wing_or_vehicle
from wingfit.rigs.suspect import Suspect
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]

NUDGE = 0.3  # fraction of an effect's typical size at which its feature is evaluated
THRESHOLDS = (0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # of a coefficient, as fractions of the residual's norm
POINTS = 400  # samples that the Gaussian process is conditioned on; its cost grows with their cube
ROUNDS = 2  # of the refit; each computes a new Jacobian


@dataclass(frozen=True)
class PeerOutcome:
    """Result of a comparison method (``peer``) on one trial.

    ``detected``: whether the method detected missing physics; ``named``: effects with non-zero weights, largest first;
    ``before``, ``after``: RMS misfit to the held-out recordings without and with the method's correction, m or N.
    """

    peer: str
    trial: str
    detected: bool
    named: tuple[str, ...]
    before: float
    after: float
    seconds: float


@dataclass(frozen=True)
class Material:
    """Input of the comparison methods.

    Attributes:
        residual: [D] recorded minus simulated value of the refitted nominal model at the D valid samples of the fitted
            recordings, m or N.
        features: [D, E] change of these samples by each of E sizes of effects. ``residual`` and ``features`` are
            projected on the orthogonal complement of the changes that the nominal model's parameters can make.
        owner: [D] number of each sample's recording.
        names: [E] effect of each feature.
        left_out, left_out_features: [H], [H, E] residual and features at the H valid samples of the held-out
            recordings, not projected.
        places, left_out_places: [D, 8], [H, 8] phase, channel and condition of each sample, as from :func:`_places`.
    """

    residual: Array
    features: Array
    owner: npt.NDArray[np.intp]
    names: tuple[str, ...]
    left_out: Array
    left_out_features: Array
    places: Array
    left_out_places: Array


def run(task: Task) -> tuple[PeerOutcome, PeerOutcome]:
    """Results of sparse regression and of a Gaussian process on the dataset of ``task``, computed in this process."""
    material, start = gathered(task), time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # optimisers that reach their last iteration
        sparse = sparse_regression(task.trial, material)
        middle = time.perf_counter()
        process = gaussian_process(task.trial, material)
    return replace(sparse, seconds=middle - start), replace(process, seconds=time.perf_counter() - middle)


def gathered(task: Task) -> Material:
    """Refit the nominal model to the dataset of ``task``, and compute the input of both comparison methods."""
    dataset = wing_or_vehicle(load_dataset(task.dataset))
    spec = CalibrationSpec(without=task.without)
    spec = replace(spec, division=task.division) if task.division else spec
    model, fitted = model_for(dataset, spec), dataset.fitted
    held_out = dataset.select(dataset.held_out)
    refit = Refit(model, {gene.name: gene.nominal for gene in model.genes}, fitted)
    unit, residual = refit.refitted(stacked(fitted), ROUNDS)
    values = {g.name: float(g.from_unit(u)) for g, u in zip(refit.genes, np.clip(unit, 0.0, 1.0), strict=True)}
    suspects = subject_of(dataset, spec).suspects
    there = replace(refit, start={**refit.start, **values})
    if isinstance(model, FlexibleWing):  # starting from a known periodic motion is faster
        there = replace(there, model=model.beside([there.start[gene.name] for gene in model.genes]))
    names, seen = features(there, suspects, dataset.recordings)
    split = len(residual)
    order = np.concatenate([stacked(fitted), stacked(held_out)])
    other = stacked(held_out) - Refit(model, there.start, held_out).nominal
    known = np.isfinite(-residual)
    basis, _ = np.linalg.qr(there.tangent[known])
    own, changes = -residual[known], seen[:split][known]
    later = np.isfinite(order[split:])
    coordinates = np.concatenate([_places(one) for one in (*fitted, *held_out)])
    owner = np.repeat(np.arange(len(fitted)), [one.values.size for one in fitted])[known]
    return Material(
        own - basis @ (basis.T @ own),
        changes - basis @ (basis.T @ changes),
        owner,
        names,
        other[later],
        seen[split:][later],
        coordinates[:split][known],
        coordinates[split:][later],
    )


def features(
    refit: Refit, suspects: tuple[Suspect, ...], recordings: tuple[Recording, ...]
) -> tuple[tuple[str, ...], Array]:
    """Features of the effects ``suspects``: effect name of each column, and the columns [D, E].

    A column is the change of all recorded values (fitted recordings first, m or N) by NUDGE times the typical value of
    one of the effect's size parameters. Effects that cannot be simulated are omitted.
    """
    ordered = (*refit.recordings, *(one for one in recordings if one.name not in {r.name for r in refit.recordings}))
    names, columns = [], []
    for suspect in suspects:
        model = refit.model.with_effects(suspect.name)  # type: ignore[attr-defined]
        base = np.array([refit.start.get(gene.name, suspect.typical.get(gene.name, 0.0)) for gene in model.genes])
        index = {gene.name: k for k, gene in enumerate(model.genes)}
        base[[index[size] for size in suspect.size_genes]] = 0.0
        batch = np.tile(base, (1 + len(suspect.size_genes), 1))
        for k, size in enumerate(suspect.size_genes, 1):
            batch[k, index[size]] = NUDGE * suspect.typical[size]
        found = [model.observe(batch, one) for one in ordered]
        if any(reason for one in found for reason in one.reasons):
            continue
        channels = np.concatenate([one.channels.reshape(len(batch), -1) for one in found], axis=1)
        columns += list(channels[1:] - channels[0])
        names += [suspect.name] * len(suspect.size_genes)
    return tuple(names), np.array(columns).T


def _places(recording: Recording) -> Array:
    """Input coordinates [T C, 8] of the Gaussian process at each of T times C samples: phase, channel and condition."""
    condition, channels = recording.condition, recording.values.shape[1]
    angle = 2 * np.pi * condition.flap_frequency * recording.times
    when = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    width = 3 if recording.kind == "tracks" else 1
    which = np.stack([np.arange(channels) // width / max(channels // width, 1), np.arange(channels) % width], axis=1)
    under = [condition.flap_frequency / 10, condition.phase_lag * 8, condition.pressure / 1e5, condition.airspeed / 5]
    return np.hstack([
        np.repeat(when, channels, axis=0),
        np.tile(which, (len(when), 1)),
        np.tile(under, (len(when) * channels, 1)),
    ])  # fmt: skip


def sparse_regression(trial: str, material: Material) -> PeerOutcome:
    """Fit the residual by sequentially thresholded least squares on the features (pysindy).

    The threshold is chosen by cross-validation, leaving one recording out at a time.
    """
    norms = np.linalg.norm(material.features, axis=0)
    usable = norms > 1e-3 * norms.max()
    names = [name for name, use in zip(material.names, usable, strict=True) if use]
    size = max(float(np.linalg.norm(material.residual)), 1e-300)
    x, y = material.features[:, usable] / norms[usable], material.residual / size
    errors = []
    for threshold in THRESHOLDS:
        lost = 0.0
        for one in np.unique(material.owner):
            out = material.owner == one
            weights = _thresholded(x[~out], y[~out], threshold)
            lost += float(((y[out] - x[out] @ weights) ** 2).sum())
        errors.append(lost)
    nothing = float((y**2).sum())
    best = int(np.argmin(errors))
    weights = _thresholded(x, y, THRESHOLDS[best]) if errors[best] < nothing else np.zeros(len(names))
    found = [names[k] for k in np.argsort(-np.abs(weights)) if weights[k]]
    predicted = material.left_out_features[:, usable] / norms[usable] @ weights * size
    return PeerOutcome(
        "pysindy", trial, bool(found), tuple(dict.fromkeys(found)), rms(material.left_out),
        rms(material.left_out - predicted), 0.0,
    )  # fmt: skip


def _thresholded(x: Array, y: Array, threshold: float) -> Array:
    found = STLSQ(threshold=threshold, alpha=1e-4, unbias=True).fit(x, y[:, None])
    return np.asarray(found.coef_, float).reshape(-1)


def gaussian_process(trial: str, material: Material) -> PeerOutcome:
    """Fit the residual by a Gaussian process of phase, channel and condition; detected if better by BIC than noise."""
    rng = np.random.default_rng(len(material.residual))
    some = rng.permutation(len(material.residual))[:POINTS]
    size = rms(material.residual) or 1.0
    x, y = material.places[some], material.residual[some] / size
    kernel = ConstantKernel(0.5) * RBF(np.ones(x.shape[1]), (0.05, 1e3)) + WhiteKernel(0.5, (1e-4, 10.0))
    process = GaussianProcessRegressor(kernel, random_state=0).fit(x, y)
    white = -0.5 * len(y) * (np.log(2 * np.pi * float(y @ y) / len(y)) + 1)
    gain = float(process.log_marginal_likelihood_value_) - white
    detected = gain > 0.5 * (x.shape[1] + 1) * np.log(len(y))
    predicted = process.predict(material.left_out_places) * size if detected else 0.0
    return PeerOutcome(
        "gaussian process", trial, bool(detected), (), rms(material.left_out), rms(material.left_out - predicted), 0.0
    )


def mark(outcome: PeerOutcome, answer: Answer) -> Mark:
    """Score the result of a comparison method by the rules of a diagnosis; without places and intervals."""
    verdict = "adequate" if not outcome.detected else "named" if outcome.named else "unnamed"
    plain = replace(blank(answer, verdict), alarm=outcome.detected, named=outcome.named, top=outcome.named[:1])
    held_out, worse = outcome.after / answer.noise_held_out, outcome.after > WORSE * outcome.before
    plain = replace(plain, wrong=not set(outcome.named) <= answer.names, held_out=held_out, worse=worse)
    if not answer.secrets:
        return plain
    named = set(outcome.named)
    sides = {side_of(name) for name in named}
    return replace(
        plain,
        first=set(outcome.named[: len(answer.names)]) == answer.names,
        exact=named == answer.names,
        found=len(named & answer.names),
        right_side=len(sides) == 1 and all(secret.side in sides for secret in answer.secrets),
    )
