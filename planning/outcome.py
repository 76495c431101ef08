"""What a plan says; plain data, which service, command line and page show."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class PlannedNoise:
    """The noise that was assumed, in ``unit`` ("mm", "mN", or "" for channels with their own units).

    ``deviation`` of one sample by axis or channel; ``source`` of it: "stated", "recordings" or "default".
    ``scatter_percent``: of the force from beat to beat, None for other recordings.
    """

    unit: str
    deviation: dict[str, float]
    correlation: float
    scatter_percent: float | None
    source: str


@dataclass(frozen=True)
class PlannedGene:
    """How well a gene will be known.

    Attributes:
        name: of the gene.
        unit: of value and standard error.
        value: at which the plan was made.
        standard_error: of an estimate from all recordings together.
        relative_percent: standard error over the value (of a weight: over its share), per cent.
        identified: whether that is at most the target.
        beats_for_target: beats of every recording from which it would be; None if no number is enough.
        alone_percent: the least relative standard error from one recording alone, per cent.
        correlated_with: the gene whose estimate correlates most with it.
        correlation: of the two estimates.
    """

    name: str
    unit: str
    value: float
    standard_error: float
    relative_percent: float
    identified: bool
    beats_for_target: int | None
    alone_percent: float
    correlated_with: str | None
    correlation: float


@dataclass(frozen=True)
class PlannedSize:
    """A size of an effect: ``typical`` value, and the ``smallest`` that will be detected; None: none within bounds."""

    name: str
    unit: str
    typical: float
    smallest: float | None


@dataclass(frozen=True)
class PlannedEffect:
    """Whether missing physics, or a fault of the measurement, will be found.

    Attributes:
        name: of the effect.
        title: for display.
        family: kind of physics.
        sizes: its size genes; with several, in the proportion of their typical values.
        detection_probability: probability that an effect of the typical size is detected.
        smallest_part: smallest size that is detected with the stated power, divided by the typical one; None: a choice
            without a size, or no change in these recordings.
        diagnosed_part: size from which a diagnosis counts the effect as evidence, divided by the typical one: it never
            trusts a model to be as exact as the noise of a long recording. None as above.
        explained_percent: part of its change that the genes of the model imitate, per cent.
        rival: the effect that resembles it most; None without others.
        cosine: of its change and the nearest one of the rival, after the genes are fitted; 1: no difference.
        separable_part: smallest size at which the two are distinguished with the stated power, divided by the typical
            one; None: no size does.
    """

    name: str
    title: str
    family: str
    sizes: tuple[PlannedSize, ...]
    detection_probability: float
    smallest_part: float | None
    diagnosed_part: float | None
    explained_percent: float
    rival: str | None
    cosine: float
    separable_part: float | None


@dataclass(frozen=True)
class ConfusedPair:
    """Two effects that these recordings cannot tell apart at their typical sizes with the stated power.

    ``cosine`` of their changes after the genes are fitted; ``probability`` of telling an effect of the typical size
    from the other: the less probable of the two directions.
    """

    one: str
    other: str
    cosine: float
    probability: float


@dataclass(frozen=True)
class Proposal:
    """A further recording, in the order in which recordings add most.

    Attributes:
        words: the condition, for display.
        condition: flap_frequency_hz, phase_lag_deg, pressure_mbar, airspeed_m_s, angle_of_attack_deg; of another rig
            empty.
        repeats: name of the recording that it repeats; None for a new condition.
        beyond: settings outside of the range of the recordings; the rig must allow them.
        standard_error_factor: geometric mean, over the genes, of standard errors with it over those before it.
        separation_factor: mean distance between confused effects with it over that before it.
    """

    words: str
    condition: dict[str, float]
    repeats: str | None
    beyond: tuple[str, ...]
    standard_error_factor: float
    separation_factor: float


@dataclass(frozen=True)
class Variant:
    """The same recordings with other numbers of beats, frames or markers.

    ``standard_error_factor``: geometric mean over the genes, relative to the plan; ``identified``: number of genes with
    a relative standard error of at most the target.
    """

    what: str
    number: int
    standard_error_factor: float
    identified: int


@dataclass(frozen=True)
class Plan:
    """What a campaign will show.

    Attributes:
        dataset: name of the dataset or of its description.
        kind: "tracks", "forces" or "series".
        recordings: names of the recordings that are planned, or were recorded, and are fitted.
        seconds: total duration of these, s.
        beats: of a recording (median); of another rig: repeats of each.
        frames: frames or samples per beat (median).
        markers: median number; 0 for other recordings.
        noise: that was assumed.
        power: probability with which effects are to be detected and distinguished.
        false_alarm: probability that any effect is detected although none is there.
        odds: likelihood ratio from which two effects count as distinguished.
        target_percent: relative standard error that counts as identified.
        genes: of the model.
        effects: that were compared.
        confused: pairs of effects, worst first.
        for_genes: recordings to add for the genes (D-optimal).
        for_effects: recordings to add to tell effects apart (T-optimal).
        variants: other numbers of beats, frames and markers.
        remarks: what the plan assumes, and what could not be simulated.
    """

    dataset: str
    kind: str
    recordings: tuple[str, ...]
    seconds: float
    beats: float
    frames: float
    markers: int
    noise: PlannedNoise
    power: float
    false_alarm: float
    odds: float
    target_percent: float
    genes: tuple[PlannedGene, ...] = ()
    effects: tuple[PlannedEffect, ...] = ()
    confused: tuple[ConfusedPair, ...] = ()
    for_genes: tuple[Proposal, ...] = ()
    for_effects: tuple[Proposal, ...] = ()
    variants: tuple[Variant, ...] = ()
    remarks: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the plan as plain data, lists in place of tuples."""
        found: dict[str, Any] = _plain(asdict(self))
        return found


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(one) for name, one in value.items()}
    return [_plain(one) for one in value] if isinstance(value, tuple | list) else value
