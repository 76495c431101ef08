"""Balls that fall from a bridge (de Silva et al. 2020): in which of them is drag seen.

``balls/drops.csv`` holds heights of ten balls, dropped twice each and filmed at 15 frames/s. The first drop of each
ball is fitted, the second is held out; balls of one kind form one dataset. Decided from the physics, before fitting:

- **Start.** The first frames show the ball in the hand. A hand does not reach 1 m below the point of release, so a
  ball that is 1 m below the highest point of its recording is surely falling; earlier samples are left out. Height and
  speed at the first sample that is used are genes of the recording.
- **End.** All recordings end more than 10 m above the lowest point, in the air; all samples to the end are used,
  without those that follow the sample before by less than three quarters of a frame (the last of some videos).
- **Accepted error.** 0.5 m. The videos were scaled by hand, which is hardly exact to more than 1.5 % of a fall of 35 m;
  those of the golf ball differ by 9 %.
- **Nominal model.** Constant acceleration by gravity, 9.81 m/s^2, known.
- **Suspects.** Drag with the square of the speed, with a drag coefficient and each ball's mass and frontal area; drag
  in proportion to speed and radius; buoyancy, added mass, an error of the camera's scale in each video (videos were
  scaled by hand, one at a time), perspective (a scale that changes with height), and all faults of a channel.

Masses and circumferences are those of ``balls.txt``; that of the volleyball is not stated, and it is left out.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.real.trial import Trial
from wingfit.records import Channel, Gene, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.records.series import Quantity
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run
from wingfit.rigs.suspect import Family, Suspect

GRAVITY, AIR = 9.81, 1.2  # m/s^2, kg/m^3
OUNCE, CENTIMETRE = 0.0283495, 0.01
RELEASED = 1.0  # m below the highest point
FRAME = 1.0 / 15.0  # s
ACCEPTED = 0.5  # m, by which a height may differ from the model
STEP = 0.04  # s, longest step of the integration; halving it changes heights by less than 1e-5 m

# kind of ball: name in drops.csv, name in balls.txt
KINDS: dict[str, tuple[tuple[str, str], ...]] = {
    "small-whiffle": (("Whiffle Ball 1", "wiffleball1"), ("Whiffle Ball 2", "wiffleball2")),
    "large-whiffle": (("Yellow Whiffle Ball", "yellowWiffle"), ("Orange Whiffle Ball", "orangeWiffle")),
    "basketball": (("Blue Basketball", "bluebasketball"), ("Green Basketball", "greenbasketball")),
    "tennis": (("Tennis Ball", "tennisball"),),
    "baseball": (("Baseball", "baseball"),),
    "golf": (("Golf Ball", "golfball"),),
    "bowling": (("Bowling Ball", "bowlingball"),),
}
KINDS["all"] = tuple(ball for balls in KINDS.values() for ball in balls)
DRAGS = frozenset({"square_drag", "linear_drag"})


@dataclass(frozen=True)
class Ball:
    """Mass (kg) and circumference (m)."""

    mass: float
    circumference: float


def read(folder: Path) -> tuple[dict[tuple[str, int], Array], dict[str, Ball]]:
    """Return time and height [T, 2] by ball and drop, and the balls whose mass and circumference are stated."""
    drops: dict[tuple[str, int], list[tuple[float, float]]] = {}
    with (folder / "balls" / "drops.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            drop = drops.setdefault((row["ball"], int(row["drop"])), [])
            drop.append((float(row["time_s"]), float(row["height_m"])))
    balls = {}
    for line in (folder / "balls" / "balls.txt").read_text(encoding="utf-8").splitlines()[1:]:
        name, mass, circumference = line.split()
        if "?" not in mass + circumference:
            balls[name] = Ball(float(mass) * OUNCE, float(circumference) * CENTIMETRE)
    return {key: np.array(drop) for key, drop in drops.items()}, balls


def falling(drop: Array) -> Array:
    """Return the samples [T, 2] of ``drop`` in which the ball falls freely (see the module)."""
    highest = int(drop[:, 1].argmax())
    below = drop[highest, 1] - drop[highest:, 1] >= RELEASED
    used = drop[highest + int(below.argmax()) :]
    return np.asarray(used[np.append(True, np.diff(used[:, 0]) > 0.75 * FRAME)])


def dataset_of(kind: str, folder: Path) -> SeriesDataset:
    """Return the dataset of the balls of ``kind``: first drops to fit, second drops held out."""
    drops, balls = read(folder)
    recordings, channel = [], Channel("height", "m", accepted_error=ACCEPTED)
    for name, in_list in KINDS[kind]:
        ball = balls[in_list]
        for number in (1, 2):
            times, heights = falling(drops[name, number]).T
            line = np.polyfit(times[:6] - times[0], heights[:6], 1)
            recordings.append(
                Series(
                    f"{name.lower().replace(' ', '-')}-{number}",
                    times - times[0],
                    (channel,),
                    heights[:, None],
                    settings={"mass": ball.mass, "circumference": ball.circumference},
                    estimates={"height0": float(line[1]), "speed0": float(-line[0])},
                )
            )
    held_out = tuple(one.name for one in recordings if one.name.endswith("-2"))
    settings = (Quantity("mass", "kg"), Quantity("circumference", "m"))
    return SeriesDataset(kind, "falling ball", tuple(recordings), (channel,), settings=settings, held_out=held_out)


def suspects(recordings: tuple[str, ...]) -> tuple[Suspect, ...]:
    """Return what may be missing in the fall of a ball; ``recordings`` have a scale of the camera each."""

    def one(name: str, title: str, unit: str, low: float, high: float, typical: float, source: str) -> Suspect:
        gene = Gene(f"{name}.size", unit, 0.0, low, high, "linear", title)
        family: Family = "measurement" if name == "perspective" else "physics"
        like = tuple(DRAGS - {name}) if name in DRAGS else ()
        return Suspect(name, title, family, (gene,), typical={gene.name: typical}, source=source, confused_with=like)

    scales = tuple(
        Gene(f"scale.{name}", "1", 0.0, -0.3, 0.3, "linear", f"error of the scale in {name}") for name in recordings
    )
    return (
        one("square_drag", "drag with the square of the speed", "1", -0.2, 2.0, 0.5, "Newton 1687"),
        one("linear_drag", "drag in proportion to the speed", "Pa s", -0.1, 1.0, 0.1, "Stokes 1851"),
        one("buoyancy", "buoyancy", "1", -1.0, 3.0, 1.0, "Archimedes"),
        one("added_mass", "added mass", "1", -0.5, 3.0, 0.5, "Lamb 1932, section 92"),
        one("perspective", "perspective of the camera", "1/m", -0.005, 0.005, 0.001, "camera"),
        Suspect(
            "video_scales",
            "error of the scale of each video",
            "measurement",
            scales,
            typical={gene.name: 0.05 for gene in scales},
            source="camera",
        ),
    )


def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """Return the height (m) of a falling ball: classical Runge-Kutta steps of at most STEP."""
    mass, radius = run.setting("mass"), run.setting("circumference") / (2.0 * np.pi)
    air = AIR * 4.0 / 3.0 * np.pi * radius**3 / mass  # mass of the displaced air, of the ball's
    inertia = 1.0 + genes["added_mass.size"] * air
    weight = GRAVITY * (1.0 - genes["buoyancy.size"] * air) / inertia
    square = (0.5 * AIR * np.pi * radius**2 * genes["square_drag.size"] + genes["nominal_drag"]) / mass / inertia
    line = genes["linear_drag.size"] * radius / mass / inertia

    def gained(speed: float) -> float:
        return float(weight - square * abs(speed) * speed - line * speed)

    height, speed, found = genes["height0"], genes["speed0"], [genes["height0"]]
    for interval in np.diff(run.times):
        steps = max(int(np.ceil(interval / STEP)), 1)
        h = float(interval) / steps
        for _ in range(steps):
            a = gained(speed)
            b = gained(speed + 0.5 * h * a)
            c = gained(speed + 0.5 * h * b)
            d = gained(speed + h * c)
            height -= h * (speed + h * (a + b + c) / 6.0)
            speed += h * (a + 2.0 * b + 2.0 * c + d) / 6.0
        found.append(height)
    heights = np.array(found)
    heights = heights + genes["perspective.size"] * (heights - heights[0]) ** 2
    return {"height": heights * (1.0 + genes.get(f"scale.{run.recording}", 0.0))}


def rig_of(recordings: tuple[str, ...], *, with_drag: bool = False) -> Rig:
    """Return the rig of the ``recordings``; ``with_drag``: drag is in the nominal model."""
    gene = Gene("drag_area", "1", 0.5, 0.01, 3.0, "linear", "drag coefficient of the nominal model")

    def simulated(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        radius = run.setting("circumference") / (2.0 * np.pi)
        drag = 0.5 * AIR * np.pi * radius**2 * genes.get("drag_area", 0.0)
        return simulate({**genes, "nominal_drag": drag}, run)

    absent = {"square_drag"} if with_drag else set[str]()
    zeros = {name: 0.0 for one in suspects(recordings) if one.name in absent for name in (g.name for g in one.genes)}
    return Rig(
        name="falling ball",
        genes=(gene,) if with_drag else (),
        recording_genes=(
            Gene("height0", "m", 45.0, 20.0, 60.0, "linear", "height at the first sample"),
            Gene("speed0", "m/s", 5.0, -2.0, 15.0, "linear", "downward speed at the first sample"),
        ),
        channels={"height": "m"},
        settings={"mass": "kg", "circumference": "m"},
        simulate=lambda genes, run: simulated({**zeros, **genes}, run),
        suspects=tuple(one for one in suspects(recordings) if one.name not in absent),
        description="fall with constant gravity" + (" and drag" if with_drag else ", without air"),
    )


def _build(kind: str, folder: Path, *, with_drag: bool) -> tuple[Rig, SeriesDataset]:
    dataset = dataset_of(kind, folder)
    return rig_of(tuple(one.name for one in dataset.recordings), with_drag=with_drag), dataset


def _trial(
    kind: str, documented: str, *, hidden: bool = False, drag: bool = False, wanted: bool = True, small: bool = False
) -> Trial:
    suffix = "-drag-in-nominal" if drag else "-without-suspect" if hidden else ""
    without = DRAGS | {"added_mass", "buoyancy"} if hidden else frozenset[str]()
    return Trial(
        name=f"balls-{kind}{suffix}",
        documented=documented,
        build=lambda folder: _build(kind, folder, with_drag=drag),
        right=(frozenset({"square_drag"}), frozenset({"linear_drag"})) if wanted else (),
        adequate=drag or (not wanted and not hidden),
        claims=frozenset() if wanted or hidden or drag else DRAGS,
        without=without,
        small=small,
        control=hidden or drag,
    )


CLEAR, HARDLY = "drag, clear", "drag is hardly visible: none may be claimed"
TRIALS = (
    *(_trial(kind, CLEAR) for kind in ("small-whiffle", "large-whiffle", "all")),
    *(_trial(kind, "drag; its size is not documented", small=True) for kind in ("basketball", "tennis", "baseball")),
    *(_trial(kind, HARDLY, wanted=False) for kind in ("golf", "bowling")),
    _trial("small-whiffle", "drag is in the nominal model: adequate", drag=True, wanted=False),
    _trial("large-whiffle", "drag is in the nominal model: adequate", drag=True, wanted=False),
    _trial("small-whiffle", "no drag among the suspects: unnamed", hidden=True, wanted=False),
    _trial("large-whiffle", "no drag among the suspects: unnamed", hidden=True, wanted=False),
)
