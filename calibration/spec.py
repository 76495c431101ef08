"""The settings of a calibration, and the model that they select."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from wingfit.calibration.limits import REAL, WHOLE, refuse_number
from wingfit.records import Dataset
from wingfit.records.name_lists import refuse_no_mapping, refuse_text
from wingfit.sim.solver.numerics import ACCURACY, Numerics
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import chosen
from wingfit.sim.wing.flexible_wing import FlexibleWing

Mode = Literal["staged", "joint", "local"]
Method = Literal["genetic", "cma_es", "gauss_newton", "auto"]

OF_WINGS_AND_VEHICLES = (
    "division", "search_division", "bounds_factor", "accuracy", "preset", "without", "axes", "low_pass", "peel_width",
)  # fmt: skip  # settings that a rig with a simulation of the user's own does not have


@dataclass(frozen=True)
class CalibrationSpec:
    """Settings of a calibration.

    Defaults are those of van der Grinten's thesis (IV-E) for a wing, of Armanini et al. (2016) for a vehicle. Of a rig
    with a simulation of the user's own, settings in OF_WINGS_AND_VEHICLES must have their defaults.

    Attributes:
        division: rigid bodies of the simulated wing: a number ("4", "11", "24"), or bodies along the chord of each
            strip of the span, root first ("3,3,3,2").
        search_division: for wings only, with a method that searches and then ends with Gauss-Newton ("auto", or
            ``finish``): the search simulates the wing with this other, usually coarser discretisation, and Gauss-Newton
            goes on with ``division`` from what it found. None: both have ``division``.
        mode: "staged" (wings) fits structural genes on vacuum recordings, then aerodynamic ones on the rest; "joint"
            fits all genes to all recordings; "local" (vehicles) fits each recording by itself. None: staged for a
            wing (joint for a rigid one), local for a vehicle, joint for a rig of the user's own.
        population: individuals per generation.
        stall: generations without improvement of the best fitness after which a search ends.
        tolerance: smallest relative decrease of the best fitness that counts as an improvement.
        max_generations: largest number of generations of a stage's search, or of Gauss-Newton iterations where there
            is no search.
        seed: of the random generators; the same seed gives the same results, bit for bit.
        bounds_factor: genes are searched in [estimate / factor, estimate * factor]; for wings only.
        accuracy: largest numerical error (m) of any simulated marker at any instant (`sim/solver/numerics.py`).
        recordings: names of recordings to fit; empty means all that are not held out.
        genes: names of genes to search; empty means those that the model searches by default.
        fixed: values, by name, of genes that are not searched and have these values instead of their estimates.
        method: how a stage is searched. None: genetic for a wing, Gauss-Newton for a vehicle, auto for a rig of the
            user's own. "auto": a short genetic search, then Gauss-Newton from its best individuals
            (:mod:`wingfit.calibration.starts`).
        finish: whether Gauss-Newton follows each stage's search; with "auto", it does in any case.
        preset: blade-element model (:data:`wingfit.sim.vehicle.terms.PRESETS`); for vehicles only.
        without: names of terms of the preset that are omitted.
        axes: force axes that are fitted, of "x" and "z".
        low_pass: cut-off (Hz) of the low-pass for forces before they are fitted. None: 3.2 times the flap frequency
            (Armanini et al.: 40 Hz at 12.5 Hz); 0: none. Recordings with a ``low_pass`` of their own are not filtered.
        peel_width: beats over which the end of the peel (wings that touched have separated) is smoothed.
        effects: names of effects (`sim/effects/registry.py`; of a rig of the user's own: of its suspects) that the
            model contains; their genes start switched off and are searched, within bounds of their own, by default.
    """

    division: str = "11"
    mode: Mode | None = None
    population: int = 50
    stall: int = 10
    tolerance: float = 1e-3
    max_generations: int = 200
    seed: int = 1
    bounds_factor: float = 5.0
    accuracy: float = ACCURACY
    recordings: tuple[str, ...] = ()
    genes: tuple[str, ...] = ()
    fixed: Mapping[str, float] = field(default_factory=dict)
    method: Method | None = None
    finish: bool = False
    preset: str = "proposed"
    without: tuple[str, ...] = ()
    axes: tuple[str, ...] = ("x",)
    low_pass: float | None = None
    peel_width: float = 0.0
    effects: tuple[str, ...] = ()
    search_division: str | None = None

    def __post_init__(self) -> None:
        refuse_text(self, "recordings", "genes", "without", "axes", "effects")
        refuse_no_mapping(self, "fixed")


class SearchDivisionError(ValueError):
    """The discretisation of the search (``search_division``) is impossible, or does not fit dataset or method."""


def resolved(spec: CalibrationSpec, dataset: Dataset) -> CalibrationSpec:
    """Return ``spec`` with mode and method chosen; ValueError if one does not exist or does not fit ``dataset``.

    ValueError, too, for numbers beyond their limits (:mod:`wingfit.calibration.limits`).
    """
    wing = dataset.kind == "tracks"
    # The markers of a rigid wing show nothing that only vacuum or only air could.
    default: Mode = ("joint" if dataset.wing.structure == "rigid" else "staged") if wing else "local"
    mode, method = spec.mode or default, spec.method or ("genetic" if wing else "gauss_newton")
    _refuse_unknown(mode, method)
    if mode == "staged" and not wing:
        raise ValueError(
            "mode 'staged' separates a wing's structure from its aerodynamics, and this dataset describes a vehicle; "
            "use 'local' (each recording by itself) or 'joint' (all together)"
        )
    if mode == "local" and wing:
        raise ValueError(
            "mode 'local' fits each recording by itself, and a wing has one genome for all of them; "
            "use 'staged' or 'joint', and name a single recording to fit that alone"
        )
    _refuse_impossible(spec, method)
    _refuse_search_division(spec, method, wing=wing)
    return replace(spec, mode=mode, method=method)


def resolved_for_rig(spec: CalibrationSpec) -> CalibrationSpec:
    """Return ``spec`` with the mode and method of a rig with a simulation of the user's own.

    ValueError as in :func:`resolved`, and for a setting that only wings and vehicles have.
    """
    mode, method = spec.mode or "joint", spec.method or "auto"
    _refuse_unknown(mode, method)
    if mode != "joint":
        raise ValueError(
            f"mode {mode!r} is for wings or vehicles; a rig with a simulation of its own has one genome for all "
            "recordings: use 'joint', and name a single recording to fit that alone"
        )
    default = CalibrationSpec()
    for name in OF_WINGS_AND_VEHICLES:
        if getattr(spec, name) != getattr(default, name):
            raise ValueError(
                f"{name} {getattr(spec, name)!r} describes a wing or a vehicle, and this rig has a simulation of its "
                "own; leave it out"
            )
    _refuse_impossible(spec, method)
    return replace(spec, mode=mode, method=method)


def _refuse_unknown(mode: str, method: str) -> None:
    for what, value, known in (("mode", mode, get_args(Mode)), ("method", method, get_args(Method))):
        if value not in known:
            raise ValueError(f"unknown {what} {value!r}; there are {', '.join(known)}")


def _refuse_impossible(spec: CalibrationSpec, method: Method) -> None:
    for name in (*WHOLE, *REAL):
        refuse_number(name, getattr(spec, name))
    if method == "auto" and spec.finish:
        raise ValueError(
            "finish means nothing for the method auto, which ends with Gauss-Newton in any case; leave it out"
        )


def _refuse_search_division(spec: CalibrationSpec, method: Method, *, wing: bool) -> None:
    what = f"search_division {spec.search_division!r}"
    if spec.search_division is None:
        return
    if not wing:
        raise SearchDivisionError(
            f"{what} is a discretisation of a wing, and this dataset describes a vehicle; leave it out"
        )
    if method == "gauss_newton":
        raise SearchDivisionError(
            f"{what} is for a search, and method 'gauss_newton' has none; use method 'auto', or leave it out"
        )
    if method != "auto" and not spec.finish:
        raise SearchDivisionError(
            f"{what} with method {method!r} would end at the minimum of that discretisation, and not at that of "
            f"division {spec.division!r}; add finish (Gauss-Newton afterwards), use method 'auto', or leave it out"
        )


def wing_model(dataset: Dataset, spec: CalibrationSpec) -> FlexibleWing:
    """Return the model of a dataset of a wing; ValueError for an impossible discretisation, estimate or effect."""
    numerics = Numerics(accuracy=spec.accuracy)
    model = FlexibleWing(
        dataset.wing, spec.division, spec.bounds_factor, numerics, spec.effects, cameras=dataset.cameras
    )
    _ = model.structure, model.genes
    return model


def search_model(dataset: Dataset, spec: CalibrationSpec) -> FlexibleWing | None:
    """Return the model of a wing that only the search simulates, None if there is no ``search_division``.

    It has the genes of :func:`wing_model`, with the same bounds. SearchDivisionError for an impossible discretisation.
    """
    if spec.search_division is None:
        return None
    try:
        return wing_model(dataset, replace(spec, division=spec.search_division))
    except ValueError as error:
        raise SearchDivisionError(f"search_division: {error}; or leave it out") from None


def vehicle_model(dataset: Dataset, spec: CalibrationSpec) -> BladeElementWing:
    """Return the model of a dataset of a vehicle; ValueError for a term or effect that does not exist."""
    terms = chosen(spec.preset, spec.without)
    model = BladeElementWing(dataset.vehicle, terms, peel_width=spec.peel_width, effects=spec.effects)
    _ = model.genes
    return model


def model_for(dataset: Dataset, spec: CalibrationSpec) -> FlexibleWing | BladeElementWing:
    """Return the model for ``dataset``: of a flexible wing for tracks, of a blade-element wing for forces."""
    return wing_model(dataset, spec) if dataset.kind == "tracks" else vehicle_model(dataset, spec)
