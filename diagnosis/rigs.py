"""Prepare the two known rigs for a diagnosis: a flexible wing seen by cameras, and a vehicle on a force balance."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from wingfit.calibration.effects import sizes
from wingfit.calibration.preparation import fitted_through
from wingfit.calibration.spec import CalibrationSpec, model_for
from wingfit.diagnosis.candidate_conditions import candidate_conditions, normalised
from wingfit.diagnosis.subject import BeatSubject, ChannelLocation
from wingfit.records import Condition, Dataset, Recording, RigLimits, Vehicle, Wing
from wingfit.records.array_types import Array, Float
from wingfit.records.dataset import ForceAxis
from wingfit.rigs.suspect import Suspect
from wingfit.sim.effects.contract import Cameras, Effect
from wingfit.sim.effects.probe import Probe
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.model import Model
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import PRESETS
from wingfit.sim.wing.alignment import recorded_crossing
from wingfit.sim.wing.division import Division
from wingfit.sim.wing.flexible_wing import FlexibleWing
from wingfit.sim.wing.planform import Planform
from wingfit.sim.wing.probing import Probed, probed

MAX_BODIES = 64  # of a finer wing; one individual of 80 bodies takes ten times as long as one of 24
MAX_ELEMENTS = 640
FORCE_TOLERANCE = 1e-3  # of the root mean square force: far below the resolution of any balance
MAX_MARKERS_TRIED = 64  # as candidates for the fault of a marker
_LOCATION_GENES: dict[str, Literal["span", "chord"]] = {"station": "span", "chord": "chord"}


def subject_of(dataset: Dataset, spec: CalibrationSpec) -> BeatSubject:
    """Return the rig of ``dataset`` with the nominal model of ``spec``; ValueError where that model does not exist.

    Effects that ``spec`` names are part of the nominal model, and no suspects.
    """
    model = model_for(dataset, spec)
    if isinstance(model, FlexibleWing):
        return WingSubject(dataset, model)
    return VehicleSubject(dataset, model, spec)


@dataclass(frozen=True, eq=False)
class _Rig:
    """What both rigs share: the ``dataset``, the nominal ``model``, and conditions that could be recorded."""

    dataset: Dataset
    model: FlexibleWing | BladeElementWing

    def extended(self, names: Sequence[str]) -> Model:
        """Return the nominal model with the effects ``names`` added, switched off."""
        return self.model.with_effects(*names)

    @property
    def rig_limits(self) -> RigLimits | None:
        """What the rig allows; None if that is not stated."""
        return self.dataset.rig_limits

    def candidate_conditions(self) -> tuple[Condition, ...]:
        """Return conditions that could be recorded next (:func:`.candidate_conditions.candidate_conditions`)."""
        return candidate_conditions(self.dataset.recordings, self.dataset.rig_limits)

    def simulated_recording(self, model: Model, genome: Float[Array, " G"], condition: Condition) -> Recording | None:
        """Return what the rig would record of ``model`` with ``genome`` [G] under ``condition``; None if that fails.

        These are tracks of all markers, or forces along both axes, low-passed as for a fit, sampled at the phases of
        the recording of the most similar condition.
        """
        blank = self._blank(condition)
        seen = model.observe(genome[None], blank)
        return None if seen.reasons[0] is not None else replace(blank, values=seen.channels[0])

    def _blank(self, condition: Condition) -> Recording:
        """Return a recording under ``condition`` whose values are all NaN."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class WingSubject(_Rig):
    """A flexible wing, recorded as marker tracks."""

    model: FlexibleWing

    @cached_property
    def suspects(self) -> tuple[Suspect, ...]:
        """Effects that apply to a wing and are not in the nominal model."""
        return _suspects(self.model.wing, self.model.effects, self.model.cameras)

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """Leading edge from root to tip and trailing edge back, a closed polygon of (x, y) in m."""
        stations = self.model.wing.stations
        front = [(s.leading_edge, s.y) for s in stations]
        rear = [(s.leading_edge + s.chord, s.y) for s in reversed(stations)]
        return (*front, *rear, front[0])

    @property
    def description(self) -> str:
        """The nominal model in one line of text for the user."""
        if self.model.wing.structure == "rigid":
            return "rigid wing" + _effects_text(self.model.effects)
        bodies = Division.parse(self.model.division).bodies
        along = ", ".join(map(str, bodies)) if len(set(bodies)) > 1 else f"{bodies[0]} each"
        words = f"flexible wing of {sum(bodies)} bodies in {len(bodies)} strips ({along})"
        return words + _effects_text(self.model.effects)

    def with_initial_motion(self, model: Model, genome: Float[Array, " G"]) -> Model:
        """Return ``model``; its search for the periodic motion starts at that of ``genome`` [G] without effects."""
        return model.beside(genome) if isinstance(model, FlexibleWing) else model

    def finer_subjects(self) -> tuple[WingSubject, ...]:
        """Return wings of more bodies: with more strips, then also with the next even number of bodies along the chord.

        More strips alone do not show the chordwise bending that a discretisation omits, which is most of the error of a
        coarse one (Robird wing with 4 bodies: 4 to 6 mm, in 8 strips no less; with 24 bodies 1 mm), except where the
        chord does not bend. An even number, because an odd number is worse than one fewer: 18 bodies, 3 along the
        chord, 3 to 5 mm. Where twice the strips fit no better, a chord that does not bend is tried with a single strip
        more, in case the wing bends at a few joints. Wings of more than MAX_BODIES are omitted. A rigid wing has no
        discretisation.
        """
        if self.model.wing.structure == "rigid":
            return ()
        bodies = Division.parse(self.model.division).bodies
        chordwise, strips = max(bodies), len(bodies) + 2
        flat = [(2 * len(bodies), 1), (len(bodies) + 1, 1)] if 2 * len(bodies) <= MAX_BODIES else []
        finer = [*(flat if chordwise == 1 else [(strips, chordwise)]), (strips, chordwise // 2 * 2 + 2)]
        return tuple(
            replace(self, model=replace(self.model, division=f"{along}x{across}"))
            for along, across in finer
            if along * across <= MAX_BODIES
        )

    def channel_locations(self, recording: Recording) -> tuple[ChannelLocation, ...]:
        """Return three channels (x, y, z) for each marker, at its position at rest."""
        wing, planform, found = self.model.wing, Planform(self.model.wing), []
        for name in recording.markers:
            x, y, _ = wing.marker(name).position
            place = _station(wing, y), float(planform.fraction(x, y)), x, y
            found += [ChannelLocation(name, axis, *place) for axis in "xyz"]
        return tuple(found)

    def beat_start_phase(self, recording: Recording) -> float:
        """Return the phase (rad) at which the mean height of the reference markers rises past that of the hinge."""
        return recorded_crossing(self.model.wing, recording)

    def _blank(self, condition: Condition) -> Recording:
        markers = tuple(marker.name for marker in self.model.wing.markers)
        return _empty_recording(self.dataset, condition, markers=markers)

    def probe_responses(self, genome: Float[Array, " G"], recording: Recording, probe: Probe) -> Probed | None:
        """Return the tracks' responses to the unit loads of ``probe``; None where they cannot be simulated."""
        try:
            return probed(self.model, genome, recording, probe)
        except ValueError:
            return None


@dataclass(frozen=True, eq=False)
class VehicleSubject(_Rig):
    """A flapping vehicle, recorded as forces; ``spec`` says how these are filtered for the fit."""

    model: BladeElementWing
    spec: CalibrationSpec

    @cached_property
    def suspects(self) -> tuple[Suspect, ...]:
        """Effects that apply to the vehicle and are in the nominal model neither as an effect nor as a term."""
        unfit = {name for name, effect in EFFECTS.items() if not effect.fits(self.model.terms)}
        known = unfit.union(self.model.effects)
        return _suspects(self.model.vehicle, known if self.model.vehicle.claps else known | {"clap_and_peel"})

    @property
    def outline(self) -> tuple[tuple[float, float], ...]:
        """Empty: forces do not show where on a wing they act."""
        return ()

    @property
    def description(self) -> str:
        """The nominal model in one line of text for the user."""
        terms = set(self.model.terms)
        preset = min(PRESETS.values(), key=lambda one: len(terms ^ set(one.terms)))
        missing = [name for name in preset.terms if name not in terms]
        more = [name for name in self.model.terms if name not in preset.terms]
        changed = [f"without {', '.join(missing)}"] * bool(missing) + [f"with {', '.join(more)}"] * bool(more)
        words = f"quasi-steady blade elements, model {preset.name!r} ({preset.description})"
        return words + "".join(f", {one}" for one in changed) + _effects_text(self.model.effects)

    def with_initial_motion(self, model: Model, genome: Float[Array, " G"]) -> Model:  # noqa: ARG002  # part of the protocol
        """Return ``model`` unchanged: the motion of its wings is prescribed."""
        return model

    def finer_subjects(self) -> tuple[VehicleSubject, ...]:
        """Return a model of twice the elements and instants; none if its forces differ little or it is too large."""
        return self._finer

    @cached_property
    def _finer(self) -> tuple[VehicleSubject, ...]:
        finer = replace(self.model, elements=2 * self.model.elements, instants=2 * self.model.instants)
        if finer.elements > MAX_ELEMENTS or not self._changes(finer):
            return ()
        return (replace(self, model=finer),)

    def _changes(self, finer: BladeElementWing) -> bool:
        nominal = np.array([[gene.nominal for gene in self.model.genes]])
        for recording in self.dataset.recordings:
            own, other = (model.beat(nominal, recording)[0] for model in (self.model, finer))
            if np.sqrt(np.mean((own - other[::2]) ** 2)) > FORCE_TOLERANCE * np.sqrt(np.mean(own**2)):
                return True
        return False

    def channel_locations(self, recording: Recording) -> tuple[ChannelLocation, ...]:
        """Return the axis of each force channel; a force has no location."""
        return tuple(ChannelLocation(f"force_{axis}", axis) for axis in recording.forces)

    def beat_start_phase(self, recording: Recording) -> float:  # noqa: ARG002 - the protocol's
        """Return zero: the times of forces count from the start of a beat."""
        return 0.0

    def _blank(self, condition: Condition) -> Recording:
        blank = _empty_recording(self.dataset, condition, forces=("x", "z"))
        return replace(blank, low_pass=fitted_through(self.spec, blank))

    def probe_responses(self, genome: Float[Array, " G"], recording: Recording, probe: Probe) -> None:
        """Return None: recordings of forces show the missing force directly."""


# -- suspects --------------------------------------------------------------------------------------------------


def _suspects(rig: Wing | Vehicle, known: Collection[str], cameras: Cameras = ()) -> tuple[Suspect, ...]:
    return tuple(
        _suspect(effect, rig, cameras)
        for effect in EFFECTS.values()
        if effect.applies_to(rig) and effect.name not in known
    )


def _suspect(effect: Effect, rig: Wing | Vehicle, cameras: Cameras) -> Suspect:
    places = [p.name for p in effect.parameters if p.place and p.name in _LOCATION_GENES]
    location_genes = {_LOCATION_GENES[name]: f"{effect.name}.{name}" for name in places}
    shapes = _marker_shapes(rig) if location_genes and effect.port == "observation" and isinstance(rig, Wing) else ()
    return Suspect(
        name=effect.name,
        title=effect.title,
        family=effect.family,
        genes=effect.genes(rig, cameras),
        size_genes=sizes(effect),
        typical=effect.typical(rig, cameras),
        source=effect.source,
        signature=effect.signature,
        location_genes=location_genes,
        confused_with=effect.confused_with,
        descriptive=effect.descriptive,
        candidate_shapes=shapes,
        positions={f"{effect.name}.{p.name}": p.positions for p in effect.size if p.positions},
    )


def _marker_shapes(wing: Wing) -> tuple[tuple[float, float], ...]:
    """Return (span, chord), 0 to 1, of up to MAX_MARKERS_TRIED markers, the candidates for the fault of a marker."""
    planform, every = Planform(wing), -(-len(wing.markers) // MAX_MARKERS_TRIED)
    places = (marker.position[:2] for marker in wing.markers[::every])
    return tuple((_station(wing, y), float(np.clip(planform.fraction(x, y), 0.0, 1.0))) for x, y in places)


def _station(wing: Wing, y: float) -> float:
    return float(np.clip((y - wing.stations[0].y) / wing.span, 0.0, 1.0))


def _effects_text(effects: Sequence[str]) -> str:
    """Return the names of ``effects`` as text that is appended to the description of a model; empty for none."""
    return f", with {', '.join(repr(EFFECTS[name].title) for name in effects)}" if effects else ""


# -- conditions ------------------------------------------------------------------------------------------------


def _empty_recording(
    dataset: Dataset, condition: Condition, markers: tuple[str, ...] = (), forces: tuple[ForceAxis, ...] = ()
) -> Recording:
    """Return a recording under ``condition`` of the channels ``markers`` or ``forces``, with all values NaN.

    All else is that of the recording under the most similar condition. Its samples are at the same phases of the beat,
    so that it contains as much information.
    """
    like = min(dataset.recordings, key=lambda recording: _dissimilarity(dataset, recording.condition, condition))
    times = like.times * (like.condition.flap_frequency / condition.flap_frequency)
    values = np.full((len(times), 3 * len(markers) + len(forces)), np.nan)
    return replace(
        like,
        name=_name(condition),
        condition=condition,
        times=times,
        markers=markers,
        forces=forces,
        values=values,
        standard_deviation=None,
        noise_correlation=None,
    )


def _name(condition: Condition) -> str:
    """Return the name of a recording under ``condition``."""
    lag, incidence = np.degrees(condition.phase_lag), np.degrees(condition.angle_of_attack)
    return (
        f"{condition.flap_frequency:g}hz-lag{lag:.3g}deg-{condition.pressure / 100.0:g}mbar-{condition.airspeed:g}ms-"
        f"{incidence:.3g}deg"
    )


def _dissimilarity(dataset: Dataset, one: Condition, other: Condition) -> tuple[bool, float]:
    """Return whether only one of two conditions has an air stream, and their distance otherwise, for sorting."""
    positions = normalised([one, other], [recording.condition for recording in dataset.recordings])
    return (one.airspeed > 0) != (other.airspeed > 0), float(np.linalg.norm(positions[0] - positions[1]))
