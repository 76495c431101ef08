"""Likely mistakes in the dataset: effects imitate them, so that they speak against a name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from wingfit.checks.mistake import Kind, Mistake
from wingfit.diagnosis.verdict.reservations import CLAIMING, without_names
from wingfit.diagnosis.verdict.verdict import Decision

DESCRIBED_BY: Mapping[Kind, tuple[str, ...]] = {
    "amplitude": ("stroke_amplitude",),
    "axes": (),
    "body pitch": ("body_pitch_convention", "axis_sign"),
    "force axes": ("axis_sign", "axis_swap", "body_pitch_convention"),
    "force unit": ("unit_error", "scale_error"),
    "frequency": (),
    "frozen marker": (),
    "length unit": ("scale_error",),
    "mean angle": ("stroke_bias", "hinge_tilt", "camera_rotation"),
    "motion": ("stroke_amplitude", "wing_pitch_amplitude", "wing_pitch_phase", "wing_pitch_zero"),
    "origin": ("camera_shift", "hinge_offset"),
    "phase lag": ("phase_lag_error",),
    "scale": ("scale_error",),
    "side": (),
    "swapped markers": ("marker_swap",),
    "tilt": ("camera_rotation", "hinge_tilt"),
    "time unit": (),
    "vertical sign": (),
}
"""Mistakes that samples show when compared with the description of the rig, and the effects that describe them.

Others are only remarks: improbable values, gaps or copies, which may be right or which no effect imitates, and another
start of the beat of forces, which competes with the effects as one of them, whatever it is.
"""
LIKELY = 0.7
"""Probability of such a mistake where the checks find one: they found 10 in 1170 datasets of five simulators with all
kinds of concealed effects, and all were mistakes (0.74 or more, with a confidence of 95 %)."""


def doubted_by_mistakes(decision: Decision, mistakes: Sequence[Mistake]) -> Decision:
    """Return ``decision`` without names where ``mistakes`` may be the cause and the named effects do not describe one.

    The effects keep the probability that the dataset has no mistake.
    """
    doubting = _doubting(mistakes)
    if decision.verdict not in CLAIMING or not doubting:
        return decision
    described = {name for kind in doubting for name in DESCRIBED_BY[kind]}
    return decision if described & set(decision.named) else without_names(decision, LIKELY)


def mistakes_sentence(before: Decision, after: Decision, mistakes: Sequence[Mistake]) -> str:
    """Return a sentence on likely ``mistakes``, if the verdict is not "adequate"; else empty.

    ``before``, ``after``: the decision without and with :func:`doubted_by_mistakes`.
    """
    if not mistakes or after.verdict == "adequate":
        return ""
    kinds = ", ".join(dict.fromkeys(one.kind for one in mistakes))
    name = " No effect is named until then." if before.verdict != after.verdict else ""
    return (
        f" The dataset has likely mistakes ({kinds}). One of them may be the cause: correct or exclude them first (see "
        f"the remarks).{name}"
    )


def mistake_remarks(mistakes: Sequence[Mistake]) -> tuple[str, ...]:
    """Return a remark for each of the likely ``mistakes``: place, value, cause and remedy."""
    return tuple(f"likely mistake in the dataset: {one}" for one in mistakes)


def _doubting(mistakes: Sequence[Mistake]) -> tuple[Kind, ...]:
    return tuple(one.kind for one in mistakes if one.kind in DESCRIBED_BY)
