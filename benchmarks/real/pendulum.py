"""A single pendulum that swings freely (MultiArm-Pendulum): its authors' model has viscous friction alone.

``pendulum/Single.mat`` holds one decay from 95 to 14 degrees, cut into six recordings of 9.2 s at 1 kHz, four to
identify (``Y_id``) and two to validate (``Y_vad``); that division is kept. Decided from the physics, before fitting:

- **Samples.** Every twentieth: 50 Hz, twenty times the frequency of the swing, whose seventh harmonic (8 Hz) is the
  last above the noise. Of each recording the first 4 s, five swings, are used: the six recordings still show six
  amplitudes. The rate in the file is a derivative of the angle, not a measurement, and is not used.
- **Nominal model.** q'' = -stiffness sin q - damping q', q from the hanging position, whose encoder angle is a gene;
  the authors' own model, in terms of what a free swing can show. Angle and rate at the start of each recording are
  genes of the recording.
- **Suspects.** All laws at the joint, and all faults of the channel.

The authors doubt that viscous friction is all; dry friction (also as hysteresis) is what bearings have, and air adds
drag with the square of the rate. Neither is stated to be there. What the recording shows without a model: the loss of
amplitude per swing, relative to the amplitude, is 3.2 % at 1.6 rad, 2.3 % at 1 rad, 2.7 % at 0.5 rad and 4.3 % at
0.28 rad; with viscous friction alone it would be nearly constant. So there is dry friction, and drag as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from benchmarks.real.trial import Trial, read_mat
from wingfit.records import Channel, Gene, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.rigs.ports import Port
from wingfit.rigs.rig import Rig
from wingfit.rigs.run import Run

EVERY = 20  # samples of 1 ms
COUNT = 200  # samples that are used of each recording: five swings
RTOL = 1e-7  # of the integration: 1e-6 rad, a fortieth of the noise
SMOOTH = 0.02 * 12.0  # rad/s, of dry friction in the nominal model of the control: as the law at the port
DRY = ("dry_friction.joint", "hysteresis.joint")
DRAG = "square_drag.joint"
FRICTIONS = frozenset({*DRY, DRAG})


def dataset_of(folder: Path) -> SeriesDataset:
    """Return the six recordings; those to validate are held out."""
    file, channel, recordings = read_mat(folder / "pendulum" / "Single.mat"), Channel("angle", "rad"), []
    for kind in ("id", "vad"):
        for k, (times, angles) in enumerate(zip(file[f"Time_{kind}"][:, 0], file[f"Y_{kind}"][:, 0], strict=True)):
            time, angle = times.ravel()[::EVERY][:COUNT], angles[0, ::EVERY][:COUNT] - np.pi
            speed = (angles[0, EVERY] - angles[0, 0]) / (times.ravel()[EVERY] - times.ravel()[0])
            start = {"angle0": float(angle[0]), "rate0": float(speed)}
            recordings.append(Series(f"{kind}-{k + 1}", time - time[0], (channel,), angle[:, None], estimates=start))
    held_out = tuple(one.name for one in recordings if one.name.startswith("vad"))
    return SeriesDataset("pendulum", "single pendulum", tuple(recordings), (channel,), held_out=held_out)


def rig_of(*, with_friction: bool = False) -> Rig:
    """Return the pendulum; ``with_friction``: dry friction and drag are in the nominal model."""
    added = (
        Gene("dry", "1/s^2", 0.1, 0.0, 2.0, "linear", "dry friction of the nominal model"),
        Gene("drag", "1", 0.02, 0.0, 0.2, "linear", "drag with the square of the rate, of the nominal model"),
    )

    def simulate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
        damping, stiffness, rest = genes["damping"], genes["stiffness"], genes["rest"]
        dry, drag = genes.get("dry", 0.0), genes.get("drag", 0.0)

        def rate(_: float, state: Array) -> tuple[float, float]:
            angle, speed = float(state[0]) - rest, float(state[1])
            own = -stiffness * np.sin(angle) - damping * speed - dry * np.tanh(speed / SMOOTH)
            return speed, own - drag * abs(speed) * speed + run.force("joint", angle, speed)

        return {"angle": run.integrate(rate, [genes["angle0"], genes["rate0"]], rtol=RTOL)[0]}

    return Rig(
        name="single pendulum",
        genes=(
            Gene("damping", "1/s", 0.05, 0.0, 1.0, "linear", "viscous damping, of the inertia"),
            Gene("stiffness", "1/s^2", 60.0, 30.0, 120.0, "linear", "gravity, of the inertia"),
            Gene("rest", "rad", 0.0, -0.1, 0.1, "linear", "encoder angle when hanging, from half a turn"),
            *(added if with_friction else ()),
        ),
        recording_genes=(
            Gene("angle0", "rad", 0.0, -2.0, 2.0, "linear", "angle at the start"),
            Gene("rate0", "rad/s", 0.0, -15.0, 15.0, "linear", "rate at the start"),
        ),
        channels={"angle": "rad"},
        ports=(Port("joint", "rad", "1/s^2", 1.6, 12.0, 6.0, stiffness="stiffness"),),
        simulate=simulate,
        description="pendulum with viscous friction" + (", dry friction and drag" if with_friction else ""),
    )


RIGHT = (*(frozenset(one) for dry in DRY for one in ({dry}, {dry, DRAG})), frozenset({DRAG}))
TRIALS = (
    Trial(
        "pendulum",
        "viscous friction alone in the authors' model; dry friction is theirs to doubt",
        lambda folder: (rig_of(), dataset_of(folder)),
        right=RIGHT,
    ),
    Trial(
        "pendulum-friction-in-nominal",
        "dry friction and drag are in the nominal model: adequate",
        lambda folder: (rig_of(with_friction=True), dataset_of(folder)),
        adequate=True,
        control=True,
    ),
    Trial(
        "pendulum-without-suspect",
        "neither dry friction, hysteresis nor drag among the suspects: unnamed",
        lambda folder: (rig_of(), dataset_of(folder)),
        without=FRICTIONS,
        control=True,
    ),
)
