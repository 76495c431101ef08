"""Makes, of settings and a dataset, what is fitted: model, filtered recordings, free genes and stages.

Settings that do not fit the dataset raise ValueError here, before anything is simulated.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.calibration.effects import group_of, refuse_idle, sizes
from wingfit.calibration.forces.split_beats import Cut
from wingfit.calibration.problem import base_genome, compared
from wingfit.calibration.spec import CalibrationSpec, Mode, model_for, resolved, resolved_for_rig, search_model
from wingfit.inference.noise.series import known_noise
from wingfit.records import AnyRecording, Dataset, LowPass, Recording, SeriesDataset
from wingfit.records.recorded import R, Recorded
from wingfit.rigs.dataset_model import model_of
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.filtering import default_cutoff, low_passed
from wingfit.sim.model import Model
from wingfit.sim.vehicle.terms import DRAG
from wingfit.sim.wing.alignment import recorded_crossing
from wingfit.sim.wing.flexible_wing import FlexibleWing

VACUUM_LIMIT = 10_000.0  # Pa: still air at no more than this pressure counts as vacuum in a staged calibration


@dataclass(frozen=True)
class Stage:
    """One search of a calibration: the genes ``free`` are fitted to ``recordings`` (forces: already low-passed)."""

    name: str
    free: tuple[str, ...]
    recordings: tuple[AnyRecording, ...]


@dataclass(frozen=True)
class Prepared:
    """A dataset as a calibration or a diagnosis uses it.

    Attributes:
        spec: settings, with mode and method chosen.
        model: the simulation, with the requested effects.
        stages: searches in their order; a joint calibration has one.
        held_out: recordings that are never fitted, filtered like those that are.
        search_model: the simulation that the search before Gauss-Newton uses, with the same genes; None: ``model``.
    """

    spec: CalibrationSpec
    model: Model
    stages: tuple[Stage, ...]
    held_out: tuple[AnyRecording, ...]
    search_model: FlexibleWing | None = None

    @property
    def searched(self) -> tuple[str, ...]:
        """Names of the genes that any stage searches."""
        return tuple(dict.fromkeys(name for stage in self.stages for name in stage.free))


def prepare(spec: CalibrationSpec, dataset: Dataset) -> Prepared:
    """Choose model, stages and filters, without simulating; ValueError if ``spec`` does not fit ``dataset``."""
    spec = resolved(spec, dataset)
    model, coarse = model_for(dataset, spec), search_model(dataset, spec)
    free = searched_genes(spec, model)
    fitted = _fitted(spec, dataset)
    for recording in dataset.recordings:  # all of them are judged in the end
        _refuse_unusable(spec, dataset, recording, recording in fitted)
    stages = _stages(spec.mode, free, tuple(as_fitted(spec, recording) for recording in fitted))
    held_out = tuple(as_fitted(spec, one) for one in dataset.recordings if one.name in dataset.held_out)
    return Prepared(spec, model, stages, held_out, coarse)


def prepare_rig(spec: CalibrationSpec, rig: Rig, dataset: SeriesDataset) -> Prepared:
    """Prepare a calibration of ``rig``, without simulating; ValueError if ``spec``, ``rig``, ``dataset`` do not fit.

    There is one stage, "joint", whose model is a :class:`wingfit.rigs.rig_model.RigModel`. Genes that belong to a
    recording that is not fitted are not free.
    """
    spec = resolved_for_rig(spec)
    model = model_of(rig, dataset)
    _refuse_repeated("effect", spec.effects)
    model = model.with_effects(*spec.effects)
    _refuse_genes(spec, model)
    fitted = _fitted(spec, dataset)
    for recording in dataset.recordings:
        if not recording.valid.any():
            raise ValueError(
                f"recording {recording.name!r} has no value of any channel; there is nothing to compare: leave the "
                "recording out of the dataset"
            )
    known_noise(dataset.recordings)  # refuses repeats that differ
    free = _free(spec, model, _elsewhere(spec, model, dataset, [one.name for one in fitted]))
    refuse_idle({one.name: one.size_genes for one in model.added}, free, spec.fixed)
    return Prepared(spec, model, (Stage("joint", free, fitted),), dataset.select(dataset.held_out))


def searched_genes(spec: CalibrationSpec, model: Model) -> tuple[str, ...]:
    """Return the genes of a wing's or a vehicle's ``model`` that ``spec`` searches; ValueError if they do not fit."""
    _refuse_genes(spec, model)
    if isinstance(model, FlexibleWing):
        _refuse_without_influence(spec, model)
    free = _free(spec, model)
    refuse_idle({name: sizes(EFFECTS[name]) for name in spec.effects}, free, spec.fixed)
    return free


def _elsewhere(spec: CalibrationSpec, model: RigModel, dataset: SeriesDataset, fitted: Sequence[str]) -> set[str]:
    """Return the genes of recordings not in ``fitted`` (names); ValueError if ``spec`` requests one of them."""
    found = {
        gene.name: one.name for one in dataset.recordings if one.name not in fitted for gene in model.genes_of(one)
    }
    for name in spec.genes:
        if name in found:
            raise ValueError(
                f"gene {name!r} belongs to recording {found[name]!r}, which is not fitted; fit this recording, or "
                "leave the gene out"
            )
    return set(found)


def _refuse_genes(spec: CalibrationSpec, model: Model) -> None:
    """Raise ValueError if ``spec`` names a gene twice or one unknown to ``model``, or fixes one beyond its bounds."""
    _refuse_repeated("gene", spec.genes)
    known = [gene.name for gene in model.genes]
    for name in (*spec.genes, *spec.fixed):
        if name not in known:
            raise ValueError(f"unknown gene {name!r}; there are {', '.join(known)}")
    base_genome(model, spec.fixed)


def _refuse_without_influence(spec: CalibrationSpec, model: FlexibleWing) -> None:
    """Raise ValueError if ``spec`` requests a gene that cannot be estimated, or if there is none that can."""
    structure = model.wing.structure
    for name in spec.genes:
        if name in model.idle:
            raise ValueError(
                f"gene {name!r} has no influence on a wing with structure {structure!r} and cannot be estimated; leave "
                f"it out (genes with influence: {', '.join(model.searched) or 'none'})"
            )
    if not model.searched:
        raise ValueError(
            "nothing to calibrate: the wing is rigid, so that its markers follow the drive, whatever its stiffness and "
            "the air; describe it with structure: sheet to estimate a stiffness, or include an effect of the drive or "
            "the cameras: --with stroke_amplitude (over HTTP: effects)"
        )


def _free(spec: CalibrationSpec, model: Model, never: Collection[str] = ()) -> tuple[str, ...]:
    """Return the genes to search, in the order of ``model`` and without those of ``never``; ValueError if none is."""
    wanted = spec.genes or (*model.searched, *(DRAG if len(spec.axes) > 1 else ()))
    known = [gene.name for gene in model.genes]
    free = tuple(name for name in known if name in wanted and name not in spec.fixed and name not in never)
    if not free:
        raise ValueError("nothing to calibrate: every gene is fixed, or the model has none that is searched by itself")
    return free


def _fitted(spec: CalibrationSpec, dataset: Recorded[R]) -> tuple[R, ...]:
    """Return the recordings to be fitted, unfiltered; ValueError if one is held out or repeated, or there is none."""
    _refuse_repeated("recording", spec.recordings)
    recordings = dataset.select(spec.recordings) if spec.recordings else dataset.fitted
    if not recordings:
        raise ValueError("every recording of the dataset is held out, and nothing is left to fit; hold out fewer")
    for recording in recordings:
        if recording.name in dataset.held_out:
            raise ValueError(f"recording {recording.name!r} is held out; a calibration must not fit it")
    return recordings


def _refuse_repeated(what: str, names: tuple[str, ...]) -> None:
    for name, times in Counter(names).items():
        if times > 1:
            raise ValueError(f"{what} {name!r} is named {times} times; name it once")


def _stages(mode: Mode | None, free: tuple[str, ...], recordings: tuple[Recording, ...]) -> tuple[Stage, ...]:
    if mode == "joint":
        return (Stage("joint", free, recordings),)
    if mode == "local":
        return tuple(Stage(recording.name, free, (recording,)) for recording in recordings)
    return _staged(free, recordings)


def as_fitted(spec: CalibrationSpec, recording: Recording) -> Recording:
    """Return ``recording`` as it is fitted: forces low-passed, unless they already are or ``spec`` has no filter."""
    through = fitted_through(spec, recording)
    return recording if through in (None, recording.low_pass) else low_passed(recording, through)


def fitted_through(spec: CalibrationSpec, recording: Recording) -> LowPass | None:
    """Return the low-pass of the forces that are fitted, whoever applied it; None for tracks and unfiltered forces.

    A recording that is already low-passed keeps its filter; otherwise ``spec`` defines it.
    """
    if recording.kind == "tracks" or spec.low_pass == 0 or recording.low_pass is not None:
        return recording.low_pass
    return LowPass(spec.low_pass or default_cutoff(recording.condition.flap_frequency))


def _staged(free: tuple[str, ...], recordings: tuple[Recording, ...]) -> tuple[Stage, ...]:
    """Return two stages: structural genes in vacuum, aerodynamic genes in air (van der Grinten's thesis, Fig. 2).

    Genes of effects that are not aerodynamic are fitted in vacuum. A stage without genes is omitted. ValueError if a
    stage has genes but no recordings.
    """
    vacuum = tuple(r for r in recordings if r.condition.airspeed == 0 and r.condition.pressure <= VACUUM_LIMIT)
    air = tuple(r for r in recordings if r not in vacuum)
    structural = tuple(name for name in free if group_of(name) == "structure")
    aerodynamic = tuple(name for name in free if group_of(name) == "aerodynamics")
    if (structural and not vacuum) or (aerodynamic and not air):
        missing, which = ("vacuum", "structural") if structural and not vacuum else ("air", "aerodynamic")
        raise ValueError(
            f"a staged calibration fits the {which} genes on recordings in {missing}, and there is none "
            f"(vacuum: airspeed 0 and at most {VACUUM_LIMIT / 100:g} mbar); use mode 'joint' (--mode joint) "
            "or name other genes"
        )
    stages = (Stage("structure", structural, vacuum), Stage("aerodynamics", aerodynamic, air))
    return tuple(stage for stage in stages if stage.free)


def _refuse_unusable(spec: CalibrationSpec, dataset: Dataset, recording: Recording, fitted: bool) -> None:
    if dataset.kind == "forces":
        if fitted and not compared(recording, spec.axes).any():
            raise ValueError(
                f"recording {recording.name!r} has no instant with all of the fitted force axes "
                f"({', '.join(spec.axes)}); there is nothing to compare: leave the recording out of the dataset"
            )
        Cut.of(as_fitted(spec, recording))
        return
    if not np.isfinite(recording.positions).all(axis=2).any():
        raise ValueError(
            f"recording {recording.name!r} has no marker with all of x, y and z in any frame; "
            "there is nothing to compare: leave the recording out of the dataset"
        )
    recorded_crossing(dataset.wing, recording)
