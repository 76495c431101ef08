"""All checks of a dataset, in the order in which one mistake hides another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from wingfit.checks.axes import check_shape
from wingfit.checks.conditions import check_conditions
from wingfit.checks.drive import check_drive
from wingfit.checks.forces import check_forces
from wingfit.checks.frequency import check_frequency
from wingfit.checks.markers import check_markers
from wingfit.checks.mistake import Mistake, together
from wingfit.checks.recordings import check_recordings
from wingfit.checks.tracked import Tracked
from wingfit.checks.zeros import check_zero_forces
from wingfit.records import AnyDataset, Dataset, Wing
from wingfit.records.blas_threads import one_blas_thread


@one_blas_thread
def examine(dataset: AnyDataset) -> tuple[Mistake, ...]:
    """Return the likely mistakes in ``dataset``: certain ones first. The same dataset gives the same answer."""
    found = list(check_recordings(dataset))
    if isinstance(dataset, Dataset):
        found += check_conditions(dataset)
        found += _wing(dataset, dataset.rig) if isinstance(dataset.rig, Wing) else _vehicle(dataset)
    merged = together(found, len(dataset.recordings))
    return tuple(sorted(merged, key=lambda one: not one.certain))


def _wing(dataset: Dataset, wing: Wing) -> Iterator[Mistake]:
    """Placeholders and units first, then axes; frequency, markers and drive only of recordings whose shape fits."""
    good, indices = list[Tracked](), list[int]()
    known = {marker.name for marker in wing.markers}
    for index, recording in enumerate(dataset.recordings):
        if not recording.markers or any(name not in known for name in recording.markers):
            continue
        tracked = Tracked.of(recording, wing)
        markers = list(check_markers(tracked))
        filled = [one for one in markers if one.kind == "placeholders"]
        if (shape := None if filled else check_shape(tracked)) is not None:
            yield shape
            continue
        yield from markers
        repeats = None if filled else check_frequency(recording, index)
        if repeats is not None:
            yield repeats
        elif not filled:
            good.append(tracked)
            indices.append(index)
    yield from check_drive(good, indices)


def _vehicle(dataset: Dataset) -> Iterator[Mistake]:
    blocked = False
    for index, recording in enumerate(dataset.recordings):
        zeros = check_zero_forces(recording)
        repeats = None if zeros else check_frequency(recording, index)
        yield from (one for one in (zeros, repeats) if one is not None)
        blocked |= zeros is not None or repeats is not None
    if not blocked:  # estimates, of which some model may have no gene, do not matter: its coefficients are free
        yield from check_forces(replace(dataset, rig=replace(dataset.vehicle, estimates={})))
