"""Free decays of heave and pitch of a wing on springs, without wind (Lee et al.): what a linear model leaves out.

``flutter-still-air/Measured_data.mat`` (model 1) and ``Measured_data2.mat`` (model 2) hold one decay each, at 5 kHz:
pitch in rad, and heave in volts with the sensitivity ``sen`` (m/V). Decided from the physics, before fitting:

- **Samples.** Every fiftieth: 100 Hz, forty times the frequencies of the motion (2 to 3 Hz). Positions at rest are the
  means of the last 300 samples, as the authors take them.
- **Accepted error.** 12.5 % of the root mean square of pitch and of heave: what is documented to remain of the motion
  with quadratic and cubic stiffness in the model; a linear model leaves 32 %.
- **Parts.** The window starts where the authors' begins, 1 s (model 1) or 0.2 s (model 2) after the largest heave, so
  that nothing holds the wing any more. Of three parts of 1 s, the first and third are fitted and the second is held
  out: the amplitude of the held-out part lies between those of the others. Each part starts with a state of its own.
- **Nominal model.** Linear, two degrees of freedom, with the air's added mass, as in the authors' ``Flutter_rig``;
  masses and geometry as in the file, which also gives the estimates of what is fitted: inertia, stiffnesses, damping.
- **Suspects.** All laws at pitch and at heave, a wrong centre of gravity, and all faults of the channels.

Documented are quadratic and cubic stiffness in pitch. Friction is not documented, but both decays end at rest after a
few seconds, as with dry friction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.real.trial import Trial, read_mat
from wingfit.records import Channel, Gene, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.records.series import Quantity
from wingfit.rigs.ports import Port
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run
from wingfit.rigs.suspect import Suspect

EVERY = 50  # samples of 0.2 ms
PART = 100  # samples of a part, 1 s
PARTS, HELD_OUT = 3, (2,)
ACCEPTED = 0.125  # of the root mean square of a channel
REST = 300  # samples at the end, at rest
RTOL = 1e-7  # of the integration
MOMENT, FORCE = 8.0, 200.0  # N m, N: those of the springs (60 N m/rad, 3400 N/m) at the largest pitch and heave
FILES = {1: ("Measured_data.mat", 1.0), 2: ("Measured_data2.mat", 0.2)}  # file, s after the largest heave
SQUARE, CUBIC = "square_stiffness.pitch", "cubic_stiffness.pitch"


@dataclass(frozen=True)
class Wing:
    """What the file states: masses (kg), geometry, and estimates of inertia, stiffness and damping (SI units)."""

    wing_mass: float
    mass: float
    semi_chord: float
    axis: float
    unbalance: float
    air: float
    inertia: float
    pitch_stiffness: float
    heave_stiffness: float
    pitch_damping: float
    heave_damping: float

    @property
    def added(self) -> tuple[float, float, float]:
        """Added mass, moment and inertia of the air."""
        a, b = self.axis, self.semi_chord
        unit = np.pi * self.air * b**2
        return unit, -a * b * unit, (0.125 + a**2) * b**2 * unit


def read(model: int, folder: Path) -> tuple[Wing, Array, Array]:
    """Return the wing, pitch (rad) and heave (m) [N] about their positions at rest, at 5 kHz."""
    found = read_mat(folder / "flutter-still-air" / FILES[model][0])
    one = {name: float(value.item()) for name, value in found.items() if getattr(value, "size", 0) == 1}
    pitch, heave = found["data"][0], found["data"][1] * one["sen"]
    inertia = one["m"] * (one["b"] * one["r_a"]) ** 2
    wing = Wing(
        one["m"],
        one["m__T"],
        one["b"],
        one["a"],
        one["m"] * one["x__alpha"] * one["b"],
        one["rho"],
        inertia,
        inertia * one["w_a"] ** 2,
        one["m__T"] * one["w_h"] ** 2,
        one["c__alpha"],
        one["c__h"],
    )
    start = int(np.abs(heave).argmax() + FILES[model][1] / 0.0002)
    return wing, pitch[start:] - pitch[-REST:].mean(), heave[start:] - heave[-REST:].mean()


def dataset_of(model: int, folder: Path) -> SeriesDataset:
    """Return the parts of the decay of ``model``."""
    wing, pitch, heave = read(model, folder)
    used = np.array([pitch, heave], np.float64)[:, : PARTS * PART * EVERY : EVERY]
    errors = (ACCEPTED * np.sqrt(np.mean(used**2, axis=1))).tolist()
    units, recordings = {"pitch": "rad", "heave": "m"}, []
    channels = tuple(Channel(*one, accepted_error=error) for one, error in zip(units.items(), errors, strict=True))
    for k in range(PARTS):
        values = used[:, k * PART : (k + 1) * PART].T
        rates = (values[1] - values[0]) / (EVERY * 0.0002)
        start = {"pitch0": values[0, 0], "heave0": values[0, 1], "pitch_rate0": rates[0], "heave_rate0": rates[1]}
        recordings.append(
            Series(
                f"part-{k + 1}",
                np.arange(PART, dtype=np.float64) * EVERY * 0.0002,
                channels,
                values,
                settings={"wing_mass": wing.wing_mass},
                estimates={name: float(value) for name, value in start.items()},
            )
        )
    held_out = tuple(f"part-{k}" for k in HELD_OUT)
    settings = (Quantity("wing_mass", "kg"),)
    return SeriesDataset(
        f"flutter-model-{model}", "wing on springs", tuple(recordings), channels, settings=settings, held_out=held_out
    )


def rig_of(wing: Wing, *, with_stiffness: bool = False) -> Rig:
    """Return the rig of ``wing``; ``with_stiffness``: quadratic and cubic pitch stiffness are in the nominal model."""
    added = (
        Gene("k2", "N m/rad^2", 0.0, -500.0, 500.0, "linear", "quadratic pitch stiffness of the nominal model"),
        Gene("k3", "N m/rad^3", 0.0, -5000.0, 5000.0, "linear", "cubic pitch stiffness of the nominal model"),
    )
    mass_of_air, moment_of_air, inertia_of_air = wing.added

    def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        mass, inertia = wing.mass + mass_of_air, genes["inertia"] + inertia_of_air
        coupling = wing.unbalance + moment_of_air + genes["unbalance.size"]
        determinant = mass * inertia - coupling**2
        if determinant <= 0.0:
            raise ValueError(f"the mass matrix is not positive: its determinant is {determinant:g}")
        k2, k3 = genes.get("k2", 0.0), genes.get("k3", 0.0)
        names = ("pitch_stiffness", "heave_stiffness", "pitch_damping", "heave_damping")
        pitch_stiffness, heave_stiffness, pitch_damping, heave_damping = (genes[name] for name in names)

        def rate(_: float, state: Array) -> tuple[float, float, float, float]:
            pitch, heave, turning, rising = state.tolist()
            moment = -pitch_stiffness * pitch - pitch_damping * turning - (k2 + k3 * pitch) * pitch * pitch
            force = -heave_stiffness * heave - heave_damping * rising
            moment += run.force("pitch", pitch, turning)
            force += run.force("heave", heave, rising)
            return (
                turning,
                rising,
                (mass * moment - coupling * force) / determinant,
                (inertia * force - coupling * moment) / determinant,
            )

        start = [genes[name] for name in ("pitch0", "heave0", "pitch_rate0", "heave_rate0")]
        found = run.integrate(rate, start, rtol=RTOL)
        return {"pitch": found[0], "heave": found[1]}

    def gene(name: str, unit: str, value: float, words: str) -> Gene:
        return Gene(name, unit, value, 0.2 * value, 5.0 * value, "log", words)

    unbalance = Gene("unbalance.size", "kg m", 0.0, -0.2, 0.2, "linear", "error of the static unbalance")
    return Rig(
        name="wing on springs",
        genes=(
            gene("inertia", "kg m^2", wing.inertia, "inertia about the axis"),
            gene("pitch_stiffness", "N m/rad", wing.pitch_stiffness, "pitch stiffness"),
            gene("heave_stiffness", "N/m", wing.heave_stiffness, "heave stiffness"),
            Gene("pitch_damping", "N m s/rad", wing.pitch_damping, 0.0, 5.0, "linear", "viscous damping of pitch"),
            Gene("heave_damping", "N s/m", wing.heave_damping, 0.0, 150.0, "linear", "viscous damping of heave"),
            *(added if with_stiffness else ()),
        ),
        recording_genes=(
            Gene("pitch0", "rad", 0.0, -0.3, 0.3, "linear", "pitch at the start"),
            Gene("heave0", "m", 0.0, -0.15, 0.15, "linear", "heave at the start"),
            Gene("pitch_rate0", "rad/s", 0.0, -6.0, 6.0, "linear", "pitch rate at the start"),
            Gene("heave_rate0", "m/s", 0.0, -3.0, 3.0, "linear", "heave rate at the start"),
        ),
        channels={"pitch": "rad", "heave": "m"},
        settings={"wing_mass": "kg"},
        suspects=(Suspect("unbalance", "wrong centre of gravity", "inertia", (unbalance,)),),
        ports=(
            Port("pitch", "rad", "N m", 0.12, 2.0, MOMENT, stiffness="pitch_stiffness"),
            Port("heave", "m", "N", 0.06, 0.9, FORCE, stiffness="heave_stiffness"),
        ),
        simulate=simulate,
        description="linear heave and pitch" + (" with quadratic and cubic pitch stiffness" if with_stiffness else ""),
    )


def _build(model: int, folder: Path, *, with_stiffness: bool) -> tuple[Rig, SeriesDataset]:
    return rig_of(read(model, folder)[0], with_stiffness=with_stiffness), dataset_of(model, folder)


def _trials(model: int) -> tuple[Trial, ...]:
    both = frozenset({SQUARE, CUBIC})
    return (
        Trial(
            f"flutter-{model}",
            "quadratic and cubic pitch stiffness",
            lambda folder: _build(model, folder, with_stiffness=False),
            right=(both, frozenset({SQUARE}), frozenset({CUBIC})),
        ),
        Trial(
            f"flutter-{model}-stiffness-in-nominal",
            "both are in the nominal model: adequate",
            lambda folder: _build(model, folder, with_stiffness=True),
            adequate=True,
            control=True,
        ),
        Trial(
            f"flutter-{model}-without-suspect",
            "neither among the suspects: unnamed",
            lambda folder: _build(model, folder, with_stiffness=False),
            without=both,
            control=True,
        ),
    )


TRIALS = (*_trials(1), *_trials(2))
