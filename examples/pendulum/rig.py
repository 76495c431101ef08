"""A pendulum that swings freely: the simulation that its user has, as a rig for wingfit. See README, Bring your own."""

import numpy as np

import wingfit


def simulate(genes, run):
    """Return the angle (rad) at run.times for one recording; ``genes`` has the values of all genes by name."""

    def rate(_, state):
        angle, speed = state
        moment = -genes["damping"] * speed - genes["gravity"] * np.sin(angle) + run.force("pivot", angle, speed)
        return speed, moment

    angle, _ = run.integrate(rate, [genes["angle0"], genes["speed0"]])
    return {"angle": angle}


rig = wingfit.Rig(
    name="pendulum",
    genes=[
        wingfit.Gene("damping", "1/s", 0.1, 0.01, 1.0, "log", "viscous friction of the pivot / inertia"),
        wingfit.Gene("gravity", "1/s^2", 30.0, 10.0, 90.0, "log", "gravity / length"),
    ],
    recording_genes=[
        wingfit.Gene("angle0", "rad", 0.5, -2.0, 2.0, "linear", "angle at the first sample"),
        wingfit.Gene("speed0", "rad/s", 0.0, -5.0, 5.0, "linear", "rate at the first sample"),
    ],
    channels={"angle": "rad"},
    ports=[wingfit.Port("pivot", "rad", "1/s^2", coordinate=1.0, rate=5.0, force=4.0)],
    simulate=simulate,
)
