"""Likely mistakes in the dataset: effects imitate them, so that they speak against a name."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from wingfit.checks.mistake import EVERY, Kind, Mistake
from wingfit.diagnosis.finding import Finding
from wingfit.diagnosis.verdict.reservations import CLAIMING, without_names
from wingfit.diagnosis.verdict.verdict import Decision

DESCRIBED_BY: Mapping[Kind, tuple[str, ...]] = {
    "air pressure": (),
    "airspeed": (),
    "amplitude": (),
    "axes": (),
    "body pitch": ("body_pitch_convention", "axis_sign"),
    "force axes": ("axis_sign", "axis_swap", "body_pitch_convention"),
    "force phase": ("phase_reference",),
    "force unit": ("unit_error",),
    "frequency": (),
    "mean angle": (),
    "motion": (),
    "origin": ("hinge_offset",),
    "phase lag": (),
    "scale": (),
    "side": (),
    "swapped markers": ("marker_swap",),
    "tilt": (),
    "vertical sign": (),
}
"""Mistakes that samples show when compared with the description of the rig, and the effects that describe them.

Others are only remarks: improbable values, gaps, copies and unsteady flapping, which may be right, or which no effect
imitates.
"""
COMPETING: tuple[Kind, ...] = ("force phase",)
"""Mistakes that an effect describes whatever their size, so that it competes with the others as one of them."""
CONDITIONS: tuple[Kind, ...] = ("air pressure", "airspeed")
"""Kinds that are improbable values as well, of single recordings; samples show them in all recordings together."""
LIKELY = 0.5  # probability of a mistake, the least with which no effect is named


@dataclass(frozen=True)
class MistakeDoubt:
    """Likely ``mistakes`` in a dataset, and what is known of their effect on the recordings.

    ``suspects``: names of the effects that were considered; ``included``: of those in the nominal model.
    """

    mistakes: tuple[Mistake, ...] = ()
    suspects: Collection[str] = ()
    included: Collection[str] = ()

    def applied(self, decision: Decision) -> Decision:
        """Return ``decision`` with less certainty, and without names, where a mistake may be the cause instead.

        The effects keep the probability that the dataset has no mistake.
        """
        if decision.verdict not in CLAIMING or not self._causes(decision.named):
            return decision
        return without_names(decision, LIKELY)

    def sentence(self, before: Decision, after: Decision) -> str:
        """Return a sentence on mistakes that may be the cause, or that a named effect describes; else empty.

        ``before``, ``after``: the decision without and with :meth:`applied`.
        """
        causes = self._causes(before.named)
        if causes and after.verdict != "adequate":
            name = " No effect is named until then." if before.verdict != after.verdict else ""
            unusual = f" If you have verified that it is right, state verified: [{_listed(causes)}] in dataset.yaml."
            if any(one.certain for one in self._shown()):
                unusual = ""
            return (
                f" The dataset has likely mistakes ({_listed(causes)}), and one of them may be the cause: correct the "
                f"dataset, or exclude the recordings that have them (see the remarks).{unusual}{name}"
            )
        same = [one.kind for one in self._shown() if _described_by(one) & set(after.named)]
        found = f" The checks of the dataset find it, too ({_listed(same)}): correct the dataset (see the remarks)."
        return found if same else ""

    def stated(self, finding: Finding, before: Decision, after: Decision) -> Finding:
        """Return ``finding`` with the mistakes in its summary and remarks; arguments as of :meth:`sentence`."""
        remarks = tuple(f"likely mistake in the dataset: {one}" for one in self.mistakes)
        summary = finding.summary + self.sentence(before, after)
        return replace(finding, summary=summary, remarks=(*remarks, *finding.remarks))

    def _causes(self, named: Sequence[str]) -> list[Kind]:
        """Return the kinds of mistakes that neither the model nor an effect in ``named`` describes."""
        causes = []
        for one in self._shown():
            by = _described_by(one)
            competes = one.kind in COMPETING and not by.isdisjoint(self.suspects)
            if by.isdisjoint(self.included) and by.isdisjoint(named) and not competes:
                causes.append(one.kind)
        return causes

    def _shown(self) -> list[Mistake]:
        improbable = [one for one in self.mistakes if one.kind in CONDITIONS and one.where != EVERY]
        return [one for one in self.mistakes if one.kind in DESCRIBED_BY and one not in improbable]


def _described_by(mistake: Mistake) -> set[str]:
    """Return the effects that describe ``mistake``: none if it is one recording's alone, since they act in all."""
    return set() if mistake.alone else set(DESCRIBED_BY[mistake.kind])


def _listed(kinds: Sequence[Kind]) -> str:
    return ", ".join(dict.fromkeys(kinds))
