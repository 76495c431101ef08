"""A rigid flapping wing in wind whose surface pressures were measured (Yeo, Atkins and Shyy 2011): one mean beat.

``yeo2011/`` holds pressure differences of nine sensors in inches of water and the flapping angle in degrees, each at
100 phases of one beat; others digitised them from the figures of the paper. The half span is 0.213 m, the wind 2.9 m/s,
the frequency 3.3 Hz, the body pitch 0 (all from the validation study in PteraSoftware, which holds the files). Decided
from the physics, before fitting:

- **Recordings.** One for each of three stations along the span, with the channels leading, middle and trailing. The
  inner and the outer station are fitted; the middle one is held out, so that a law must hold along the span.
- **Motion.** A Fourier series with four harmonics of the measured angle, as the authors of the paper use; its
  derivatives are analytic. The angle is an input.
- **Nominal model.** Quasi-steady thin-aerofoil theory of a flat plate without pitch. With the normal velocity w of the
  air relative to the plate, the difference is lift * 2 rho U w sqrt((1 - x) / x) at the part x of the chord. The one
  gene, lift, is the part of the two-dimensional load that is left on a finite wing.
- **Suspects.** Added mass, a lag of the circulation, stall, cross-flow drag, a blunt leading edge, incidence, camber, a
  tip loss, an elastic twist (the wing is called rigid: a decoy), and faults of the measurement that all sensors share:
  zero, lag of the tubes, delay between motion and pressures, sensitivity to acceleration. Faults that wingfit makes
  itself are left out, because they would be shared by the three different sensors that have one name here.

- **Noise.** A digitised mean beat without repeats shows none. ``yeo`` states none, and a refusal is expected.
  ``yeo-noise-stated`` states 0.2 Pa, a hundredth of the range of all pressures: about the width of a plotted line.

No source says which law is missing: a vortex lattice leaves 41 % of the RMS lift, and several laws of the list must be
there by theory. So a name cannot be verified, and each is counted as wrong; the diagnosis should abstain. Controls have
the same motion and stations, but simulated pressures with one known effect, or none, and white noise of 0.2 Pa. They
show what such a recording can decide.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.real.trial import Trial
from wingfit.records import Channel, Gene, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.records.series import Quantity
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run
from wingfit.rigs.suspect import Family, Suspect

Complex = npt.NDArray[np.complex128]
AIR, WIND, FREQUENCY, HALF_SPAN = 1.2, 2.9, 3.3, 0.213  # kg/m^3, m/s, Hz, m
INCH_OF_WATER = 248.84  # Pa
HARMONICS = 4
OMEGA = 2.0 * np.pi * FREQUENCY  # rad/s
PLACES = ("leading", "middle", "trailing")
SETTINGS = {
    f"{place}_{what}": unit for place in PLACES for what, unit in (("part", "1"), ("chord", "m"), ("radius", "m"))
}
NOISE, SEED = 0.2, 1  # Pa: as stated, and that of the simulated controls; and its seed


# station: colour in the names of the files; distances (m) of its leading, middle and trailing sensor from the straight
# part of the leading edge, and from the axis
STATIONS = {
    "inner": ("blue", (0.012, 0.036, 0.060), (0.036, 0.036, 0.036)),
    "middle": ("orange", (0.01308, 0.0342, 0.05532), (0.107, 0.107, 0.107)),
    "outer": ("green", (0.01569, 0.03069, 0.04569), (0.1775, 0.176, 0.162825)),
}
HELD_OUT = ("middle",)


def read(path: Path) -> Array:
    """Return both columns [N, 2] of the file at ``path``."""
    with path.open(encoding="utf-8-sig", newline="") as file:
        return np.array([[float(value) for value in row] for row in csv.reader(file)])


def geometry(planform: Array, x: tuple[float, ...], radius: tuple[float, ...]) -> dict[str, float]:
    """Return part of the chord, chord (m) and radius (m) of the sensors of one station, by names of settings.

    ``planform`` [N, 2] has points (along the span, above the trailing edge of the root; mm) from the leading edge to
    the tip and back along the trailing edge; ``x`` and ``radius`` are as in STATIONS.
    """
    tip = int(planform[:, 0].argmax())
    settings = dict[str, float]()
    for place, own, distance in zip(PLACES, x, radius, strict=True):
        front = np.interp(1e3 * distance, *planform[:tip].T)
        rear = np.interp(1e3 * distance, *planform[: tip - 1 : -1].T)
        chord = 1e-3 * float(front - rear)
        settings |= {
            f"{place}_part": (own - 1e-3 * float(planform[0, 1] - front)) / chord,
            f"{place}_chord": chord,
            f"{place}_radius": distance,
        }
    return settings


def dataset_of(folder: Path, noise: float | None = None) -> SeriesDataset:
    """Return the three stations, with pressures in Pa, of the stated ``noise`` (Pa), and the angle in rad as input."""
    place = folder / "yeo2011"
    planform = read(place / "extracted_planform_coordinates.csv")
    angle = np.radians(read(place / "measured_wing_positions.csv")[:, 1])
    times = np.arange(len(angle)) / len(angle) / FREQUENCY
    channels, recordings = tuple(Channel(name, "Pa", noise) for name in PLACES), []
    for name, (colour, x, radius) in STATIONS.items():
        columns = [read(place / f"{colour}_{one}_point_experimental_pressures.csv")[:, 1] for one in PLACES]
        pressures = INCH_OF_WATER * np.stack(columns, axis=1)
        settings = geometry(planform, x, radius)
        recordings.append(Series(name, times, channels, pressures, {"angle": angle}, settings, period=1.0 / FREQUENCY))
    settings_of_all = tuple(Quantity(name, unit) for name, unit in SETTINGS.items())
    inputs = (Quantity("angle", "rad"),)
    return SeriesDataset("yeo", "flapping wing in wind", tuple(recordings), channels, inputs, settings_of_all, HELD_OUT)


def simulated(folder: Path, effect: str) -> SeriesDataset:
    """Return the dataset with simulated pressures instead: ``effect`` (none if "") of typical size, and noise."""
    dataset, random = dataset_of(folder, NOISE), np.random.default_rng(SEED)
    genes = {"lift": 0.6} | {gene.name: gene.nominal for one in suspects() for gene in one.genes}
    genes |= {name: value for one in suspects() if one.name == effect for name, value in one.typical.items()}
    recordings = []
    for one in dataset.recordings:
        clean = simulate(genes, Run(one.name, one.times, one.settings, one.inputs, one.times))
        values = np.stack([clean[name] for name in PLACES], axis=1)
        recordings.append(replace(one, values=values + NOISE * random.standard_normal(values.shape)))
    return replace(dataset, recordings=tuple(recordings))


def motion(run: Run) -> Complex:
    """Return the complex amplitudes [HARMONICS] (rad) of the flapping angle in ``run``, without its mean."""
    phases = OMEGA * np.outer(run.input_times, np.arange(HARMONICS + 1))
    basis = np.concatenate([np.cos(phases), np.sin(phases[:, 1:])], axis=1)
    found = np.linalg.lstsq(basis, run.inputs["angle"], rcond=None)[0]
    return np.asarray(found[1 : HARMONICS + 1] - 1j * found[HARMONICS + 1 :])


def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """Return the pressure differences (Pa, lower minus upper side) at the sensors of one station."""
    rates: Complex = 1j * OMEGA * np.arange(1, HARMONICS + 1, dtype=np.complex128)  # a derivative multiplies by them
    # The lag of the tubes acts on the motion: the same, while pressures are linear in it.
    turns: Complex = np.exp(np.outer(run.times - genes["delay.size"], rates)) / (1.0 + rates * genes["tube_lag.size"])
    angle = motion(run)
    return {name: _pressure(genes, run, name, turns, rates, angle) for name in PLACES}


def _pressure(
    genes: Mapping[str, float], run: Run, place: str, turns: Complex, rates: Complex, angle: Complex
) -> Array:
    """Return the pressure difference [T] (Pa) at one sensor; ``turns`` [T, HARMONICS] give amplitudes their time."""
    x, chord, radius = (run.setting(f"{place}_{what}") for what in ("part", "chord", "radius"))
    speed = -radius * rates * angle  # of the air relative to the plate, upwards
    twist = genes["elastic_twist.size"] * (rates / OMEGA) ** 2 * angle * radius / HALF_SPAN
    acting = (speed + WIND * twist) / (1.0 + rates * genes["circulation_lag.size"] * chord / WIND)
    w = (turns @ acting).real + WIND * genes["incidence.size"]
    acceleration = (turns @ (rates * speed)).real
    bound = genes["lift"] * (1.0 - genes["tip_loss.size"] * (radius / HALF_SPAN) ** 2)
    stalled = 1.0 - genes["stall.size"] * np.abs(w) / np.hypot(w, WIND)
    arc = float(np.sqrt(x * (1.0 - x)))
    pressure: Array = bound * 2.0 * AIR * WIND * stalled * w * np.sqrt((1.0 - x) / (x + genes["blunt_edge.size"]))
    pressure += genes["cross_flow.size"] * 0.5 * AIR * w * np.abs(w) + genes["zero.size"]
    pressure += genes["added_mass.size"] * 2.0 * AIR * chord * arc * acceleration
    pressure += 16.0 * AIR * WIND**2 * genes["camber.size"] * arc
    return np.asarray(pressure + genes["sensed_acceleration.size"] * acceleration)


def suspects() -> tuple[Suspect, ...]:
    """Return what may be missing in the pressures of the wing."""

    def one(
        name: str, title: str, unit: str, low: float, high: float, typical: float, source: str, family: Family
    ) -> Suspect:
        gene = Gene(f"{name}.size", unit, 0.0, low, high, "linear", title)
        return Suspect(name, title, family, (gene,), typical={gene.name: typical}, source=source)

    air: Family = "aerodynamics"
    return (
        one("added_mass", "added mass", "1", -1.0, 3.0, 1.0, "Theodorsen 1935", air),
        one("circulation_lag", "lag of the circulation (chords)", "1", 0.0, 5.0, 1.0, "Wagner 1925", air),
        one("stall", "loss of pressure with the angle of attack", "1", -1.0, 2.5, 0.5, "Kirchhoff flow", air),
        one("cross_flow", "cross-flow drag", "1", -2.0, 4.0, 1.0, "Polhamus 1966", air),
        one("blunt_edge", "blunt leading edge (chords)", "1", -0.1, 0.3, 0.03, "Riegels 1948", air),
        one("incidence", "incidence of the wing", "rad", -0.3, 0.3, 0.05, "thin-aerofoil theory", air),
        one("camber", "camber (chords)", "1", -0.1, 0.1, 0.02, "thin-aerofoil theory", air),
        one("tip_loss", "loss of lift to the tip", "1", -1.0, 1.0, 0.3, "Prandtl 1918", air),
        one("elastic_twist", "twist with the acceleration", "1", -1.0, 1.0, 0.2, "torsion spring", "structure"),
        one("zero", "zero of the sensors", "Pa", -3.0, 3.0, 0.5, "sensor", "measurement"),
        one("tube_lag", "lag of the tubes", "s", 0.0, 0.05, 0.005, "sensor", "measurement"),
        one("delay", "delay between motion and pressures", "s", -0.03, 0.03, 0.005, "recorder", "measurement"),
        one(
            "sensed_acceleration",
            "sensitivity of the sensors to acceleration",
            "kg/m^2",
            -0.5,
            0.5,
            0.05,
            "sensor",
            "measurement",
        ),
    )


def rig() -> Rig:
    """Return the wing with its suspects."""
    return Rig(
        name="flapping wing in wind",
        genes=(Gene("lift", "1", 0.75, 0.1, 2.0, "log", "load, of that of a two-dimensional plate"),),
        channels=dict.fromkeys(PLACES, "Pa"),
        inputs={"angle": "rad"},
        settings=SETTINGS,
        simulate=simulate,
        suspects=suspects(),
        faults=False,
        description="quasi-steady flat plate",
    )


def _control(effect: str) -> Trial:
    return Trial(
        f"yeo-simulated-{(effect or 'nothing').replace('_', '-')}",
        f"simulated with {effect}" if effect else "simulated without an effect: adequate",
        lambda folder: (rig(), simulated(folder, effect)),
        right=(frozenset({effect}),) if effect else (),
        adequate=not effect,
        control=True,
    )


EVERY = frozenset(one.name for one in suspects())
TRIALS = (
    Trial("yeo", "not documented: no name can be verified", lambda folder: (rig(), dataset_of(folder)), claims=EVERY),
    Trial(
        "yeo-noise-stated",
        "not documented: no name can be verified",
        lambda folder: (rig(), dataset_of(folder, NOISE)),
        claims=EVERY,
    ),
    *(_control(effect) for effect in ("", "added_mass", "circulation_lag", "stall", "tube_lag")),
)
