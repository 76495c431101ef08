"""The result of a diagnosis: plain data from which the report is drawn.

Lengths in m, forces in N, angles in rad, phases in beats (0 to 1, from the start of the beat as the dataset defines
it), locations on a wing from 0 to 1 along the span (root to tip) and the chord (leading to trailing edge).
``unit`` is that of a channel: "m" for tracks, "N" for forces; all misfits are root mean squares of one channel in it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from wingfit.records.array_types import Array, Float

Verdict = Literal["adequate", "named", "ambiguous", "unnamed", "measurement fault"]
VERDICTS: tuple[Verdict, ...] = ("adequate", "named", "ambiguous", "unnamed", "measurement fault")
Numbers = tuple[float, ...]
Table = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Interval:
    """A value with a 90 % interval; ``low`` and ``high`` are None where the data do not bound it."""

    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Floors:
    """The smallest misfit that can be expected.

    Attributes:
        noise: root mean square of the measurement noise, from the scatter between beats.
        lag1_autocorrelation: of the noise, between successive samples.
        discretisation: misfit by the model's discretisation, from a comparison with a finer one; at most the residual;
            None where there is no finer one.
        finer: the discretisation that it was compared with.
        simulation: misfit below which no model is required to be: a tenth of the noise.
        total: root of the sum of squares of these, the misfit of a right model.
    """

    noise: float
    lag1_autocorrelation: float
    discretisation: float | None
    finer: str
    simulation: float
    total: float


@dataclass(frozen=True)
class GeneValue:
    """A gene of the best model; ``off`` is the value at which it switches its effect off, if it does."""

    name: str
    unit: str
    description: str
    value: Interval
    off: float | None = None


@dataclass(frozen=True)
class Hypothesis:
    """One effect, or several together, as an explanation of the residual.

    Attributes:
        effects: names; empty for the nominal model.
        title: display name.
        family: of the first effect; "" for the nominal model.
        source: reference of its law.
        signature: what it looks like.
        probability: that this is the missing physics, given that one of the hypotheses considered, or none, is right.
        evidence: natural logarithm of its evidence relative to the nominal model.
        score: of the score test before any refit, chi-squared with ``freedom`` degrees.
        freedom: number of its genes.
        explained: fraction of the nominal model's excess (mean square beyond the noise) that its refit removes.
        predicted: the same cross-validated, recordings left out one at a time; None where that was not done.
        misfit: root mean square after its refit.
        refitted: whether it was refitted; otherwise all but the score is a linear extrapolation.
        genes: of its effects; empty unless refitted. Only the best hypothesis has intervals from a measured Jacobian.
    """

    effects: tuple[str, ...]
    title: str
    family: str
    source: str
    signature: str
    probability: float
    evidence: float
    score: float
    freedom: int
    explained: float
    predicted: float | None
    misfit: float
    refitted: bool
    genes: tuple[GeneValue, ...] = ()


@dataclass(frozen=True)
class Exponent:
    """How the misfit, or the named effect, scales with one variable of the condition: the exponent of a power law.

    ``variable`` is "flap frequency", "air density" or "airspeed"; ``low`` and ``high`` are the range that was recorded.
    """

    variable: str
    power: Interval
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Where:
    """Where the nominal model differs from the recordings; for a named effect, where that effect changes them.

    Attributes:
        words: the same in a sentence or two.
        span, chord: centre and extent on the wing; None where forces do not identify a location.
        phase: centre and extent in the beat; None where the misfit is spread over the whole beat.
        axis: channel axis with most of it ("x", "y" or "z").
        harmonics: fraction of its mean square in each harmonic of the beat, from 0.
        exponents: how it scales.
    """

    words: str
    span: Interval | None
    chord: Interval | None
    phase: Interval | None
    axis: str
    harmonics: Numbers
    exponents: tuple[Exponent, ...] = ()


@dataclass(frozen=True)
class MarkerMisfit:
    """Misfit of one marker or force axis over all recordings: root mean square beyond the noise, before and after.

    ``span`` and ``chord`` from 0 to 1, ``x`` and ``y`` in m on the wing; None for forces. ``worst`` is the phase at
    which it is largest, ``direction`` its mean direction there (x, y, z).
    """

    name: str
    span: float | None
    chord: float | None
    x: float | None
    y: float | None
    before: float
    after: float
    worst: float
    direction: tuple[float, float, float]


@dataclass(frozen=True)
class PhaseMap:
    """Misfit of the nominal model over the beat, averaged (root mean square) over the recordings.

    ``bands`` are the span stations of the rows (one row, band 0, for forces), ``phase`` the columns; ``before`` and
    ``after`` [bands][phase]; ``noise`` is the expected value of a cell by noise alone.
    """

    bands: Numbers
    phase: Numbers
    before: Table
    after: Table
    noise: float


@dataclass(frozen=True)
class MissingLoad:
    """The load missing from the nominal model, or the error of its drive, under one condition.

    ``values`` and ``errors`` (standard) [stations][phase]: force per metre of span along the flap normal, N/m; for
    recordings of forces the force itself, N; for a ``rod`` ("front" or "rear") its additional turn, rad, upward.
    """

    recording: str
    stations: Numbers
    phase: Numbers
    values: Table
    errors: Table
    unit: str
    rod: str = ""


@dataclass(frozen=True)
class RecordingMisfit:
    """Misfit to one recording before (nominal model, refitted) and after (effects added), with 90 % intervals."""

    name: str
    held_out: bool
    flap_frequency_hz: float
    phase_lag_deg: float
    pressure_mbar: float
    airspeed: float
    before: Interval
    after: Interval
    floor: float


@dataclass(frozen=True)
class Overlay:
    """One channel over one beat: the recording, and the simulation before and after the diagnosis added effects."""

    recording: str
    channel: str
    held_out: bool
    phase: Numbers
    recorded: Numbers
    before: Numbers
    after: Numbers


@dataclass(frozen=True)
class Term:
    """One term of a free-form law: a coefficient times a product of dimensionless features, such as ``rho V^2 c``."""

    feature: str
    coefficient: Interval
    unit: str


@dataclass(frozen=True)
class FreeLaw:
    """A sparse law for a residual that no effect explains; ``explained`` as in :class:`Hypothesis`, cross-validated."""

    words: str
    terms: tuple[Term, ...]
    explained: float


@dataclass(frozen=True)
class Advice:
    """A condition to record next; ``separation``: distance of the predictions in standard deviations."""

    words: str
    flap_frequency_hz: float
    phase_lag_deg: float
    pressure_mbar: float
    airspeed: float
    angle_of_attack_deg: float
    separation: float
    resolves: float
    between: tuple[str, ...]


@dataclass(frozen=True)
class Proof:
    """Misfit over all held-out recordings divided by ``floor`` (m or N), before and after as in RecordingMisfit."""

    before: Interval
    after: Interval
    floor: float
    improved: bool
    words: str


@dataclass(frozen=True)
class Finding:
    """The result of a diagnosis.

    Attributes:
        dataset: its name.
        kind: "tracks" or "forces".
        unit: "m" or "N".
        model: description of model, discretisation and preset.
        verdict: the decision.
        summary: the verdict in a few sentences.
        probabilities: of every verdict; they sum to one.
        named: effects that the verdict names; for an ambiguous one, all that cannot be distinguished.
        added_effects: in the model called "after": those named, the most probable of an ambiguous verdict, the best of
            an unnamed one if its evidence suffices; else empty.
        strength: misfit after the best nominal refit divided by the noise.
        floors: the smallest misfit that can be expected.
        hypotheses: most probable first, the nominal model included.
        indistinguishable: hypotheses (each of one or several effects) that these recordings cannot distinguish.
        where: location, phase, axis, scaling.
        markers, phase_map, missing: the maps.
        recordings: misfit to each.
        proof: validation on held-out recordings; None where there are none.
        overlays: tracks or forces to plot.
        genes: of the best model, nominal ones included.
        law: for an unnamed verdict, a free-form law.
        advice: what to record next, best first.
        outline: of the wing, (x, y) in m; empty for forces.
        remarks: everything else that a reader must know.
        seconds, evaluations: cost; ``versions`` of the packages that the numbers depend on.
    """

    dataset: str
    kind: Literal["tracks", "forces"]
    unit: Literal["m", "N"]
    model: str
    verdict: Verdict
    summary: str
    probabilities: dict[str, float]
    named: tuple[str, ...]
    added_effects: tuple[str, ...]
    strength: float
    floors: Floors
    hypotheses: tuple[Hypothesis, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    where: Where | None
    markers: tuple[MarkerMisfit, ...]
    phase_map: PhaseMap | None
    missing: tuple[MissingLoad, ...]
    recordings: tuple[RecordingMisfit, ...]
    proof: Proof | None
    overlays: tuple[Overlay, ...]
    genes: tuple[GeneValue, ...]
    law: FreeLaw | None
    advice: tuple[Advice, ...]
    outline: Table = ()
    remarks: tuple[str, ...] = ()
    seconds: float = 0.0
    evaluations: int = 0
    versions: dict[str, str] = field(default_factory=dict)


def in_milli(value: float, unit: str) -> str:
    """``value`` in ``unit`` ("m" or "N") as text in mm or mN."""
    return f"{1e3 * value:.3g} m{unit}"


def table(values: Float[Array, "N M"]) -> Table:
    """``values`` [N, M] as nested tuples, the form in which a finding stores them."""
    return tuple(tuple(row) for row in values.tolist())
