"""How a new recording is sampled, and the grid of instants on which it is simulated before it is made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wingfit.records import Condition, Recording, Wing
from wingfit.records.dataset import ForceAxis

BEATS = {"tracks": 4.0, "forces": 28.0}  # of a recording that is only described
FRAMES = {"tracks": 30.0, "forces": 100.0}
GRID_BEATS = 4  # beats that are simulated: slow changes show over several
GRID_FRAMES = {"tracks": 32, "forces": 64}  # most instants of a beat that are simulated; enough for all harmonics
LEAST_GRID = 20  # instants of a beat: fewer would not determine its start


@dataclass(frozen=True)
class Sampling:
    """A recording of ``beats``, each of ``frames`` frames or samples."""

    beats: float
    frames: float

    @property
    def samples(self) -> float:
        """Number of all frames or samples."""
        return self.beats * self.frames


def seen_sampling(recording: Recording) -> Sampling:
    """Return how ``recording`` was sampled; the default if it has no values.

    Under a strobe, beats are the apparent ones: successive frames show nearly the same phase of different beats.
    """
    if not recording.valid.any() or len(recording.times) < 2:
        return Sampling(BEATS[recording.kind], FRAMES[recording.kind])
    step = float(np.median(np.diff(recording.times))) * recording.condition.flap_frequency
    advance = abs(step - round(step)) if recording.kind == "tracks" else step
    frames = 1.0 / advance if advance > 0.0 else FRAMES[recording.kind]
    part = float(recording.valid.any(axis=0).sum()) or 1.0
    return Sampling(float(recording.valid.sum()) / part / frames, frames)


def typical_sampling(samplings: Sequence[Sampling]) -> Sampling:
    """Return the median sampling, for recordings that are not planned yet."""
    beats, frames = (float(np.median([getattr(one, name) for one in samplings])) for name in ("beats", "frames"))
    return Sampling(beats, frames)


def blank_on_grid(
    like: Recording, condition: Condition, name: str, sampling: Sampling, markers: tuple[str, ...]
) -> Recording:
    """Return a recording under ``condition`` on a grid of equal steps, without values; all else is that of ``like``."""
    frames = int(min(max(round(sampling.frames), LEAST_GRID), GRID_FRAMES[like.kind]))
    times = np.arange(GRID_BEATS * frames) / (frames * condition.flap_frequency)
    forces: tuple[ForceAxis, ...] = ("x", "z") if like.kind == "forces" else ()
    return replace(
        like,
        name=name,
        condition=condition,
        times=times,
        markers=markers,
        forces=forces,
        values=np.full((len(times), 3 * len(markers) + len(forces)), np.nan),
        standard_deviation=None,
        noise_correlation=None,
    )


def spread_markers(wing: Wing, markers: Sequence[str], count: int | None) -> tuple[str, ...]:
    """Return ``count`` of ``markers``, spread over the ``wing``, of which the first defines the start of a beat.

    Each is the farthest from all that are chosen already. ValueError if there are not as many.
    """
    if count is None:
        return tuple(markers)
    if count > len(markers):
        raise ValueError(f"markers is {count}, but the wing has {len(markers)}; describe more, or plan with fewer")
    places = np.array([wing.marker(name).position for name in markers])
    reference = [k for k, name in enumerate(markers) if name in wing.reference_markers]
    chosen = [max(reference or range(len(markers)), key=lambda k: places[k, 1])]
    near = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(near)))
        near = np.minimum(near, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return tuple(markers[k] for k in sorted(chosen))
