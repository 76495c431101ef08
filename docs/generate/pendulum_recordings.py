"""Write the recordings of ``examples/pendulum``: a pendulum with dry friction in its pivot, recorded with noise.

``python -m docs.generate.pendulum_recordings`` writes the folder. The integrator and the law of friction are not those
of the rig: Runge-Kutta steps of fourth order, and a friction that is proportional to the rate below 0.01 rad/s.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wingfit.records import Channel, Series, SeriesDataset, save_dataset
from wingfit.records.array_types import Array

FOLDER = Path(__file__).parents[2] / "examples" / "pendulum"
STARTS = (0.9, 0.55, 1.2, 0.35, 0.75, 1.05)  # rad
DAMPING, GRAVITY, FRICTION, NOISE = 0.12, 38.0, 0.3, 0.004  # 1/s, 1/s^2, 1/s^2, rad
TIMES: Array = 0.03 * np.arange(200, dtype=np.float64)


def swing(start: float) -> Array:
    """Return the angle [T] of the pendulum, released at ``start`` (rad), at TIMES."""

    def rate(state: Array) -> Array:
        angle, speed = state
        friction = FRICTION * np.clip(speed / 0.01, -1.0, 1.0)
        return np.array([speed, -DAMPING * speed - GRAVITY * np.sin(angle) - friction])

    state, found, steps = np.array([start, 0.0]), [start], 60
    for _ in TIMES[1:]:
        h = (TIMES[1] - TIMES[0]) / steps
        for _ in range(steps):
            a = rate(state)
            b = rate(state + h / 2 * a)
            c = rate(state + h / 2 * b)
            d = rate(state + h * c)
            state = state + h / 6 * (a + 2 * b + 2 * c + d)
        found.append(float(state[0]))
    return np.array(found)


def main() -> None:
    """Write dataset.yaml and the recordings into the example's folder, beside its rig."""
    rng = np.random.default_rng(5)
    channel = Channel("angle", "rad", description="of the rod, from the vertical")
    recordings = []
    for k, start in enumerate(STARTS):
        values = np.round(swing(start) + NOISE * rng.standard_normal(len(TIMES)), 5)
        recordings.append(
            Series(f"swing-{k + 1}", TIMES.round(4), (channel,), values[:, None], estimates={"angle0": start})
        )
    held_out = (recordings[-2].name, recordings[-1].name)
    dataset = SeriesDataset(
        "pendulum", "pendulum", tuple(recordings), (channel,), (), (), held_out, "Free swings, each from another angle."
    )
    kept = (FOLDER / "rig.py").read_text(encoding="utf-8")
    for old in sorted(FOLDER.rglob("*"), reverse=True):
        if old.is_file():
            old.unlink()
        else:
            old.rmdir()
    save_dataset(dataset, FOLDER)
    (FOLDER / "rig.py").write_text(kept, encoding="utf-8")


if __name__ == "__main__":
    main()
