"""The result of a diagnosis: plain data from which the report is drawn.

Lengths are in m, forces in N, angles in rad, phases in beats (0 to 1, from the start of the beat as the dataset defines
it), locations on a wing from 0 to 1 along the span (root to tip) and the chord (leading to trailing edge). ``unit`` is
that of a channel: "m" for tracks, "N" for forces; all misfits are root mean squares of one channel in it. Channels of a
series have units of their own, so there the unit is "noise": misfits are divided by the noise of their channel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from wingfit.diagnosis.advice.advised import Advice
from wingfit.diagnosis.evidence.fitted_model import FittedModel
from wingfit.records.array_types import Array, Float
from wingfit.records.dataset import AnyKind

Verdict = Literal["adequate", "named", "partly named", "ambiguous", "unnamed", "measurement fault"]
VERDICTS: tuple[Verdict, ...] = ("adequate", "named", "partly named", "ambiguous", "unnamed", "measurement fault")
NAMING: tuple[Verdict, ...] = ("named", "partly named", "measurement fault")  # those with certain effects
CONFIDENT = 0.75  # probability from which a text calls a model adequate; below, it says that it may not be
UNCERTAIN = 0.25  # probability of the effects, too low for a name, from which a text does not say that none explains it
Numbers = tuple[float, ...]
Table = tuple[tuple[float, ...], ...]


def of_the_library(probabilities: Mapping[str, float]) -> float:
    """Return the probability that effects of the library are what is missing, from those of all verdicts."""
    return max(1.0 - probabilities.get("adequate", 0.0) - probabilities.get("unnamed", 1.0), 0.0)


@dataclass(frozen=True)
class Interval:
    """A value with a 90 % interval; ``low`` and ``high`` are None where the data do not bound it."""

    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Floors:
    """The smallest misfit that can be expected of a correct model, and its parts.

    Attributes:
        noise: root mean square of the measurement noise, from the scatter between beats.
        lag1_autocorrelation: of the noise, between successive samples.
        discretisation: misfit caused by the model's discretisation, estimated with a finer one; at most the residual of
            the best hypothesis, 0 if the finer one fits no better; None where there is no finer one.
        finer: description of the finer discretisation; "" where there is none, and where ``discretisation`` is what the
            last refinement leaves.
        simulation: misfit that any model is allowed, for the error of the simulation: a tenth of the noise.
        total: root of the sum of squares of noise, discretisation, simulation and marker positions: the expected misfit
            of a correct model.
        marker_positions: misfit caused by errors of the markers' described rest positions, as far as all markers share
            them; their other errors are estimated, and not part of any misfit. 0 where they are negligible.
    """

    noise: float
    lag1_autocorrelation: float
    discretisation: float | None
    finer: str
    simulation: float
    total: float
    marker_positions: float = 0.0


@dataclass(frozen=True)
class GeneValue:
    """A gene of a model, with its value; ``off``: value of a size gene that switches its effect off, else None."""

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
        source: reference of the law of each effect.
        signature: what the effects look like in a recording.
        probability: that exactly these effects are missing; with that of physics outside the library, all sum to one.
        evidence: natural log-likelihood minus the cost of the genes, relative to the nominal model.
        score: decrease of chi-squared that the score tests predicted before any refit.
        freedom: number of genes that the effects add.
        explained: fraction of the nominal model's excess (mean square beyond the noise) that its refit removes.
        predicted: the same cross-validated, recordings left out one at a time; None where that was not done.
        misfit: root mean square of the residual after its refit, noise included.
        refitted: whether it was refitted; if not, ``explained`` and ``misfit`` are linear extrapolations, and
            ``probability`` and ``evidence`` are 0.
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
    """The misfit, or the named effect, scales as a power of one variable of the condition, with exponent ``power``.

    ``variable`` is "flap frequency", "air density" or "airspeed"; ``low`` and ``high`` are the recorded range in
    ``unit``.
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
        words: all of the following as a sentence.
        span, chord: centre and extent on the wing; None where forces do not identify a location.
        phase: centre and extent in the beat; None where the misfit is spread over the whole beat.
        axis: channel axis with most of the misfit ("x", "y" or "z"); of a series, the channel.
        harmonics: fraction of the misfit's mean square in each harmonic of the beat, from 0 (the mean); empty for a
            series.
        exponents: how the misfit scales with the condition; empty where the recordings do not show that.
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
    """Misfit of one marker or force axis over all recordings, before and after effects are added to the model.

    ``before`` and ``after``: root mean square beyond the noise. ``span`` and ``chord`` from 0 to 1, ``x`` and ``y`` in
    m on the wing; None for forces. ``worst``: phase at which the misfit before is largest; ``direction``: unit vector
    (x, y, z) of its mean there.
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
    """Periodic misfit over span and beat, root mean square over all recordings, before and after effects are added.

    ``bands`` are the span stations of the rows (one row, band 0, for forces), ``phase`` the columns; ``before`` and
    ``after`` [bands][phase]; ``noise`` is the value to be expected in a cell from noise alone.
    """

    bands: Numbers
    phase: Numbers
    before: Table
    after: Table
    noise: float


@dataclass(frozen=True)
class MissingLoad:
    """The load missing from the nominal model, or the error of its drive, in one recording.

    ``values`` and standard ``errors`` are nested tuples [stations][phase], with ``stations`` along the span and
    ``phase`` in the beat: force per metre of span along the flap normal, N/m; for recordings of forces the force
    itself, N; for a ``rod`` of the drive ("front" or "rear") its additional rotation, rad, upward.
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
    """Misfit to one recording before (nominal model, refitted) and after (effects added), with 90 % intervals.

    ``airspeed`` in m/s; ``floor``: misfit to be expected from noise, discretisation error and accepted error. A series
    has ``settings`` by name instead of flap frequency, phase lag, pressure and airspeed, which are None.
    """

    name: str
    held_out: bool
    flap_frequency_hz: float | None
    phase_lag_deg: float | None
    pressure_mbar: float | None
    airspeed: float | None
    before: Interval
    after: Interval
    floor: float
    settings: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Overlay:
    """One channel over one beat: the recording, and the simulation before and after the diagnosis added effects.

    ``recorded``, ``before`` and ``after`` are values in ``unit`` ("": that of the finding) at each ``phase``; of a
    series, which has no beat, at each of ``times`` (s). ``held_out``: not used for the fit.
    """

    recording: str
    channel: str
    held_out: bool
    phase: Numbers
    recorded: Numbers
    before: Numbers
    after: Numbers
    times: Numbers = ()
    unit: str = ""


@dataclass(frozen=True)
class ChannelMisfit:
    """Misfit of one channel of a series over all fitted recordings, in ``unit``, before and after effects are added.

    ``before`` and ``after``: root mean square beyond the noise; ``noise``: standard deviation of one sample, known from
    ``source``; ``place``: where the channel is measured, as text.
    """

    name: str
    unit: str
    place: str
    noise: float
    source: str
    before: float
    after: float


@dataclass(frozen=True)
class Term:
    """One term of a free-form law of a load per metre of span: ``coefficient`` (in ``unit``) times ``feature``.

    ``feature`` is a product of the local motion, the air and the wing, such as ``rho c |V_n| V_n``.
    """

    feature: str
    coefficient: Interval
    unit: str


@dataclass(frozen=True)
class FreeLaw:
    """A law of few terms for a missing load that no effect explains; without terms if no law predicts the recordings.

    ``explained``: fraction of the excess in recordings that were left out when the law was selected and fitted.
    """

    words: str
    terms: tuple[Term, ...]
    explained: float


@dataclass(frozen=True)
class Proof:
    """Misfit over all held-out recordings divided by ``floor`` (m or N), before and after as in RecordingMisfit.

    ``improved``: whether the decrease is significant; ``words``: the result as text.
    """

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
        kind: "tracks", "forces" or "series".
        unit: "m", "N" or "noise".
        model: description of the nominal model and its discretisation.
        verdict: the decision.
        summary: the verdict in a few sentences.
        probabilities: of every verdict; they sum to one.
        named: effects that the verdict names; for an ambiguous one, all that cannot be distinguished.
        added_effects: effects in the model called "after": those named, the most probable of an ambiguous verdict, the
            best of an unnamed one if its evidence suffices; else empty.
        strength: misfit after the best nominal refit divided by the noise.
        floors: the smallest misfit that can be expected.
        hypotheses: most probable first, the nominal model included.
        indistinguishable: hypotheses (each of one or several effects) that these recordings cannot distinguish.
        where: location, phase, axis and scaling of the misfit; None for an adequate model.
        markers, phase_map, missing: misfit by marker, misfit over span and beat, and missing load.
        recordings: misfit to each.
        proof: validation on held-out recordings; None where there are none.
        overlays: tracks or forces to plot.
        genes: of the best model, nominal ones included.
        law: free-form law of the missing load for an unnamed verdict; None where there is none.
        advice: what to record next, best first.
        outline: of the wing, (x, y) in m; empty for forces and series.
        channels: misfit by channel of a series; empty for tracks and forces.
        remarks: everything else that a reader must know.
        seconds, evaluations: computing time, and number of individuals simulated.
        versions: of the packages that the numbers depend on.
        fitted: refitted hypotheses as models, that with ``added_effects`` first; empty in findings of before.
    """

    dataset: str
    kind: AnyKind
    unit: str
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
    channels: tuple[ChannelMisfit, ...] = ()
    remarks: tuple[str, ...] = ()
    seconds: float = 0.0
    evaluations: int = 0
    versions: dict[str, str] = field(default_factory=dict)
    fitted: tuple[FittedModel, ...] = ()


def amount(value: float, unit: str) -> str:
    """Return the misfit ``value`` in ``unit`` ("m", "N" or "noise") as text, in mm, mN or multiples of the noise."""
    return f"{value:.3g} times the noise" if unit == "noise" else f"{1e3 * value:.3g} m{unit}"


def table(values: Float[Array, "N M"]) -> Table:
    """Return ``values`` [N, M] as nested tuples, the form in which a finding stores them."""
    return tuple(tuple(row) for row in values.tolist())
