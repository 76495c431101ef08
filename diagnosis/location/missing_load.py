"""Infer the missing load from the responses of the tracks to unit loads, by Bayesian linear inversion.

The model of a recording is y = H w + S g + noise: y recorded minus simulated by the nominal model; H the responses to
unit loads (a :class:`wingfit.sim.effects.probe.Probe`); w the sizes of these loads under this condition; S the
sensitivities to the nominal genes and g their errors, the same for all recordings. Tracks identify well when a load
acts and its moment about the root, but hardly its distribution along the span. So several kinds of load are considered,
smooth and localised, with free time courses. The evidence (MacKay, Neural Computation 4, 1992, Eqs. 2.8-2.14) gives the
probability of each kind and the strength of the load under each condition; results are averaged over the kinds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from wingfit.diagnosis.finding import Interval, MissingLoad, table
from wingfit.diagnosis.location.load_kinds import LoadForm, drive_errors, localised, smooth, spreads
from wingfit.records.array_types import Array, Float, Index, Int
from wingfit.sim.effects.probe import Probe

PHASES = 36  # instants of a beat at which loads are reported
GENE_ERROR_SD = 0.3  # standard deviation of the nominal genes' errors, unit coordinates
NONLINEARITY = 0.03  # of a response: the part that is not proportional to the load
MIN_EVIDENCE = 5.0  # log evidence relative to no load; below it there is none
_STRENGTHS = 10.0 ** np.arange(-3.0, 4.01, 0.125)  # N/m, or the unit of the responses
_MIN_RELATIVE_PROBABILITY = 0.005  # relative to the most probable kind; less probable kinds are ignored
_MAX_KINDS = 60  # that are averaged
RESPONSE_ERROR = 0.002  # of the evidence: error by inexact responses of the model, which may favour one kind of load
_DRAWS = 400
_SPAN = np.linspace(0.0, 1.0, 41)
MIN_PHASE_CONCENTRATION = 0.3  # length of the mean phase vector; below it the load is spread over the beat


@dataclass(frozen=True)
class Case:
    """One whitened recording: D Fourier coefficients, each divided by the standard deviation of its noise.

    Attributes:
        name: of the recording.
        residual: [D] recorded minus simulated by the refitted nominal model.
        responses: [D, P] change by a unit value of each of the P genes of the probe (unknown loads).
        sensitivities: [D, F] to the F nominal genes in unit coordinates (bounds at 0 and 1).
        crossing: drive phase (beats) at which the recorded beat starts.
    """

    name: str
    residual: Float[Array, " D"]
    responses: Float[Array, "D P"]
    sensitivities: Float[Array, "D F"]
    crossing: float


def whitened(values: Float[Array, "N C"], place: Int[Index, " N"], lag1: float) -> Float[Array, "N C"]:
    """Return ``values`` [N, C] without the correlation of their noise: lag1^d for rows whose ``place`` differs by d."""
    if not len(values):
        return values
    kept = lag1 ** np.diff(place)[:, None]
    return np.concatenate([values[:1], (values[1:] - kept * values[:-1]) / np.sqrt(1.0 - kept**2)])


@dataclass(frozen=True)
class LoadKind:
    """A kind of load (a shape along the span), its ``probability``, and the posterior under each of R conditions.

    ``sizes`` [R, P] and ``covariance`` [R, P, P] of the P genes of the probe. ``centre``, ``width`` (standard
    deviation) and ``chord`` (0 to 1) of localised loads; None for smooth loads, and ``chord`` for a probe without
    moments. ``drive_error``: additional rotations of the drive rods instead of a load.
    """

    probability: float
    centre: float | None
    width: float | None
    chord: float | None
    drive_error: bool
    sizes: Float[Array, "R P"]
    covariance: Float[Array, "R P P"]


@dataclass(frozen=True)
class InferredLoads:
    """Loads under each of R conditions.

    Attributes:
        probe: its unit loads.
        names: of the recordings.
        crossings: drive phase (beats) at which each recorded beat starts.
        kinds: of load, the most probable first.
        evidence: [R] log evidence for a load in this recording relative to none.
        floor: [R] factor by which the noise was raised to the residual that no load explains.
    """

    probe: Probe
    names: tuple[str, ...]
    crossings: tuple[float, ...]
    kinds: tuple[LoadKind, ...]
    evidence: Float[Array, " R"]
    floor: Float[Array, " R"]

    @property
    def drive_error(self) -> bool:
        """Whether an error of the drive rods, and no load, is inferred."""
        return self.kinds[0].drive_error

    def fields(
        self, span: Float[Array, " J"], phase: Float[Array, " N"]
    ) -> tuple[Float[Array, "R K N"], Float[Array, "R K N"]]:
        """Return forces (N/m) and standard errors, both [R, span, phase], at ``span`` (0 to 1) and ``phase`` (beats).

        For errors of the drive, the rotations of front and rear rod, deg, [R, 2, phase].
        """
        values, errors = [], []
        weight = np.array([kind.probability for kind in self.kinds])
        places = np.eye(2) if self.drive_error else self.probe.hats(span)
        for r, crossing in enumerate(self.crossings):
            basis = np.kron(places, self.probe.terms(phase + crossing))
            each = np.array([basis @ kind.sizes[r, self.reported] for kind in self.kinds])
            covariances = [kind.covariance[r, self.reported, self.reported] for kind in self.kinds]
            own = [np.einsum("np,pq,nq->n", basis, one, basis, optimize=True) for one in covariances]
            mean = weight @ each
            values.append(mean)
            errors.append(np.sqrt(weight @ (np.array(own) + (each - mean) ** 2)))
        shape = (len(self.names), len(places), len(phase))
        return np.reshape(values, shape), np.reshape(errors, shape)

    @property
    def reported(self) -> slice:
        """Which of the P genes of the probe are reported: forces, or rotations of the rods."""
        return slice(self.probe.loads, None) if self.drive_error else slice(0, self.probe.forces)

    @property
    def noise_inflation(self) -> float:
        """Mean square of the remaining residual divided by the noise variance; of two models the lower is better."""
        return float(np.mean(self.floor**2))


@dataclass(frozen=True)
class LoadPlace:
    """Where and when the missing load acts. Errors of the drive have a phase only.

    Attributes:
        span: centre (0 to 1) with 90 % interval; None where not known.
        extent: part of the span that holds 90 % of the load.
        phase: centre in the beat (0 to 1) with 90 % interval; None where the load is spread over the beat.
        duration: part of the beat that holds 90 % of the load above half of its maximum; may start below 0 or end
            beyond 1.
        chord: centre from the leading edge (0 to 1); None for a smooth load or a probe without moments.
    """

    span: Interval | None = None
    extent: tuple[float, float] = (0.0, 1.0)
    phase: Interval | None = None
    duration: tuple[float, float] = (0.0, 1.0)
    chord: Interval | None = None


class _NormalEquations:
    """Normal equations of one recording, its noise raised by ``floor`` to what loads and genes cannot explain."""

    def __init__(self, case: Case) -> None:
        H, S, y = case.responses, case.sensitivities, case.residual
        both = np.concatenate([H, S], axis=1)
        remainder = y - both @ np.linalg.lstsq(both, y, rcond=1e-8)[0]
        size, left_over = both.shape[1], float(remainder @ remainder)
        explained = max(float(y @ y) - left_over - size, 0.0) / size  # mean square in directions of loads and genes
        self.floor = float(np.sqrt(max(1.0, left_over / max(len(y) - size, 1)) + NONLINEARITY**2 * explained))
        scale = self.floor**-2
        self.A, self.B, self.C = scale * (H.T @ H), scale * (H.T @ S), scale * (S.T @ S)
        self.h, self.s = scale * (H.T @ y), scale * (S.T @ y)
        genes = np.linalg.inv(self.C + np.eye(len(self.C)) / GENE_ERROR_SD**2)
        self.load_information = self.A - self.B @ genes @ self.B.T
        self.load_score = self.h - self.B @ genes @ self.s

    def evidence(self, shapes: Sequence[Array], spread: Array) -> Array:
        """Return the log evidence of K kinds of load relative to no load, [K, strengths], for each of _STRENGTHS.

        ``shapes``: of each kind, [Z, stations]. A load of this kind is the sum of its Z shapes times independent normal
        numbers for each of M terms of the beat, with standard deviations ``spread`` [M] times the strength.
        """
        return np.concatenate(
            [self._evidence(np.array(list(alike)), spread) for _, alike in groupby(shapes, key=len)]
            or [np.zeros((0, len(_STRENGTHS)))]
        )

    def _evidence(self, shapes: Array, spread: Array) -> Array:
        M = len(spread)
        Q = len(self.load_score) // M
        inner = self.load_information.reshape(Q, M, Q, M).transpose(0, 2, 1, 3).reshape(Q * Q, M * M)
        K, Z = shapes.shape[:2]
        pairs = np.einsum("kyq,kzr->kyzqr", shapes, shapes).reshape(K * Z * Z, Q * Q)
        blocks = (pairs @ inner).reshape(K, Z, Z, M, M).transpose(0, 1, 3, 2, 4)
        whole = (blocks * spread[:, None, None] * spread).reshape(K, Z * M, Z * M)
        along = ((shapes @ self.load_score.reshape(Q, M)) * spread).reshape(K, 1, Z * M)
        size, turn = np.linalg.eigh(whole)
        power = np.maximum(size, 0.0)[:, None, :] * _STRENGTHS[:, None] ** 2
        along = (along @ turn) * _STRENGTHS[:, None]
        return np.asarray(0.5 * (along**2 / (1.0 + power) - np.log1p(power)).sum(axis=2))


def infer(
    cases: Sequence[Case],
    probe: Probe,
    chord: Float[Array, " J"] | None = None,
    response_error: float = RESPONSE_ERROR,
) -> InferredLoads:
    """Infer the loads of ``cases``, which share the nominal genes; ValueError where there is none.

    Averages over kinds of load; errors of the drive are reported only where no load explains as much. ``chord``
    [stations] (m) of the wing, for a probe with moments; ``response_error``: fraction of the evidence that errors of
    the simulated responses may produce.
    """
    if not cases:
        raise ValueError("no recording to infer a load from; give at least one")
    if probe.turning and (chord is None or len(chord) != len(probe.stations)):
        raise ValueError(f"a probe with moments needs the chord at each of its {len(probe.stations)} stations")
    normals = [_NormalEquations(case) for case in cases]
    families = [smooth(probe, chord), localised(probe, chord), drive_errors(probe)]
    forms = [
        LoadForm(family, k, spread) for family in families for spread in spreads(probe) for k in range(len(family))
    ]
    evidence = np.array(
        [
            np.concatenate([normal.evidence(family.shapes, s) for family in families for s in spreads(probe)])
            for normal in normals
        ]
    ).transpose(1, 0, 2)  # [forms, R, strengths]
    best = evidence.max(axis=2)
    total = best.sum(axis=1) + np.log([form.family.share / len(spreads(probe)) for form in forms])
    weight = np.exp((total - total.max()) / max(response_error * float(total.max()), 1.0))
    driving = np.array([form.family.drive_error for form in forms])
    weight[driving != driving[np.argmax(total)]] = 0.0  # loads that imitate rods are huge ones at the root
    kept = [int(k) for k in np.argsort(-weight)[:_MAX_KINDS] if weight[k] >= _MIN_RELATIVE_PROBABILITY]
    kinds = []
    for k in kept:
        family, number, _ = form = forms[k]
        strengths = _STRENGTHS[evidence[k].argmax(axis=1)]
        solved = _posterior(normals, [strength * form.root for strength in strengths])
        kinds.append(
            LoadKind(float(weight[k] / weight[kept].sum()), *family.places[number], family.drive_error, *solved)
        )
    return InferredLoads(
        probe,
        tuple(case.name for case in cases),
        tuple(case.crossing for case in cases),
        tuple(kinds),
        best[kept[0]],
        np.array([normal.floor for normal in normals]),
    )


def _posterior(normals: Sequence[_NormalEquations], roots: Sequence[Array]) -> tuple[Array, Array]:
    """Return the loads [R, P] of R recordings and their covariance [R, P, P], with free genes.

    ``roots``: for each recording a square root [P, Q] of the prior covariance of its loads, which are eliminated first.
    """
    F = len(normals[0].s)
    precision, slope = np.eye(F) / GENE_ERROR_SD**2, np.zeros(F)
    inner = []
    for one, root in zip(normals, roots, strict=True):
        V = root @ np.linalg.solve(np.eye(root.shape[1]) + root.T @ one.A @ root, root.T)
        inner.append(V)
        precision = precision + one.C - one.B.T @ V @ one.B
        slope = slope + one.s - one.B.T @ V @ one.h
    spread = np.linalg.inv(precision)
    genes = spread @ slope
    sizes = [V @ (one.h - one.B @ genes) for one, V in zip(normals, inner, strict=True)]
    covariance = [V + V @ one.B @ spread @ one.B.T @ V for one, V in zip(normals, inner, strict=True)]
    return np.array(sizes), np.array(covariance)


def missing_loads(inferred: InferredLoads) -> tuple[MissingLoad, ...]:
    """Return the load in each recording at the probe's stations and PHASES instants from the start of the beat.

    For errors of the drive, the additional rotation of each rod, rad.
    """
    phase, stations = np.arange(PHASES) / PHASES, inferred.probe.stations
    values, errors = inferred.fields(np.array(stations), phase)
    at = tuple(phase.tolist())
    if not inferred.drive_error:
        every = zip(inferred.names, values, errors, strict=True)
        return tuple(MissingLoad(name, stations, at, table(v), table(e), "N/m") for name, v, e in every)
    values, errors = np.radians(values), np.radians(errors)
    return tuple(
        MissingLoad(name, (0.0,), at, table(v[k : k + 1]), table(e[k : k + 1]), "rad", rod)
        for k, rod in enumerate(("front", "rear"))
        if values[:, k].any()
        for name, v, e in zip(inferred.names, values, errors, strict=True)
    )


def locate_load(inferred: InferredLoads, seed: int = 0) -> LoadPlace | None:
    """Return where and when the load acts, over all recordings with a load (MIN_EVIDENCE); None where there is none.

    Computed from posterior draws with the random ``seed``. The centre in the beat is that of the load above half of its
    maximum.
    """
    shown = np.flatnonzero(inferred.evidence > MIN_EVIDENCE)
    if not len(shown):
        return None
    rng = np.random.default_rng(seed)
    phase = np.arange(2 * PHASES) / (2 * PHASES)
    draws = rng.multinomial(_DRAWS, [kind.probability for kind in inferred.kinds])
    along, during, chords = [], [], list[float]()
    for kind, count in zip(inferred.kinds, draws, strict=True):
        if not count:
            continue
        fields = _posterior_draws(inferred, kind, shown, phase, int(count), rng)
        if kind.centre is not None and kind.width is not None:
            bump = np.exp(-0.5 * ((_SPAN - kind.centre) / kind.width) ** 2)
            along.append(np.tile(bump, (count, 1)))
        elif not kind.drive_error:
            along.append(np.abs(fields).sum(axis=(0, 3)))
        over = fields - fields.mean(axis=3, keepdims=True) if kind.drive_error else fields.sum(axis=2, keepdims=True)
        during.append(np.abs(over).sum(axis=(0, 2)))
        chords += [kind.chord] * int(count) if kind.chord is not None else []
    if inferred.drive_error:
        return LoadPlace(None, (0.0, 1.0), *_phase_location(phase, np.concatenate(during)))
    span, extent = _span_location(np.concatenate(along))
    localised, chord = [kind for kind in inferred.kinds if kind.centre is not None], None
    if sum(kind.probability for kind in localised) > 0.5:  # the mean over all locations would lie between root and tip
        span = _with_interval(localised[0].centre, span)
        if chords:
            chord = _with_interval(localised[0].chord, Interval(*np.quantile(chords, [0.5, 0.05, 0.95]).tolist()))
    return LoadPlace(span, extent, *_phase_location(phase, np.concatenate(during)), chord)


def _with_interval(value: float | None, draws: Interval) -> Interval:
    """Return ``value`` with the interval of ``draws``, extended to contain it; ``draws`` where there is no value."""
    if value is None or draws.low is None or draws.high is None:
        return draws
    return Interval(value, min(draws.low, value), max(draws.high, value))


def _posterior_draws(
    inferred: InferredLoads,
    kind: LoadKind,
    shown: Index,
    phase: Array,
    count: int,
    rng: np.random.Generator,
) -> Array:
    """Return ``count`` draws of the loads [shown, count, span, phase] in the recordings ``shown``.

    Each is divided by its root mean square. For errors of the drive the shape is [shown, count, 2, phase].
    """
    places, found = np.eye(2) if kind.drive_error else inferred.probe.hats(_SPAN), []
    for r in shown:
        size, turn = np.linalg.eigh(kind.covariance[r])
        off = rng.standard_normal((count, len(size))) * np.sqrt(np.maximum(size, 0.0))
        sizes = (kind.sizes[r] + off @ turn.T)[:, inferred.reported].reshape(count, places.shape[1], -1)
        series = inferred.probe.terms(phase + inferred.crossings[r])
        field = np.einsum("sj,cjk,pk->csp", places, sizes, series, optimize=True)
        found.append(field / np.sqrt(np.mean(field**2, axis=(1, 2), keepdims=True)))
    return np.array(found)


def _span_location(size: Array) -> tuple[Interval, tuple[float, float]]:
    """Return the centre, with 90 % interval, of loads of ``size`` [draws, span], and the range of 90 % of them."""
    share = size / size.sum(axis=1, keepdims=True)
    centre = np.quantile(share @ _SPAN, [0.5, 0.05, 0.95])
    total = np.cumsum(share.mean(axis=0))
    first, last = np.interp([0.05, 0.95], total, _SPAN)
    return Interval(*centre.tolist()), (float(first), float(last))


def _phase_location(phase: Array, size: Array) -> tuple[Interval | None, tuple[float, float]]:
    """Return the centre in the beat, with 90 % interval, of loads of ``size`` [draws, phase], and the range of 90 %.

    The centre is None, and the range the whole beat, for loads that are spread over the beat.
    """
    peak = np.where(size > 0.5 * size.max(axis=1, keepdims=True), size, 0.0)
    turns = peak @ np.exp(2j * np.pi * phase) / peak.sum(axis=1)
    middle = turns.mean()
    if np.abs(middle) < MIN_PHASE_CONCENTRATION:
        return None, (0.0, 1.0)
    centre = float(np.angle(middle) / (2 * np.pi)) % 1.0
    off = np.quantile(np.angle(turns / middle) / (2 * np.pi), [0.05, 0.95])
    apart = (phase - centre + 0.5) % 1.0 - 0.5
    order = np.argsort(apart)
    total = np.cumsum((peak / peak.sum(axis=1, keepdims=True)).mean(axis=0)[order])
    first, last = np.interp([0.05, 0.95], total, apart[order])
    low, high, start, end = (centre + float(one) for one in (*off, first, last))
    return Interval(centre, low, high), (start, end)
