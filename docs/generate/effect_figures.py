"""Draw the figures of effects: ``python -m docs.generate.effect_figures [NAME ...]``, all of them without names.

Each effect has its typical size on the nominal rig, without noise, solved with fixed steps. The figures show how it
changes the positions of the markers of the Robird's wing, over the beat and over conditions, and the forces of the
DelFly. The start of the beat is estimated from the simulated tracks, as for a recording.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.common.svg import Line, Panel, svg
from benchmarks.effects import displacement
from benchmarks.physics.effect_rigs import FRAMES, PER_BEAT, Rig, recorded, rig_of
from wingfit.records import Recording, Wing
from wingfit.sim.effects.contract import Effect
from wingfit.sim.effects.ports.markers import PLACE, nearest
from wingfit.sim.effects.registry import EFFECTS
from wingfit.sim.virtual_rigs.campaign import tunnel, vacuum
from wingfit.sim.wing.alignment import recorded_crossing

Array = npt.NDArray[np.float64]

FOLDER = Path(__file__).parents[2] / "docs" / "effects" / "figures"
LAG, FREQUENCY, AIRSPEED, EMPTY = math.radians(3.0), 3.0, 6.0, 10.0  # rad, Hz, m/s, mbar
FREQUENCIES, AIRSPEEDS, PRESSURES = (2.0, 3.0, 4.0), (1.0, 3.5, 6.0, 8.5, 11.0), (10.0, 100.0, 300.0, 1000.0)
OF_PRESSURE = ("residual_air", "added_mass")  # effects that depend on air density rather than airspeed
IN_VACUUM = ("residual_air",)  # effects drawn over the beat in vacuum
GROWING = ("strobe_rate", "balance_drift", "stiffness_drift")  # effects that change from beat to beat
TRIAL = 3  # test of the DelFly, from 0, that is drawn over the beat
LEAST = 0.01  # mm or mN: smallest range of an axis to either side


def panels(effect: Effect) -> list[Panel]:
    """Return the panels of an effect: three in a row for the wing and two for the vehicle, where it applies."""
    made = {"wing": wing_panels, "vehicle": vehicle_panels}
    rigs = [rig_of(kind, quick=False) for kind in made]
    return [panel for rig in rigs if effect.applies_to(rig.description) for panel in made[rig.kind](rig, effect)]


def wing_panels(rig: Rig, effect: Effect) -> list[Panel]:
    """Return three panels of the change that an effect makes to marker positions (mm).

    They show two markers over the beat, the RMS change of all markers against flap frequency, and against airspeed or
    pressure.
    """
    there = vacuum(EMPTY, LAG, FREQUENCY) if effect.name in IN_VACUUM else tunnel(LAG, FREQUENCY, AIRSPEED)
    empty, air = [vacuum(EMPTY, LAG, f) for f in FREQUENCIES], [tunnel(LAG, f, AIRSPEED) for f in FREQUENCIES]
    pressing = effect.name in OF_PRESSURE
    places = PRESSURES if pressing else AIRSPEEDS
    swept = [vacuum(p, LAG, FREQUENCY) if pressing else tunnel(LAG, FREQUENCY, p) for p in places]
    moved = displacements(rig, effect, [recorded(rig, one) for one in dict.fromkeys([there, *empty, *air, *swept])])
    sizes = {one.condition: rig.unit * rig.rms(change) for one, change in moved}
    by_frequency = tuple(
        Line(name, np.array(FREQUENCIES), np.array([sizes[one] for one in conditions]), dots=True)
        for name, conditions in ((f"vacuum, {EMPTY:g} mbar", empty), (f"air at {AIRSPEED:g} m/s", air))
    )
    along = Line(
        "still air" if pressing else "air", np.array(places), np.array([sizes[one] for one in swept]), dots=True
    )
    return [
        over_the_beat(rig, effect, *next(pair for pair in moved if pair[0].condition == there)),
        Panel("All markers, by frequency", "flap frequency, Hz", "RMS change, mm", by_frequency, holds=(0.0, LEAST)),
        Panel(
            f"All markers, {FREQUENCY:g} Hz, by {'pressure' if pressing else 'airspeed'}",
            "pressure, mbar" if pressing else "airspeed, m/s",
            "RMS change, mm",
            (along,),
            holds=(0.0, LEAST),
        ),
    ]


def over_the_beat(rig: Rig, effect: Effect, recording: Recording, change: Array) -> Panel:
    """Return a panel of the displacement (mm) of two markers over the beat, along the axis where it is largest.

    ``change`` [T, C]: displacement of all markers (m) at T samples; C = 3 M columns, x, y, z of each of M markers.
    """
    wing = _wing_of(rig)
    shown = shown_markers(wing, effect)
    tracks = rig.unit * change.reshape(len(change), -1, 3)[:, list(shown.values())]
    squares = (tracks**2).sum(axis=(0, 1))
    axis = int(np.argmax(squares >= 0.999 * squares.max()))  # the first of axes that are equal within rounding
    if effect.name in GROWING:
        x, label, order = recording.times, "time, s", np.arange(len(recording.times))
    else:
        turns = recording.condition.flap_frequency * recording.times - recorded_crossing(wing, recording) / (2 * np.pi)
        x, label = turns % 1.0, "part of the beat since the upstroke crossing"
        order = np.argsort(x[: FRAMES // 2])  # the second half has the same phases again
    lines = tuple(Line(name, x[order], tracks[order, k, axis]) for k, name in enumerate(shown))
    where = recording.condition
    medium = f"air at {where.airspeed:g} m/s" if where.airspeed else f"vacuum, {EMPTY:g} mbar"
    title = f"{where.flap_frequency:g} Hz, {medium}"
    return Panel(title, label, f"change along {'xyz'[axis]}, mm", lines, holds=around_zero(lines))


def shown_markers(wing: Wing, effect: Effect) -> dict[str, int]:
    """Return the indices of two markers by name: the tip and one at mid-span.

    For a fault of a single marker they are that marker and its neighbour.
    """

    def at(station: float, chord: float) -> npt.NDArray[np.intp]:
        return np.asarray(nearest(wing, {"station": np.array([station]), "chord": np.array([chord])})[0])

    if set(PLACE) <= set(effect.shape):
        concerned = at(*(p.typical for p in PLACE))
        return {"the marker": int(concerned[0]), "its neighbour": int(concerned[1])}
    return {"tip": int(at(1.0, 0.5)[0]), "trailing edge, mid-span": int(at(0.5, 1.0)[0])}


def vehicle_panels(rig: Rig, effect: Effect) -> list[Panel]:
    """Return two panels of the change of force (mN) by an effect: over the beat, and its RMS in all tests."""
    moved = displacements(rig, effect, rig.recordings(rig.stands_for(effect)))
    recording, change = moved[TRIAL]
    beats = recording.condition.flap_frequency * recording.times
    shown = slice(None) if effect.name in GROWING else slice(PER_BEAT)
    numbers = np.array([k + 1.0 for k in range(len(moved))])
    beat = tuple(Line(a, beats[shown], rig.unit * change[shown, k]) for k, a in enumerate(rig.axes))
    sizes = tuple(
        Line(a, numbers, np.array([rig.unit * rig.rms(one[:, k]) for _, one in moved]), dots=True)
        for k, a in enumerate(rig.axes)
    )
    return [
        Panel(f"DelFly, test {TRIAL + 1}", "t*", "change of force, mN", beat, holds=around_zero(beat)),
        Panel("DelFly, all tests", "test", "RMS change, mN", sizes, holds=(0.0, LEAST)),
    ]


def around_zero(lines: Sequence[Line]) -> tuple[float, ...]:
    """Return the values that the y axis must include: zero, or -LEAST and LEAST if all changes are small."""
    largest = max(float(np.abs(line.y).max()) for line in lines)
    return (0.0,) if largest > LEAST else (-LEAST, LEAST)


def displacements(rig: Rig, effect: Effect, recordings: Sequence[Recording]) -> list[tuple[Recording, Array]]:
    """Return each recording with the change that the effect at its typical size makes to it.

    The change is [T, C] (T samples, C recorded columns), in m or N.
    """
    whole = displacement(rig, effect, effect.typical(rig.description), tuple(recordings))
    ends = np.cumsum([one.values.size for one in recordings])[:-1]
    parts = np.split(whole, ends)
    return [(one, part.reshape(one.values.shape)) for one, part in zip(recordings, parts, strict=True)]


def _wing_of(rig: Rig) -> Wing:
    if not isinstance(rig.description, Wing):
        raise TypeError(f"{rig.description.name!r} is a vehicle; markers are those of a wing")
    return rig.description


def draw(names: Sequence[str], folder: Path, say: Callable[[str], None]) -> None:
    """Write the figures of the effects ``names`` to ``folder``; ``say`` gets a line of progress for each."""
    folder.mkdir(parents=True, exist_ok=True)
    for k, name in enumerate(names):
        began = time.monotonic()
        file, made = folder / f"{name}.svg", panels(EFFECTS[name])
        file.write_text(svg(made, columns=min(3, len(made))), encoding="utf-8")
        say(f"[{k + 1}/{len(names)}] {file} {time.monotonic() - began:.1f} s")


def main() -> None:
    """Parse the command line, and draw the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="effects; all without")
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the figures go")
    arguments = parser.parse_args()
    names = arguments.names or list(EFFECTS)
    for name in names:
        if name not in EFFECTS:
            parser.error(f"unknown effect {name!r}; there are {', '.join(EFFECTS)}")
    draw(names, arguments.folder, lambda line: print(line, file=sys.stderr, flush=True))


if __name__ == "__main__":
    main()
