"""Single markers: placeholders for gaps, frozen and exchanged markers, jumps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import linear_sum_assignment

from wingfit.checks.harmonics import fit
from wingfit.checks.mistake import Mistake, TableEdit, change_of
from wingfit.checks.tracked import Tracked
from wingfit.records.array_types import Array, Mask

REPEATED = 3  # frames with exactly the same position, far from all others, are placeholders
AWAY = 0.08  # spans from the marker's own track
HELD = 5  # consecutive frames in which a moving marker stands exactly still
MOVED = 0.02  # spans that the other markers move meanwhile
EXCHANGED = 0.25  # of the distances from their own rest positions, those from each other's at most
JUMP = 0.1  # spans from the harmonics of the marker's own motion
SHOWN = 3


def check_markers(tracked: Tracked) -> Iterator[Mistake]:
    """Yield mistakes in single markers of a recording whose axes and unit are right."""
    placeholders = _placeholders(tracked)
    if placeholders:
        yield placeholders
    frozen = _frozen(tracked)
    if frozen:
        yield frozen
    if (exchanged := _exchanged(tracked)) is not None:
        yield exchanged
    elif not placeholders and not frozen and (jumps := _jumps(tracked)) is not None:
        yield jumps


def placeholders_of(positions: Array, far: float) -> dict[float, Mask]:
    """Return, by the value that fills gaps in ``positions`` [T, M, 3], the mask [T, M] of the frames filled with it.

    All three coordinates are the same number, at least REPEATED times, farther than ``far`` from the marker's median.
    """
    same = (positions[..., 0] == positions[..., 1]) & (positions[..., 1] == positions[..., 2])
    found = dict[float, Mask]()
    for value, count in zip(*np.unique(positions[same][:, 0], return_counts=True), strict=True):
        if count >= REPEATED:
            filled = same & (positions[..., 0] == value)
            others = np.where(filled[..., None], np.nan, positions)
            with np.errstate(all="ignore"):
                seen = np.isfinite(others).all(axis=-1)
                nearest = np.where(seen, np.linalg.norm(np.nan_to_num(others) - value, axis=-1), np.inf).min(axis=0)
            filled &= nearest > far
            if filled.sum() >= REPEATED:
                found[float(value)] = filled
    return found


def _placeholders(tracked: Tracked) -> Mistake | None:
    positions = tracked.recording.positions
    found = placeholders_of(positions, AWAY * tracked.wing.span)
    if not found:
        return None
    value, filled = max(found.items(), key=lambda item: int(item[1].sum()))
    names = [name for name, some in zip(tracked.recording.markers, _any(filled), strict=True) if some]
    values = tuple(found)

    def emptied(times: Array, table: Array, _: tuple[str, ...]) -> tuple[Array, Array]:
        places = table.reshape(len(table), -1, 3)
        for one in values:
            places = np.where((places == one).all(axis=-1)[..., None], np.nan, places)
        return times, places.reshape(table.shape)

    edit = TableEdit(tracked.recording.name, f"x, y, z of {_names(names)}", f"{value:g}", "empty cells", emptied)
    return Mistake(
        "placeholders",
        f"recording {tracked.recording.name!r}",
        f"{int(filled.sum())} positions of {_names(names)} are exactly ({value:g}, {value:g}, {value:g})",
        "empty cells where a marker was not seen",
        f"the tracker wrote {value:g} for gaps",
        change_of([edit]),
        True,
        (edit,),
    )


def _frozen(tracked: Tracked) -> Mistake | None:
    """Markers that stand exactly still for several frames while the others move."""
    places = tracked.recording.positions
    if len(places) <= HELD:
        return None
    steps = np.diff(places, axis=0)
    still, moved = (steps == 0).all(axis=-1), np.linalg.norm(steps, axis=-1)
    usual = _usual(np.where(still, np.nan, moved))
    held = _runs(still, usual, MOVED * tracked.wing.span)
    if not held.any() or still.mean() > 0.5:
        return None
    names = [name for name, some in zip(tracked.recording.markers, _any(held), strict=True) if some]
    limit, span = HELD, tracked.wing.span

    def emptied(times: Array, table: Array, _: tuple[str, ...]) -> tuple[Array, Array]:
        positions = table.reshape(len(table), -1, 3)
        one = np.diff(positions, axis=0)
        sizes = _usual(np.linalg.norm(one, axis=-1))
        repeated = _runs((one == 0).all(axis=-1), sizes, MOVED * span)
        first = repeated.all(axis=0)  # held throughout: no frame shows the marker
        gone = np.vstack([first, repeated])
        return times, np.where(gone[..., None], np.nan, positions).reshape(table.shape)

    whole = held.all(axis=0).any()
    edit = TableEdit(
        tracked.recording.name, f"x, y, z of {_names(names)}", "repeated positions", "empty cells", emptied
    )
    return Mistake(
        "frozen marker",
        f"recording {tracked.recording.name!r}",
        f"{_names(names)} stand{'s' if len(names) == 1 else ''} exactly still for {limit} frames while others move",
        "positions that change with the wing, or empty cells",
        "the tracker repeated the last position when it lost the marker",
        change_of([edit]),
        bool(whole),
        (edit,),
    )


def _usual(steps: Array) -> Array:
    """Median [T] over the markers of the lengths ``steps`` [T, M] (m) of their moves; 0 where none was seen."""
    seen = np.isfinite(steps).any(axis=1)
    out = np.zeros(len(steps))
    out[seen] = np.nanmedian(steps[seen], axis=1)
    return out


def _runs(still: Mask, usual: Array, least: float) -> Mask:
    """Mask [T - 1, M] of steps in runs of at least HELD that are ``still`` while the others move ``least`` (m)."""
    held = np.zeros_like(still)
    path = np.concatenate([[0.0], np.cumsum(usual)])
    for marker in np.flatnonzero(still.sum(axis=0) >= HELD):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], still[:, marker].astype(int), [0]])))
        for start, end in zip(edges[::2], edges[1::2], strict=True):
            if end - start >= HELD and path[end] - path[start] > least:
                held[start:end, marker] = True
    return held


def _exchanged(tracked: Tracked) -> Mistake | None:
    """Markers whose places along chord and span, which flapping hardly changes, are those of others at rest."""
    own = _outline(tracked.rest - tracked.hinge)
    places = _outline(tracked.positions - tracked.hinge)
    seen = np.flatnonzero(np.isfinite(places).all(axis=2).any(axis=0))
    now = np.full(own.shape, np.nan)
    now[seen] = np.nanmedian(places[:, seen], axis=0)
    if len(seen) < 3:
        return None
    distances = np.linalg.norm(now[seen][:, None] - own[seen][None], axis=2)
    squares = distances**2
    if not np.isfinite(squares).all():  # positions beyond 1e150 m
        return None
    rows, columns = linear_sum_assignment(squares)
    wrong = np.flatnonzero(rows != columns)
    if len(wrong) < 2:
        return None
    before, after = (
        np.sqrt((distances[wrong, wrong] ** 2).mean()),
        np.sqrt((distances[wrong, columns[wrong]] ** 2).mean()),
    )
    spacing = float(np.median(np.sort(np.linalg.norm(own[:, None] - own[None], axis=2), axis=1)[:, 1]))
    if after > EXCHANGED * before or before < 0.4 * spacing:
        return None
    names, source = tracked.recording.markers, np.arange(len(tracked.rest))
    for here, there in zip(seen[wrong], seen[columns[wrong]], strict=True):
        source[there] = here
    pairs = ", ".join(
        f"{names[k]} -> {names[t]}" for k, t in zip(seen[wrong][:4], seen[columns[wrong]][:4], strict=True)
    )
    edit = TableEdit(
        tracked.recording.name, f"columns of {_names([names[k] for k in seen[wrong]])}", "names as given", pairs,
        lambda times, values, _: (times, values.reshape(len(values), -1, 3)[:, source].reshape(values.shape)),
    )  # fmt: skip
    return Mistake(
        "swapped markers",
        f"recording {tracked.recording.name!r}",
        f"{_names([names[k] for k in seen[wrong]])} are {before:.3g} m (root mean square) from their places at rest",
        f"{after:.3g} m, as with other names: {pairs}",
        "the names of markers are exchanged in the tracks",
        change_of([edit]),
        len(wrong) > 2 or before > 1.5 * spacing,
        (edit,),
    )


def _outline(arms: Array) -> Array:
    """Place along the chord and distance from the hinge axis [..., 2] of ``arms`` [..., 3] from the hinge, m."""
    return np.stack([arms[..., 0], np.hypot(arms[..., 1], arms[..., 2])], axis=-1)


def _jumps(tracked: Tracked) -> Mistake | None:
    """Positions far from the harmonics of the marker's own motion, where the harmonics fit most others."""
    flat = tracked.positions.reshape(len(tracked.times), -1)
    if len(flat) < 30:
        return None
    waves = fit(tracked.times, flat, tracked.frequency, 3)
    far = np.linalg.norm((flat - waves.at(tracked.times, tracked.frequency)).reshape(tracked.positions.shape), axis=-1)
    usual = np.nanmedian(far)
    jumped = far > max(JUMP * tracked.wing.span, 12 * usual)
    if jumped.sum() < 1 or jumped.mean() > 0.1 or usual > 0.03 * tracked.wing.span:
        return None
    names = [name for name, some in zip(tracked.recording.markers, _any(jumped), strict=True) if some]
    frame = int(np.flatnonzero(jumped.any(axis=1))[0])
    return Mistake(
        "jumps",
        f"recording {tracked.recording.name!r}",
        f"{int(jumped.sum())} positions of {_names(names)} are up to {np.nanmax(far):.3g} m off their usual motion, "
        f"first at {tracked.times[frame]:.6g} s",
        f"within {max(JUMP * tracked.wing.span, 12 * usual):.3g} m",
        "the tracker followed something else, or exchanged markers for some frames",
        f"recordings/{tracked.recording.name}.csv: empty these cells, or track the frames again",
    )


def _any(mask: Mask) -> list[bool]:
    """Whether each column of ``mask`` [T, M] has an entry."""
    return [bool(column.any()) for column in mask.T]


def _names(names: list[str]) -> str:
    more = f" and {len(names) - SHOWN} more markers" if len(names) > SHOWN else ""
    return f"marker{'' if len(names) == 1 else 's'} {', '.join(names[:SHOWN])}{more}"
