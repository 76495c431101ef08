"""The rigs that can be planned for: a wing, a vehicle, and a rig that the user simulates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from wingfit.calibration.evaluator import Evaluator
from wingfit.calibration.preparation import fitted_through, prepare_rig, searched_genes
from wingfit.calibration.problem import base_genome
from wingfit.calibration.spec import CalibrationSpec
from wingfit.diagnosis.advice.series_candidates import Candidate as SeriesCandidate
from wingfit.diagnosis.advice.series_candidates import candidates as series_candidates
from wingfit.diagnosis.candidate_conditions import candidate_conditions, settings_beyond
from wingfit.diagnosis.rig_subject import RigSubject
from wingfit.diagnosis.rigs import subject_of
from wingfit.inference.campaign.noise_level import NoiseLevel
from wingfit.inference.campaign.responses import Response, kept_channels
from wingfit.inference.campaign.sampling import (
    Sampling,
    blank_on_grid,
    seen_sampling,
    spread_markers,
    typical_sampling,
)
from wingfit.inference.design import Information
from wingfit.inference.noise.series import SeriesNoise, cosine_transform, noise_of
from wingfit.planning.description import is_described
from wingfit.planning.noise import noise_for
from wingfit.planning.outcome import PlannedNoise
from wingfit.planning.simulated import Simulator
from wingfit.planning.spec import PlanSpec
from wingfit.records import AnyRecording, Condition, Dataset, Recording, Series, SeriesDataset, Wing
from wingfit.records.array_types import Array, Float
from wingfit.records.series import belongs_to
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel
from wingfit.sim.model import Model

MOST_SERIES = 16  # candidates of another rig


@dataclass(frozen=True, eq=False)
class Candidate:
    """A recording that could be added: ``blank`` describes it; the rest is for display (:class:`.outcome.Proposal`)."""

    blank: AnyRecording
    words: str
    condition: dict[str, float]
    beyond: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Said:
    """What one recording says: ``genes`` about the free genes, ``all`` about all parameters of the plan."""

    genes: Information
    all: Information


class PlannedRig(Protocol):
    """A rig, its planned recordings without values, and what each of them says once it is simulated."""

    @property
    def simulator(self) -> Simulator:
        """Simulates the rig."""
        ...

    @property
    def planned(self) -> tuple[AnyRecording, ...]:
        """The planned recordings, without values."""
        ...

    @property
    def samplings(self) -> tuple[Sampling, ...]:
        """How each of these is sampled."""
        ...

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """Recordings that could be added."""
        ...

    @property
    def noise(self) -> PlannedNoise:
        """The noise that is assumed."""
        ...

    def said(self, recording: AnyRecording, changes: Float[Array, "T C P"], sampling: Sampling) -> Said:
        """Return what ``recording`` says, whose values are simulated, with the ``changes`` by all parameters."""
        ...

    def own_genes(self, recording: AnyRecording) -> tuple[str, ...]:
        """Return the free genes that belong to ``recording`` alone."""
        ...


@dataclass(frozen=True, eq=False)
class BeatRig:
    """A wing recorded as tracks, or a vehicle recorded as forces."""

    simulator: Simulator
    planned: tuple[AnyRecording, ...]
    samplings: tuple[Sampling, ...]
    candidates: tuple[Candidate, ...]
    level: NoiseLevel
    gene_axes: tuple[str, ...]
    wing: Wing | None

    @classmethod
    def of(cls, dataset: Dataset, spec: PlanSpec, evaluator: Evaluator) -> BeatRig:
        """Prepare a plan for ``dataset``, whose recordings may have no values; ValueError if ``spec`` does not fit."""
        spec.refuse_for(dataset.kind)
        wing = dataset.rig if isinstance(dataset.rig, Wing) else None
        axes = () if wing else _axes(dataset)
        calibration = replace(spec.calibration, mode="joint", search_division=None)
        subject = subject_of(dataset, calibration)
        free = searched_genes(calibration, subject.model)
        fitted = dataset.select(calibration.recordings) if calibration.recordings else dataset.fitted
        samplings = tuple(_sampling(one, spec) for one in fitted)
        usual = typical_sampling(samplings)
        level = noise_for(dataset, fitted, spec)
        planned = tuple(
            _blank(one, one.condition, one.name, sampling, _markers(wing, one, spec), calibration)
            for one, sampling in zip(fitted, samplings, strict=True)
        )
        candidates = list[Candidate]()
        for k, condition in enumerate(candidate_conditions(dataset.recordings, dataset.rig_limits) if spec.add else ()):
            like = min(fitted, key=lambda one: _unlike(one.condition, condition))
            blank = _blank(like, condition, f"candidate-{k + 1}", usual, planned[0].markers, calibration)
            candidates.append(_candidate(blank, condition, dataset.recordings))
        genome = base_genome(subject.model, {**spec.calibration.fixed, **_known(spec.genome, subject.model)})
        simulator = Simulator(subject, evaluator, genome, free, axes)
        return cls(simulator, planned, samplings, tuple(candidates), level, calibration.axes if not wing else (), wing)

    @property
    def noise(self) -> PlannedNoise:
        """The noise that is assumed, in mm or mN."""
        names, unit = ("xyz", "mm") if self.wing else ("xz", "mN")
        deviation = {name: 1e3 * float(one) for name, one in zip(names, self.level.deviation, strict=True)}
        scatter = None if self.wing else 100.0 * self.level.scatter
        return PlannedNoise(unit, deviation, self.level.correlation, scatter, self.level.source)

    def response(self, recording: AnyRecording, changes: Float[Array, "T C P"]) -> Response:
        """Return the ``changes`` of ``recording`` as coefficients."""
        if not isinstance(recording, Recording):
            raise TypeError("a recording of another rig has no beat")
        return Response.of(recording, changes, self.wing)

    def said(self, recording: AnyRecording, changes: Float[Array, "T C P"], sampling: Sampling) -> Said:
        """Return what ``recording`` says: about effects along all axes, about genes along those that are fitted."""
        response = self.response(recording, changes)
        every = response.information(self.level, sampling)
        genes = np.arange(len(self.simulator.free))
        if self.wing:
            return Said(every.about(genes), every)
        return Said(self.about_genes(response, sampling), every)

    def about_genes(self, response: Response, sampling: Sampling, markers: Sequence[str] = ()) -> Information:
        """Return what ``response`` says about the free genes, for other numbers of frames, beats or ``markers``."""
        genes = np.arange(len(self.simulator.free))
        part = replace(response, changes=response.changes[..., genes])
        names = self.gene_axes or markers
        kept = kept_channels(response.recording, names) if names else None
        return part.information(self.level, sampling, kept)

    def own_genes(self, recording: AnyRecording) -> tuple[str, ...]:  # noqa: ARG002  # part of the protocol
        """Return nothing: all recordings have the same genes."""
        return ()


@dataclass(frozen=True, eq=False)
class SeriesRig:
    """A rig that the user simulates, with series of its channels."""

    simulator: Simulator
    planned: tuple[AnyRecording, ...]
    samplings: tuple[Sampling, ...]
    candidates: tuple[Candidate, ...]
    levels: dict[str, SeriesNoise]

    @classmethod
    def of(cls, rig: Rig, dataset: SeriesDataset, spec: PlanSpec, evaluator: Evaluator) -> SeriesRig:
        """Prepare a plan for ``rig`` and the recordings of ``dataset``; ValueError if they or ``spec`` do not fit."""
        spec.refuse_for("series")
        fitted = dataset.select(spec.calibration.recordings) if spec.calibration.recordings else dataset.fitted
        levels, proposals, more = noise_of(fitted), list[Candidate](), list[Series]()
        for k, one in enumerate(_new(series_candidates(fitted)) if spec.add else ()):
            name = f"candidate-{k + 1}"
            blank = replace(one.recording, name=name, repeats="", estimates=_started(rig, one))
            levels[name] = levels[one.recording.name]
            more.append(blank)
            proposals.append(Candidate(blank, f"{one.recording.name} again {one.change}", {}))
        whole = replace(dataset, recordings=(*dataset.recordings, *more))
        names = tuple(one.name for one in (*fitted, *more))
        ready = prepare_rig(replace(spec.calibration, recordings=names), rig, whole)
        if not isinstance(ready.model, RigModel):
            raise TypeError("a rig has a model of its own")
        genome = base_genome(ready.model, {**spec.calibration.fixed, **_known(spec.genome, ready.model)})
        simulator = Simulator(RigSubject(ready.model), evaluator, genome, ready.searched, ())
        beats = float(spec.beats or 1)
        samplings = tuple(Sampling(beats, float(len(one.times))) for one in fitted)
        return cls(simulator, tuple(fitted), samplings, tuple(proposals), levels)

    @property
    def noise(self) -> PlannedNoise:
        """The noise that is assumed: the largest of each channel, in its unit."""
        found = dict[str, float]()
        for one in self.planned:
            level = self.levels[one.name].standard_deviation
            for name, value in zip(one.channels, level, strict=True):
                found[name] = max(found.get(name, 0.0), float(value))
        return PlannedNoise("", found, 0.0, None, self.levels[self.planned[0].name].source)

    def said(self, recording: AnyRecording, changes: Float[Array, "T C P"], sampling: Sampling) -> Said:
        """Return what ``recording`` says, repeated as often as ``sampling`` has beats."""
        level = self.levels[recording.name]
        seen = np.where(recording.valid[:, :, None], changes, 0.0) / level.standard_deviation[:, None]
        white = np.moveaxis(cosine_transform(np.moveaxis(seen, -1, 0)), 0, -1)
        found = Information.of(white.reshape(-1, white.shape[-1]), level.density.T.ravel())
        found = found.times(sampling.beats)
        genes = np.arange(len(self.simulator.free))
        return Said(found.about(genes), found)

    def own_genes(self, recording: AnyRecording) -> tuple[str, ...]:
        """Return the free genes that belong to ``recording`` alone."""
        return tuple(name for name in self.simulator.free if belongs_to(name, recording.name))


def _known(values: Mapping[str, float], model: Model) -> Mapping[str, float]:
    """Return ``values`` of genes by name; ValueError for one that ``model`` does not have."""
    names = [gene.name for gene in model.genes]
    for name in values:
        if name not in names:
            raise ValueError(
                f"the genome has a gene {name!r}, which the model does not have; it has {', '.join(names)}"
            )
    return values


def _started(rig: Rig, candidate: SeriesCandidate) -> dict[str, float]:
    """Return the estimates of the genes of a recording alone, with another start, within their bounds."""
    known = {gene.name: candidate.recording.estimates.get(gene.name, gene.nominal) for gene in rig.recording_genes}
    return {
        gene.name: float(np.clip(candidate.start * known[gene.name], gene.lower, gene.upper))
        for gene in rig.recording_genes
    }


def _new(found: Iterable[SeriesCandidate]) -> list[SeriesCandidate]:
    return [one for one in found if one.change != "as it was"][:MOST_SERIES]


def _axes(dataset: Dataset) -> tuple[str, ...]:
    return tuple(axis for axis in ("x", "z") if all(axis in one.forces for one in dataset.recordings))


def _sampling(recording: Recording, spec: PlanSpec) -> Sampling:
    """Return how ``recording`` was sampled, with the numbers that ``spec`` states."""
    found = seen_sampling(recording)
    return Sampling(float(spec.beats or found.beats), float(spec.frames or found.frames))


def _markers(wing: Wing | None, recording: Recording, spec: PlanSpec) -> tuple[str, ...]:
    if wing is None:
        return ()
    tracked = recording.markers
    if not is_described(recording):
        seen = np.isfinite(recording.positions).all(axis=2).any(axis=0)
        tracked = tuple(recording.markers[k] for k in np.flatnonzero(seen))
    if spec.markers is not None:
        return spread_markers(wing, [marker.name for marker in wing.markers], spec.markers)
    return tracked


def _blank(
    like: Recording,
    condition: Condition,
    name: str,
    sampling: Sampling,
    markers: tuple[str, ...],
    calibration: CalibrationSpec,
) -> Recording:
    blank = blank_on_grid(like, condition, name, sampling, markers)
    return blank if blank.kind == "tracks" else replace(blank, low_pass=fitted_through(calibration, blank))


def _unlike(one: Condition, other: Condition) -> tuple[bool, float]:
    return (one.airspeed > 0) != (other.airspeed > 0), abs(one.flap_frequency - other.flap_frequency)


def _candidate(blank: Recording, condition: Condition, recorded: Sequence[Recording]) -> Candidate:
    beyond = settings_beyond(condition, [one.condition for one in recorded])
    lag, incidence = float(np.degrees(condition.phase_lag)), float(np.degrees(condition.angle_of_attack))
    numbers = {
        "flap_frequency_hz": condition.flap_frequency,
        "phase_lag_deg": lag,
        "pressure_mbar": condition.pressure / 100.0,
        "airspeed_m_s": condition.airspeed,
        "angle_of_attack_deg": incidence,
    }
    words = f"{condition.flap_frequency:.3g} Hz, {lag:.3g} deg of lag, {condition.pressure / 100.0:.4g} mbar"
    if condition.airspeed > 0:
        words += f", {condition.airspeed:.3g} m/s at {incidence:.3g} deg"
    return Candidate(blank, words, numbers, beyond)
