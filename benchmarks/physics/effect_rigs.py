"""The two rigs on which effects are measured, the Robird's wing and the DelFly, with noise-free recordings."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
import numpy.typing as npt

from wingfit.records import Condition, Recording, Vehicle, Wing
from wingfit.sim.effects.contract import Effect
from wingfit.sim.solver.numerics import Numerics
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.virtual_rigs.balance import TRIALS, delfly
from wingfit.sim.virtual_rigs.balance import blank_recording as blank_forces
from wingfit.sim.virtual_rigs.campaign import FRAMES_PER_BEAT, SMALL, blank_recording, name_of, robird_wing
from wingfit.sim.wing.flexible_wing import FlexibleWing

Array = npt.NDArray[np.float64]
Kind = Literal["wing", "vehicle"]
AnyModel = FlexibleWing | BladeElementWing

RIGS: tuple[Kind, ...] = ("wing", "vehicle")
DIVISION = "11"
STEPS = Numerics(
    steps=144, periodic=4e-6, max_beats=40
)  # fixed steps, so that differences of motions are smooth in the genes
QUICK = (1, 5, 7)  # indices of the three conditions of a quick rig
FRAMES = 2 * (FRAMES_PER_BEAT + 1)
FORCE_BEATS, PER_BEAT = 3, 64


@dataclass(frozen=True, eq=False)
class Rig:
    """A simulated rig (the Robird's wing or the DelFly) with the conditions under which it is recorded.

    ``kind``: "wing" or "vehicle"; ``description``: the rig's data; ``unit``: factor from m or N to the mm or mN of the
    report; ``axes``: recorded force axes, none for a wing; ``quick``: whether to use only three conditions.
    """

    kind: Kind
    description: Wing | Vehicle
    unit: float
    axes: tuple[str, ...]
    quick: bool

    def stands_for(self, effect: Effect) -> str:
        """Return the name of the term of the vehicle's nominal model that is the same physics as ``effect``, or "".

        A model with that effect, and the one that it is compared with, omit this term.
        """
        known = self.kind == "vehicle" and effect.term in BladeElementWing(delfly()).terms
        return effect.term if known else ""

    def model(self, effect: Effect | None, *, without: str = "") -> AnyModel:
        """Return the rig's model with ``effect``, or without any effect.

        A vehicle's model omits the term ``without``, and the term that is the same physics as the effect.
        """
        names = (effect.name,) if effect else ()
        if isinstance(self.description, Wing):
            return FlexibleWing(self.description, DIVISION, numerics=STEPS, effects=names)
        bare = BladeElementWing(self.description)
        left_out = {without, self.stands_for(effect) if effect else ""}
        return replace(bare, terms=tuple(term for term in bare.terms if term not in left_out), effects=names)

    def by_default(self, effect: Effect | None, without: str) -> AnyModel:
        """Return the model as :meth:`model`, but with the simulator's default number of steps and accuracy."""
        model = self.model(effect, without=without)
        return replace(model, numerics=Numerics()) if isinstance(model, FlexibleWing) else model

    def recordings(self, without: str = "") -> tuple[Recording, ...]:
        """Return noise-free recordings of the nominal rig under every condition.

        ``without``: term that a vehicle's model omits, or "".
        """
        return _recorded(self, without)

    def timed(self) -> tuple[Recording, ...]:
        """Return every fourth (wing) or third (vehicle) recording, for measuring processor time."""
        return _recorded(self, "")[:: 4 if self.kind == "wing" else 3]

    def rms(self, difference: Array) -> float:
        """Return the RMS displacement of a marker (m), or RMS force along an axis (N).

        ``difference`` [D]: differences of all recorded values, one recording after the other.
        """
        per = difference.reshape(-1, 3 if self.kind == "wing" else 1)
        return float(np.sqrt((per**2).sum(axis=1).mean()))

    def changed(self, recordings: tuple[Recording, ...], difference: Array) -> tuple[Recording, ...]:
        """Return copies of the recordings to which ``difference`` is added.

        ``difference`` [D]: differences of all recorded values, one recording after the other.
        """
        ends = np.cumsum([recording.values.size for recording in recordings])
        parts = np.split(difference, ends[:-1])
        pairs = zip(recordings, parts, strict=True)
        return tuple(replace(one, values=one.values + part.reshape(one.values.shape)) for one, part in pairs)

    def parts(self, recordings: tuple[Recording, ...]) -> list[tuple[Recording, ...]]:
        """Return the groups of recordings that are fitted with the same gene values.

        All recordings of a wing form one group; for a vehicle each one is alone, as in Armanini et al. (2016).
        """
        return [recordings] if self.kind == "wing" else [(recording,) for recording in recordings]


@cache
def rig_of(kind: str, quick: bool) -> Rig:
    """Return the rig of this ``kind`` ("wing" or "vehicle"); ``quick``: with only three conditions."""
    if kind == "wing":
        return Rig("wing", robird_wing(), 1e3, (), quick)
    return Rig("vehicle", delfly(), 1e3, ("x", "z"), quick)


@cache
def _recorded(rig: Rig, without: str) -> tuple[Recording, ...]:
    wing = rig.kind == "wing"
    blanks = [_strobed(rig, condition) for condition, _ in SMALL] if wing else [_forces(k) for k in range(8)]
    if rig.quick:
        blanks = [blanks[k] for k in QUICK]
    model = rig.model(None, without=without)
    nominal = np.array([[gene.nominal for gene in model.genes]])
    return tuple(_filled(model, nominal, blank) for blank in blanks)


@cache
def recorded(rig: Rig, condition: Condition) -> Recording:
    """Return a simulated, noise-free recording of the nominal wing under ``condition``."""
    model = rig.model(None)
    return _filled(model, np.array([[gene.nominal for gene in model.genes]]), _strobed(rig, condition))


def _strobed(rig: Rig, condition: Condition) -> Recording:
    if not isinstance(rig.description, Wing):
        raise TypeError("only wings have tracks")
    blank = blank_recording(rig.description, condition, name_of(condition), FRAMES)
    strobe = condition.flap_frequency * (FRAMES_PER_BEAT + 1) / FRAMES_PER_BEAT
    return replace(blank, times=np.arange(FRAMES) / strobe)


def _forces(number: int) -> Recording:
    blank = blank_forces(TRIALS[number].condition, TRIALS[number].name)
    times = np.arange(FORCE_BEATS * PER_BEAT) / (PER_BEAT * TRIALS[number].condition.flap_frequency)
    return replace(blank, times=times, values=np.full((len(times), 2), np.nan), forces=("x", "z"))


def _filled(model: AnyModel, nominal: Array, blank: Recording) -> Recording:
    """Return the recording ``blank`` with the values that ``model`` simulates for the gene values ``nominal`` [1, G].

    For a wing the values are simulated twice: the start of the beat is estimated from the tracks, as for a real
    recording, so the second simulation uses the tracks of the first.
    """
    if isinstance(model, BladeElementWing):
        return replace(blank, values=model.observe(nominal, blank).channels[0])
    beat = model.beat(nominal[0], blank)
    if beat.reason is not None:
        raise ValueError(f"the nominal wing under {blank.name}: {beat.reason}")
    phase = np.round(len(beat.tracks) * blank.condition.flap_frequency * blank.times).astype(int)
    rough = beat.tracks[phase % len(beat.tracks)].reshape(len(blank.times), -1)
    placed = replace(blank, values=rough)
    return replace(blank, values=model.observe(nominal, placed).channels[0])
