"""What a diagnosis found: plain data, complete enough to draw the report from it alone.

Lengths in m, forces in N, angles in rad, phases in beats (0 to 1, from the start of the beat as the dataset defines
it), places on a wing in parts of the span (root 0, tip 1) and of the chord (leading edge 0, trailing edge 1).
``unit`` is that of a channel: "m" for tracks, "N" for forces; all misfits are root mean squares of one channel in it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import numpy.typing as npt

Verdict = Literal["adequate", "named", "ambiguous", "unnamed", "measurement fault"]
VERDICTS: tuple[Verdict, ...] = ("adequate", "named", "ambiguous", "unnamed", "measurement fault")
Numbers = tuple[float, ...]
Table = tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Interval:
    """A value with a 90 % interval; ``low`` and ``high`` are None where nothing bounds it."""

    value: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Floors:
    """How small a misfit can be.

    Attributes:
        noise: root mean square of the measurement's noise, by the scatter between beats.
        memory: correlation of the noise from frame to frame (or sample to sample).
        division: misfit that the model's own division leaves, by comparison with a finer one, but no more than is left;
            None where there is none.
        finer: the division that it was compared with.
        simulation: misfit that no model is asked to be better than, a tenth of the noise.
        total: root of the sum of squares of these: what a right model would leave.
    """

    noise: float
    memory: float
    division: float | None
    finer: str
    simulation: float
    total: float


@dataclass(frozen=True)
class GeneValue:
    """A gene of the model that explains the data best; ``off`` is the value at which an effect is switched off."""

    name: str
    unit: str
    description: str
    value: Interval
    off: float | None = None


@dataclass(frozen=True)
class Hypothesis:
    """An effect, or several at once, as an explanation.

    Attributes:
        effects: names; empty for the nominal model.
        title: for people.
        family: of the first effect; "" for the nominal model.
        source: where its law is from.
        signature: what it looks like.
        probability: that this is what is lacking, given that one of those considered, or none, is.
        evidence: natural logarithm of its evidence over the nominal model's.
        score: of the score test, chi-squared with ``freedom`` degrees; before any refit.
        freedom: number of its genes.
        explained: part of the nominal model's excess misfit (mean square beyond the noise) that its refit takes away.
        predicted: the same for recordings that were left out of the fit one by one; None where that was not done.
        misfit: what its refit leaves, root mean square.
        refitted: whether it was refitted in full; else all but the score is by linear extrapolation.
        genes: of its effects; empty unless refitted. Intervals of all but the best rest on slopes learnt on the way.
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
    """How the misfit, or what was named, grows with one variable of the condition: as its power.

    ``variable`` is "flap frequency", "air density" or "airspeed"; ``low`` and ``high`` say between which
    values recordings told it.
    """

    variable: str
    power: Interval
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Where:
    """Where the nominal model and the recordings differ; where there is a name, by what that does to the recordings.

    Attributes:
        words: the same in a sentence or two.
        span, chord: centre and extent of the place on the wing; None where forces do not tell a place.
        phase: centre and extent in the beat; None where the misfit is spread over the whole beat.
        axis: along which channel axis most of it lies ("x", "y" or "z").
        harmonics: part of its mean square in each harmonic of the beat, from 0.
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
    """Misfit of one marker (or force axis) over all recordings: root mean square beyond the noise, before and after.

    ``span`` and ``chord`` are its place in parts, ``x`` and ``y`` in m on the wing; None for forces. ``worst`` is the
    phase at which it is largest, ``direction`` its mean direction there (x, y, z).
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

    ``bands`` are the span stations of the rows in parts (one row, band 0, for forces), ``phase`` the columns;
    ``before`` and ``after`` [bands][phase]; ``noise`` is what noise alone leaves in a cell.
    """

    bands: Numbers
    phase: Numbers
    before: Table
    after: Table
    noise: float


@dataclass(frozen=True)
class MissingLoad:
    """The load that the nominal model lacks, or the motion of its drive, found through its own response.

    Under one condition. ``values`` and ``errors`` (standard) [stations][phase]: force per metre of span along the flap
    normal, N/m; where a recording of forces shows it directly, N; what a ``rod`` ("front" or "rear") turns further
    than it is said to, rad, upward.
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
    """Misfit to one recording before (nominal model, refitted) and after (with what was found), with 90 % intervals."""

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
    """One channel over one beat: what was recorded (mean beat, samples at their phases) and what is simulated."""

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
    """A sparse law for what no effect explains; ``explained`` as in :class:`Hypothesis`, cross-validated."""

    words: str
    terms: tuple[Term, ...]
    explained: float


@dataclass(frozen=True)
class Advice:
    """A condition to record next. ``separation`` is how far the hypotheses would lie apart, in standard deviations."""

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
    """Misfit over all held-out recordings in parts of ``floor`` (m or N): nominal refitted, and with what was found."""

    before: Interval
    after: Interval
    floor: float
    improved: bool
    words: str


@dataclass(frozen=True)
class Finding:
    """The outcome of a diagnosis.

    Attributes:
        dataset: its name.
        kind: "tracks" or "forces".
        unit: "m" or "N".
        model: in words: which model, division, preset.
        verdict: the decision.
        summary: it in a few sentences for people.
        probabilities: of every verdict; they sum to one.
        named: effects that the verdict names (one or more); of an ambiguous one, those that cannot be told apart.
        put_in: effects in the model that is called "after": those named, the most probable of an ambiguous verdict, the
            nearest of an unnamed one if they take as much as they cost; else empty.
        strength: misfit after the best nominal refit over the noise, d.
        floors: how small a misfit can be.
        hypotheses: most probable first; the nominal model is among them.
        alike: explanations, each of one or several effects, that these recordings cannot tell apart.
        where: place, phase, axis, scaling.
        markers, phase_map, missing: the maps.
        recordings: misfit to each.
        proof: on held-out recordings; None where none is held out.
        overlays: tracks or forces to look at.
        genes: of the best model, nominal ones included.
        law: where the verdict is unnamed, a free-form law.
        advice: what to record next, best first.
        outline: of the wing, (x, y) in m, to draw the map on; empty for forces.
        remarks: everything else that a reader must know.
        seconds, evaluations: what it took; ``versions`` of the packages that it rests on.
    """

    dataset: str
    kind: Literal["tracks", "forces"]
    unit: Literal["m", "N"]
    model: str
    verdict: Verdict
    summary: str
    probabilities: dict[str, float]
    named: tuple[str, ...]
    put_in: tuple[str, ...]
    strength: float
    floors: Floors
    hypotheses: tuple[Hypothesis, ...]
    alike: tuple[tuple[str, ...], ...]
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


def table(values: npt.NDArray[np.float64]) -> tuple[tuple[float, ...], ...]:
    """Values [N, M] as a finding keeps them."""
    return tuple(tuple(row) for row in values.tolist())
