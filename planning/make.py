"""Makes a plan: simulates the recordings, what genes and effects change in them, and compares these changes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from wingfit.calibration.evaluator import Evaluator
from wingfit.diagnosis.subject import select_suspects
from wingfit.inference.campaign.responses import Response
from wingfit.inference.campaign.sampling import Sampling, spread_markers, typical_sampling
from wingfit.inference.design import Information
from wingfit.planning.additions import Additions, Option, pairs_to_separate
from wingfit.planning.effects import FALSE_ALARM, ODDS, Contrasts, Evidence, confused_pairs, planned_effects
from wingfit.planning.genes import GeneErrors, planned_genes
from wingfit.planning.outcome import ConfusedPair, Plan, Proposal, Variant
from wingfit.planning.rigs import BeatRig, PlannedRig, Said, SeriesRig
from wingfit.planning.simulated import Columns, columns_of
from wingfit.planning.spec import PlanSpec
from wingfit.records import AnyRecording, Dataset, Recording, SeriesDataset, Wing
from wingfit.records.array_types import Array, Float
from wingfit.records.blas_threads import one_blas_thread
from wingfit.rigs.rig import Rig
from wingfit.rigs.suspect import Suspect

OnProgress = Callable[[float, str], object]
SAME_PART = 1.4  # an effect is simulated again where its smallest size differs from that of its simulation by more
PARTS = (0.02, 20.0)  # of the typical size: least and largest that are simulated
VARIED = (0.25, 0.5, 2.0, 4.0)  # times the planned numbers of beats, frames and markers
LEAST_FRAMES, LEAST_MARKERS = 8, 3
HALFWAY = 0.5  # of the progress: planned recordings, the other half being candidates


@one_blas_thread
def plan_dataset(dataset: Dataset, spec: PlanSpec, evaluator: Evaluator, on_progress: OnProgress | None = None) -> Plan:
    """Plan for a wing or a vehicle; ValueError if ``spec`` does not fit, or a planned recording cannot be simulated.

    ``dataset`` may be the description of recordings without values (:mod:`wingfit.planning.description`).
    """
    return Making(dataset.name, BeatRig.of(dataset, spec, evaluator), spec, on_progress).plan()


@one_blas_thread
def plan_rig(
    rig: Rig, dataset: SeriesDataset, spec: PlanSpec, evaluator: Evaluator, on_progress: OnProgress | None = None
) -> Plan:
    """Plan for a rig that the user simulates; ValueError as in :func:`plan_dataset`."""
    return Making(dataset.name, SeriesRig.of(rig, dataset, spec, evaluator), spec, on_progress).plan()


@dataclass(eq=False)
class Making:
    """A plan that is being made; ``contrasts`` compares the effects once it is."""

    name: str
    rig: PlannedRig
    spec: PlanSpec
    on_progress: OnProgress | None
    remarks: list[str] = field(default_factory=list)
    responses: list[tuple[Response, Sampling]] = field(default_factory=list)

    def plan(self) -> Plan:
        """Simulate, compare, and return the plan."""
        rig, spec, simulator = self.rig, self.spec, self.rig.simulator
        suspects = [] if spec.effects is None else select_suspects(simulator.subject, spec.effects)
        columns = columns_of(simulator.free, suspects)
        genes = [gene for gene in simulator.subject.model.genes if gene.name in simulator.free]
        errors = GeneErrors(genes, simulator.genome)
        said, contrasts = self._planned(suspects, columns)
        self.contrasts = contrasts
        usual = typical_sampling(rig.samplings)
        target = spec.target_percent / 100.0
        confused = confused_pairs(contrasts)
        additions = self._additions(suspects, columns, said, contrasts, errors, confused)
        known = [one.genes for one in said]
        planned = planned_genes(errors, known, usual.beats, target)
        return Plan(
            dataset=self.name,
            kind=rig.planned[0].kind,
            recordings=tuple(one.name for one in rig.planned),
            seconds=self._seconds(),
            beats=usual.beats,
            frames=usual.frames,
            markers=_markers(rig.planned),
            noise=rig.noise,
            power=spec.power,
            false_alarm=FALSE_ALARM,
            odds=ODDS,
            target_percent=spec.target_percent,
            genes=tuple(one for one in planned if one.name in self._own_or_shared()),
            effects=tuple(planned_effects(contrasts, self._evidence(said, columns))),
            confused=confused,
            for_genes=additions[0],
            for_effects=additions[1],
            variants=tuple(self._variants(errors, known, usual, target)),
            remarks=tuple(self.remarks),
        )

    def _planned(self, suspects: Sequence[Suspect], columns: Columns) -> tuple[list[Said], Contrasts]:
        """Simulate the planned recordings, and effects again near the smallest size that will be detected."""
        rig, parts = self.rig, dict.fromkeys((one.name for one in suspects), 1.0)
        filled = list[AnyRecording]()
        changes = list[Array]()
        for k, blank in enumerate(rig.planned):
            self._report(0.8 * HALFWAY * k / len(rig.planned), f"simulating {blank.name}")
            filled.append(rig.simulator.filled(blank))
            changes.append(self._changes(filled[-1], suspects, columns, parts, refuse=True))
        contrasts = Contrasts.of(suspects, columns, self._said(filled, changes)[1], self.spec.power)
        again = [one for one in suspects if (part := _part_again(contrasts, one)) and self._set(parts, one, part)]
        for k, one in enumerate(filled):
            self._report(
                HALFWAY * (0.8 + 0.2 * k / len(filled)), f"simulating effects of the smallest size, {one.name}"
            )
            for suspect in again:
                found = rig.simulator.changes(suspect, one, parts[suspect.name])
                if found is not None:
                    changes[k][..., columns.effects[suspect.name]] = found
        said, true = self._said(filled, changes)
        if isinstance(rig, BeatRig):
            genes = columns.of_genes
            self.responses = [
                (rig.response(one, change[..., genes]), sampling)
                for one, change, sampling in zip(filled, changes, rig.samplings, strict=True)
            ]
        self.parts = parts
        return said, Contrasts.of(suspects, columns, true, self.spec.power)

    def _evidence(self, said: Sequence[Said], columns: Columns) -> Evidence:
        values = sum(
            (sampling.beats if one.kind == "series" else sampling.samples / len(one.times)) * one.values.size
            for one, sampling in zip(self.rig.planned, self.rig.samplings, strict=True)
        )
        return Evidence.of(_sum([one.all for one in said]).assumed, columns, values, len(said))

    @staticmethod
    def _set(parts: dict[str, float], suspect: Suspect, part: float) -> bool:
        parts[suspect.name] = part
        return True

    def _said(self, filled: Sequence[AnyRecording], changes: Sequence[Array]) -> tuple[list[Said], Array]:
        said = [
            self.rig.said(one, change, sampling)
            for one, change, sampling in zip(filled, changes, self.rig.samplings, strict=True)
        ]
        return said, np.asarray(sum(one.all.true for one in said))

    def _changes(
        self,
        recording: AnyRecording,
        suspects: Sequence[Suspect],
        columns: Columns,
        parts: dict[str, float],
        *,
        refuse: bool = False,
    ) -> Float[Array, "T C P"]:
        """Return the changes of ``recording`` by all parameters; zero for an effect that cannot be simulated."""
        found = np.zeros((*recording.values.shape, columns.count))
        found[..., columns.of_genes] = np.nan_to_num(self.rig.simulator.slopes(recording))
        for suspect in suspects:
            change = self.rig.simulator.changes(suspect, recording, parts[suspect.name])
            if change is None and refuse:
                self.remarks.append(f"{suspect.name} cannot be simulated in {recording.name} at its typical size")
            if change is not None:
                found[..., columns.effects[suspect.name]] = change
        return found

    def _additions(
        self,
        suspects: Sequence[Suspect],
        columns: Columns,
        said: Sequence[Said],
        contrasts: Contrasts,
        errors: GeneErrors,
        confused: Sequence[ConfusedPair],
    ) -> tuple[tuple[Proposal, ...], tuple[Proposal, ...]]:
        rig = self.rig
        if not self.spec.add:
            return (), ()
        usual = typical_sampling(rig.samplings)
        options = [Option(one, None, blank.name) for one, blank in zip(said, rig.planned, strict=True)]
        for k, candidate in enumerate(rig.candidates):
            self._report(HALFWAY + 0.45 * k / len(rig.candidates), f"simulating {candidate.words}")
            try:
                filled = rig.simulator.filled(candidate.blank)
                changes = self._changes(filled, suspects, columns, self.parts)
                options.append(Option(rig.said(filled, changes, usual), candidate, None))
            except ValueError as error:
                self.remarks.append(f"{candidate.words}: not considered, since {error}")
        self._report(0.95, "choosing further recordings")
        own = {name for one in (*rig.planned, *(c.blank for c in rig.candidates)) for name in rig.own_genes(one)}
        shared = np.array([k for k, name in enumerate(columns.genes) if name not in own], int)
        pairs = pairs_to_separate(contrasts, [(one.one, one.other) for one in confused])
        genes, every = _sum([one.genes for one in said]), _sum([one.all for one in said])
        found = Additions(options, genes, every, errors, contrasts, shared, pairs, self.spec.add)
        return found.for_genes(), found.for_effects()

    def _variants(
        self, errors: GeneErrors, known: Sequence[Information], usual: Sampling, target: float
    ) -> list[Variant]:
        """Return what other numbers of beats, frames and markers would make of the standard errors."""
        rig, total, found = self.rig, _sum(known), list[Variant]()
        own = [gene.name in self._own_or_shared() for gene in errors.genes]
        base = errors.of(total)[own]

        def add(what: str, number: float, said: Information) -> None:
            relative = errors.of(said)[own]
            factor = float(np.exp(np.mean(np.log(relative / base))))
            found.append(Variant(what, round(number), factor, int((relative <= target).sum())))

        for factor in (0.25, 0.5, 1.0, 2.0, 4.0, 10.0):
            if usual.beats * factor >= 1.0:
                add("beats" if isinstance(rig, BeatRig) else "repeats", usual.beats * factor, total.times(factor))
        if not isinstance(rig, BeatRig):
            return found
        for factor in VARIED:
            if usual.frames * factor >= LEAST_FRAMES:
                parts = [rig.about_genes(r, Sampling(s.beats, s.frames * factor)) for r, s in self.responses]
                add("frames", usual.frames * factor, _sum(parts))
        if rig.wing is not None:
            for count in _marker_counts(_markers(rig.planned)):
                parts = [rig.about_genes(r, s, _spread(rig.wing, r, count)) for r, s in self.responses]
                add("markers", count, _sum(parts))
        return found

    def _own_or_shared(self) -> set[str]:
        """Return the genes of the planned recordings, without those of candidates."""
        of_candidates = {name for one in self.rig.candidates for name in self.rig.own_genes(one.blank)}
        return set(self.rig.simulator.free) - of_candidates

    def _seconds(self) -> float:
        total = 0.0
        for one, sampling in zip(self.rig.planned, self.rig.samplings, strict=True):
            if isinstance(one, Recording):
                total += sampling.beats / one.condition.flap_frequency
            else:
                total += sampling.beats * float(np.ptp(one.times))
        return total

    def _report(self, fraction: float, stage: str) -> None:
        if self.on_progress:
            self.on_progress(fraction, stage)


def _part_again(contrasts: Contrasts, suspect: Suspect) -> float | None:
    """Return the part of its typical size at which ``suspect`` is to be simulated again; None if not."""
    part = None if suspect.positions else contrasts.smallest_part(suspect)
    if part is None or 1.0 / SAME_PART <= part <= SAME_PART:
        return None
    return float(np.clip(part, *PARTS))


def _marker_counts(most: int) -> list[int]:
    return sorted({max(round(most * factor), LEAST_MARKERS) for factor in (0.125, 0.25, 0.5) if most > LEAST_MARKERS})


def _markers(recordings: Sequence[AnyRecording]) -> int:
    return int(np.median([len(one.markers) if isinstance(one, Recording) else 0 for one in recordings]))


def _sum(known: Sequence[Information]) -> Information:
    total = known[0].times(0.0)
    for one in known:
        total = total + one
    return total


def _spread(wing: Wing, response: Response, count: int) -> tuple[str, ...]:
    markers = response.recording.markers
    return spread_markers(wing, markers, min(count, len(markers)))
