"""The plan of the blind trials: which effect is hidden in which rig, how strongly, and the conditions of recordings."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import count, cycle, islice
from typing import Literal

import numpy as np

from benchmarks.concealed.answer import GROUPS, Group
from benchmarks.concealed.rigs import GRIDS, ROBIRD, Grid
from wingfit.records import Condition

TARGETS = (2.0, 3.0, 5.0)
AIR_PA, ROOM_K = 101_325.0, 293.15
LAGS = tuple(math.radians(degrees) for degrees in (0.0, 3.0, 7.0))
FREQUENCIES = ROBIRD.frequencies
THIN_PA, THICK_PA = 1_000.0, 100_000.0
INCIDENCE = math.radians(4.0)


@dataclass(frozen=True)
class Build:
    """A rig, with the discretisations of the diagnosed model and of the plant (the simulator that makes the data).

    ``division`` (model) and ``plant``: bodies of the wing, such as "8x4" (8 strips of 4 bodies), both "" for a vehicle;
    or another kind of plant, ROD or LATTICE.
    ``without``: force terms omitted both from the vehicle's model and from its plant. ``body``: which wing or vehicle.
    ``effects``: that the model has. ``by_nature``: effects that the plant always has, and this model does not.
    """

    rig: Literal["wing", "vehicle"]
    division: str = ""
    plant: str = ""
    without: tuple[str, ...] = ()
    body: str = "robird"
    effects: tuple[str, ...] = ()
    by_nature: tuple[str, ...] = ()

    @property
    def grid(self) -> Grid:
        """The conditions of its campaigns."""
        return GRIDS[self.body]


EQUAL, FINER = Build("wing", "4", "4"), Build("wing", "4", "8x1")
BEYOND = Build("wing", "4", "10x1")  # a discretisation that no diagnosis refines to by itself
ELEVEN, ELEVEN_FINER = Build("wing", "11", "11"), Build("wing", "11", "6x3")
WHOLE, WHOLE_FINER = Build("wing", "24", "24"), Build("wing", "24", "8x4")
BIRD, INSECT = Build("wing", "4", "9x1", body="bird"), Build("wing", "4", "8x1", body="insect")
ROD = "rod"  # as a plant: a continuous wing, in finite elements
STRIPS_ROD, FOUR_ROD = Build("wing", "8x1", ROD), Build("wing", "4", ROD)
BIRD_ROD, INSECT_ROD = replace(FOUR_ROD, body="bird"), replace(FOUR_ROD, body="insect")
BODIES_ONLY = (
    "backlash", "mass_offset", "tether", "cable", "rotational_circulation", "plate_drag", "viscous_drag",
    "compliant_drive",
)  # fmt: skip  # effects that only the multi-body plant has
FLING = "clap_and_peel"
VEHICLE, BARE = Build("vehicle", body="delfly"), Build("vehicle", without=(FLING,), body="delfly")
PAIR = Build("vehicle", body="pair")
LATTICE = "lattice"  # as a plant: an unsteady vortex lattice
IN_LATTICE = ("circulation_lag", "tip_loss", "wing_acceleration")  # what it has, and the quasi-steady model does not
VORTICES = Build("vehicle", plant=LATTICE, body="ornithopter", effects=IN_LATTICE)
MOVED = (
    "stroke_amplitude", "stroke_bias", "wing_pitch_zero", "wing_pitch_amplitude", "wing_pitch_phase", "residual_air",
)  # fmt: skip
VEHICLES = (VEHICLE, BARE, PAIR)  # some models omit the fling, so that its absence does not reveal what is hidden
SMALL = (
    FINER, EQUAL, BIRD, FOUR_ROD, BEYOND, INSECT, EQUAL, BIRD_ROD, FINER, BIRD, STRIPS_ROD, BEYOND, EQUAL, INSECT,
    INSECT_ROD, FINER,
)  # fmt: skip
WINGS = (*SMALL, ELEVEN, *SMALL, *SMALL, ELEVEN_FINER, *SMALL)


@dataclass(frozen=True)
class Trial:
    """One trial before it is recorded.

    Attributes:
        name: label that does not reveal what is hidden.
        group: the group it is counted in, such as "null" (nothing hidden) or "pairs" (two effects hidden).
        build: rig, model and plant.
        hidden: names of the hidden effects in the plant; empty in a null trial.
        target: intended strength of each hidden effect, misfit / noise after the nominal model is refitted.
        poor: whether its conditions are few and similar, so that several effects may explain the data.
        seed: of everything that is drawn for this trial.
    """

    name: str
    group: Group
    build: Build
    hidden: tuple[str, ...]
    target: float
    poor: bool
    seed: int


# What the trials of each rig hide. Effects that cannot be detected in noise of this size, or cannot be distinguished
# from others with data of this kind, are excluded (docs/concealed.md).
LISTED_WING = (
    "hinge_offset",
    "phase_lag_error",
    "drive_harmonics",
    "backlash",
    "lumped_mass",
    "damage",
    "added_mass",
    "leading_edge_vortex",
)
LISTED_VEHICLE = ("clap_and_peel", "induced_inflow", "circulation_lag", "stroke_amplitude")
UNLISTED_WING = ("stop", "appendage", "tooth")
UNLISTED_VEHICLE = ("stop_knock", "tail_in_wake")
SMOOTH_WING = ("band", "brake", "closed_cells")
SMOOTH_VEHICLE = ("inertial_camber",)
DRIFTS = ("stiffness_drift", "motor_drift")  # during every recording; the second is not in the library
FAULTS_WING = (
    "camera_shift",
    "camera_rotation",
    "lens_distortion",
    "marker_slip",
    "tracker_lag",
    "rolling_shutter",
    "scale_error",
)
FAULTS_VEHICLE = ("balance_tilt", "balance_resonance", "filter_delay", "balance_offset")
# Physics that looks like a fault of the measurement (docs/effects.md, "confused with").
LOOKALIKES_WING = ("hinge_offset", "hinge_tilt", "phase_lag_error", "stroke_amplitude")
LOOKALIKES_VEHICLE = ("circulation_lag", "induced_inflow")
PAIRS_WING = (
    ("hinge_offset", "added_mass"),
    ("hinge_tilt", "drive_harmonics"),
    ("stroke_amplitude", "lumped_mass"),
    ("drive_harmonics", "leading_edge_vortex"),
    ("camera_shift", "added_mass"),
)
PAIRS_VEHICLE = (("clap_and_peel", "balance_offset"), ("stroke_amplitude", "balance_tilt"))
# An effect of the library with a smaller one that is not: a part can be named, the rest cannot.
PARTLY_WING = (
    ("hinge_offset", "brake"),
    ("added_mass", "closed_cells"),
    ("drive_harmonics", "stop"),
    ("backlash", "band"),
)
PARTLY_VEHICLE = (
    ("stroke_amplitude", "inertial_camber"),
    ("balance_tilt", "stop_knock"),
    ("clap_and_peel", "tail_in_wake"),
)
# All others of the library, each once.
EVERY_WING = (
    "cubic_stiffness", "rod_slip", "hysteresis", "viscoelastic", "dynamic_stall", "plate_drag", "viscous_drag",
    "rotational_circulation", "residual_air", "stroke_bias", "mass_offset", "tether", "cable", "compliant_drive",
    "marker_swap", "exponential_smoothing", "strobe_rate",
)  # fmt: skip
EVERY_VEHICLE = (
    "airspeed_error", "body_pitch_error", "body_pitch_convention", "body_drag", "tail_lift", "residual_air",
    "stroke_bias", "wing_pitch_zero", "wing_pitch_amplitude", "wing_pitch_phase", "zero_lift_angle",
    "varying_coefficients", "dynamic_stall", "stall_vortex", "tip_loss", "wake_tip_loss", "downwash", "wake_capture",
    "mass_offset", "added_mass_error", "wing_acceleration", "inertial", "added_mass", "effective_chord", "translation",
    "rotational_circulation", "viscous", "balance_drift", "clock_offset", "scale_error", "axis_sign", "axis_swap",
    "unit_error", "phase_reference",
)  # fmt: skip
LATER = (
    "lift_curve", "leading_edge_suction", "axis_scale", "wing_mass_error", "elastic_twist", "wing_length_error",
    "wing_chord_error", "pitch_axis_error",
)  # fmt: skip
"""Effects of vehicles that came after trials were run: theirs come last, so that the others of a seed stay the same."""
LEFT_OUT = {
    "clap_and_peel": FLING, "inertial": "inertial", "added_mass": "added_mass", "effective_chord": "effective_chord",
    "translation": "translation", "rotational_circulation": "rotation", "viscous": "viscous",
}  # fmt: skip  # terms that the model of a vehicle does not have where an effect is hidden
ENTIRE = (
    *(name for name in LEFT_OUT if name != FLING),
    "axis_sign",
    "axis_swap",
    "unit_error",
    "phase_reference",
    "body_pitch_convention",
)
"""Effects of vehicles that are hidden as they are: whole terms, and faults that are choices."""
REST = 0.4  # of the strength of the effect that can be named
# Hidden in few similar conditions, so that other hypotheses may fit equally well: delays look like lags, tilted hinges
# like rotated cameras.
OPEN_WING = ("phase_lag_error", "rolling_shutter", "hinge_tilt", "tracker_lag", "camera_rotation", "camera_desync")
OPEN_VEHICLE = (
    "body_pitch_error", "airspeed_error", "stroke_bias", "wing_pitch_zero", "zero_lift_angle", "stroke_amplitude",
    "induced_inflow", "balance_tilt", "circulation_lag",
)  # fmt: skip

COUNTS: dict[str, int] = {
    "null": 150, "listed": 12, "unlisted": 12, "smooth": 8, "measurement": 60, "pairs": 21, "partly": 21, "every": 51,
    "drift": 20, "advice": 203,
}  # fmt: skip
QUICK: dict[str, int] = {
    "null": 6, "listed": 1, "unlisted": 1, "smooth": 1, "measurement": 4, "pairs": 2, "partly": 2, "every": 2,
    "drift": 1, "advice": 2,
}  # fmt: skip
SPARSE = 9  # every ninth null trial has as few recordings as an ambiguous one
QUICK_LATTICE = 6  # the quick sample contains every sixth of the trials in a vortex lattice
QUICK_KINDS = 3  # the quick sample contains every third of the listed and of the unlisted effects


def plan(seed: int, *, quick: bool = False, only: Sequence[str] = (), lattice: bool = False) -> tuple[Trial, ...]:
    """All trials of a test in random order, with names that reveal nothing; the same ``seed`` gives the same trials.

    ``quick``: a small sample; ``only``: names of the groups to include, all if empty; ``lattice``: also trials in a
    vortex lattice.
    """
    counts = QUICK if quick else COUNTS
    thinned = QUICK_KINDS if quick else 1
    drafts = [draft for group in GROUPS for draft in _group(group, counts[group], thinned)]
    drafts += of_lattice()[:: QUICK_LATTICE if quick else 1] if lattice else []
    order = np.random.default_rng([seed, 1]).permutation(len(drafts))
    shuffled = [drafts[k] for k in order]
    shuffled += [] if quick else [_draft("every", VEHICLE, (name,), TARGETS[1]) for name in LATER]
    named = [replace(draft, name=f"trial-{n:04d}", seed=seed * 100_000 + n) for n, draft in enumerate(shuffled)]
    return tuple(trial for trial in named if not only or trial.group in only)


def _group(group: Group, n: int, thinned: int) -> Iterator[Trial]:
    """The trials of a group, still without name and seed.

    ``n`` trials in all; for groups "listed", "unlisted" and "smooth", ``n`` trials of every ``thinned``-th effect; for
    "listed" also up to two (at most n // 7) of wings whose model has 24 bodies.
    """
    if group == "null":
        builds = [one for pair in zip((*SMALL, ELEVEN_FINER), cycle(VEHICLES), strict=False) for one in pair]
        large = (WHOLE, WHOLE_FINER)[: n // 50]
        drafts = [_draft(group, build) for build in (*large, *islice(cycle(builds), n - len(large)))]
        yield from (replace(draft, poor=k % SPARSE == SPARSE - 1) for k, draft in enumerate(drafts))
    elif group == "listed":
        yield from _each(group, LISTED_WING[::thinned], WINGS, n)
        yield from _each(group, LISTED_VEHICLE[::thinned], VEHICLES, n)
        whole = zip((WHOLE, WHOLE_FINER), LISTED_WING, strict=False)
        yield from (_draft(group, build, (name,), 3.0) for build, name in islice(whole, n // 7))
    elif group == "unlisted":
        yield from _each(group, UNLISTED_WING[::thinned], WINGS, n)
        yield from _each(group, UNLISTED_VEHICLE[::thinned], VEHICLES, n)
    elif group == "smooth":
        yield from _each(group, SMOOTH_WING[::thinned], WINGS, n)
        yield from _each(group, SMOOTH_VEHICLE, VEHICLES, n)
    elif group == "drift":
        which = [DRIFTS[(k + k // len(WINGS)) % len(DRIFTS)] for k in range(n)]
        yield from (_draft(group, WINGS[k % len(WINGS)], (name,)) for k, name in enumerate(which))
    elif group == "measurement":
        wing, vehicle = FAULTS_WING + LOOKALIKES_WING, 2 * (FAULTS_VEHICLE + LOOKALIKES_VEHICLE)
        yield from _mixed(group, [(name,) for name in wing], [(name,) for name in vehicle], n)
    elif group == "pairs":
        yield from _mixed(group, PAIRS_WING, PAIRS_VEHICLE, n)
    elif group == "every":
        found = _mixed(group, [(name,) for name in EVERY_WING], [(name,) for name in EVERY_VEHICLE], n)
        yield from (replace(draft, target=TARGETS[1]) for draft in found)
    elif group == "partly":
        found = _mixed(group, PARTLY_WING, PARTLY_VEHICLE, n)
        yield from (replace(draft, target=max(TARGETS)) for draft in found)
    else:
        found = _mixed(group, [(name,) for name in OPEN_WING], [(name,) for name in 5 * OPEN_VEHICLE], n)
        yield from (replace(draft, poor=True, target=2.0) for draft in found)


def of_lattice() -> list[Trial]:
    """The trials of the vehicle in a vortex lattice, still without name and seed: the lattice takes minutes a trial.

    Its model has all that the lattice has beyond a quasi-steady model, or all but one of these.
    """
    lag, *_, acceleration = IN_LATTICE
    without_one = [
        replace(VORTICES, effects=tuple(one for one in IN_LATTICE if one != name), by_nature=(name,))
        for name in (lag, acceleration)
    ]
    measured = zip(("balance_tilt", "filter_delay", "balance_offset"), TARGETS, strict=True)
    moved = zip(MOVED, cycle(TARGETS), strict=False)
    return [
        *(_draft("null", VORTICES) for _ in range(4)),
        *(_draft("listed", build) for build in without_one),
        *(_draft("listed", VORTICES, (name,), target) for name, target in moved),
        *(_draft("measurement", VORTICES, (name,), target) for name, target in measured),
    ]


def _each(group: Group, names: Sequence[str], builds: Sequence[Build], n: int) -> Iterator[Trial]:
    """``n`` trials of each effect in ``names``, cycling through TARGETS and ``builds``."""
    turn = count()
    for first, name in enumerate(names):
        for k in range(n):
            yield _draft(
                group,
                builds[next(turn) % len(builds)],
                (name,),
                TARGETS[(first + k + k // len(TARGETS)) % len(TARGETS)],
            )


def _mixed(
    group: Group, wing: Sequence[tuple[str, ...]], vehicle: Sequence[tuple[str, ...]], n: int
) -> Iterator[Trial]:
    """``n`` trials in all that cycle through the tuples of effects to hide in a ``wing`` and in a ``vehicle``."""
    kinds = [(names, True) for names in wing] + [(names, False) for names in vehicle]
    step = next(step for step in range(4, len(kinds) + 4) if math.gcd(step, len(kinds)) == 1)
    for k in range(n):  # with a stride, so that the first few contain both rigs
        names, flexible = kinds[(k * step + len(kinds) - 1) % len(kinds)]
        builds = WINGS if flexible else VEHICLES
        build = builds[(k // len(kinds) + k) % len(builds)]
        yield _draft(group, build, names, TARGETS[(k // len(kinds) + k // len(TARGETS)) % len(TARGETS)])


def _draft(group: Group, build: Build, hidden: tuple[str, ...] = (), target: float = 0.0) -> Trial:
    terms = tuple(LEFT_OUT[name] for name in hidden if name in LEFT_OUT)
    if terms and build.rig == "vehicle":
        build = replace(VEHICLE, without=terms)
    elif build.plant == ROD and set(hidden) & set(BODIES_ONLY):
        build = replace(build, plant=BEYOND.plant)
    return Trial("", group, build, hidden, target, False, 0)


def conditions(trial: Trial, rng: np.random.Generator) -> list[tuple[Condition, bool]]:
    """(condition, held out) of each recording of ``trial``; the conditions are drawn from ``rng``."""
    if trial.build.rig == "vehicle":
        return _flights(trial, rng)
    return _alike(trial.build.grid, rng) if trial.poor else _campaign(trial.build.grid, rng)


def _campaign(grid: Grid, rng: np.random.Generator) -> list[tuple[Condition, bool]]:
    """Conditions of three recordings in the vacuum chamber and two in the wind tunnel, plus one held out of each."""
    slow, fast = rng.permutation(grid.frequencies[:2])[0], rng.permutation(grid.frequencies[3:])[0]
    lags, speeds = rng.permutation(LAGS), np.sort(rng.permutation(grid.speeds)[:3])
    middle = grid.frequencies[2]
    return [
        (chamber(THIN_PA, lags[0], slow), False),
        (chamber(THIN_PA, lags[1], fast), False),
        (chamber(THICK_PA, lags[2], middle), False),
        (tunnel(lags[1], middle, speeds[0]), False),
        (tunnel(lags[0], fast, speeds[2]), False),
        (chamber(THIN_PA, lags[2], middle), True),
        (tunnel(lags[2], middle, speeds[1]), True),
    ]


def _alike(grid: Grid, rng: np.random.Generator) -> list[tuple[Condition, bool]]:
    """Conditions that differ in phase lag only: two fitted recordings, and a held-out one."""
    frequency, lags = float(rng.choice(grid.frequencies[1:4])), rng.permutation(LAGS)
    if rng.uniform() < 0.5:
        pressure = float(rng.choice([THIN_PA, THICK_PA]))
        return [(chamber(pressure, lag, frequency), k == 2) for k, lag in enumerate(lags)]
    speed = float(rng.choice(grid.speeds))
    return [(tunnel(lag, frequency, speed), k == 2) for k, lag in enumerate(lags)]


def _flights(trial: Trial, rng: np.random.Generator) -> list[tuple[Condition, bool]]:
    flights = trial.build.grid.flights
    order = rng.permutation(len(flights))
    if trial.poor:  # neighbours, which are as alike as flights can be
        order = rng.integers(len(flights) - 2) + np.arange(3)
    chosen = np.sort(order[:2]) if trial.poor else np.sort(order[:5])
    held_out = order[2:3] if trial.poor else order[5:7]
    return [(flight(*flights[k]), False) for k in chosen] + [(flight(*flights[k]), True) for k in held_out]


def any_condition(trial: Trial, known: Collection[str], rng: np.random.Generator) -> Condition:
    """A random condition of the rig whose name is not in ``known``."""
    return next(one for one in iter(lambda: _drawn(trial, rng), None) if name_of(one) not in known)


def _drawn(trial: Trial, rng: np.random.Generator) -> Condition:
    grid = trial.build.grid
    if trial.build.rig == "vehicle":
        return flight(*grid.flights[int(rng.integers(len(grid.flights)))])
    lag, frequency = float(rng.choice(LAGS)), float(rng.choice(grid.frequencies))
    if rng.uniform() < 0.5:
        return chamber(float(rng.choice([THIN_PA, 1e4, THICK_PA])), lag, frequency)
    return tunnel(lag, frequency, float(rng.choice(grid.speeds)))


def chamber(pressure: float, lag: float, frequency: float) -> Condition:
    """Condition in the vacuum chamber at ``pressure`` (Pa), phase ``lag`` (rad) and flap ``frequency`` (Hz)."""
    return Condition(float(frequency), float(lag), pressure, ROOM_K)


def tunnel(lag: float, frequency: float, airspeed: float) -> Condition:
    """Condition in the wind tunnel at phase ``lag`` (rad), flap ``frequency`` (Hz), ``airspeed`` (m/s), pitch 4 deg."""
    return Condition(float(frequency), float(lag), AIR_PA, ROOM_K, float(airspeed), INCIDENCE)


def flight(speed: float, pitch_deg: float, frequency: float) -> Condition:
    """Flight condition at ``speed`` (m/s), body pitch (deg) and flap ``frequency`` (Hz)."""
    return Condition(frequency, 0.0, AIR_PA, ROOM_K, speed, math.radians(pitch_deg))


def name_of(condition: Condition) -> str:
    """Name of a recording under ``condition``, such as ``chamber-0010mbar-lag3-2.50hz``."""
    end = f"{condition.flap_frequency:.2f}hz"
    if condition.airspeed > 0:
        pitch = math.degrees(condition.angle_of_attack)
        return f"stream-{condition.airspeed:.2f}ms-{pitch:.0f}deg-lag{math.degrees(condition.phase_lag):.0f}-{end}"
    return f"chamber-{condition.pressure / 100:04.0f}mbar-lag{math.degrees(condition.phase_lag):.0f}-{end}"
