"""The misfit over the beat, from any answer of the client or result of the library; without plotly, as the curves."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from wingfit.plot.curves import PHASE, Curves, curves_of, finding_data, kind_of, misfit_unit, model_names, track_arrays
from wingfit.records.array_types import Array

COLUMNS = 40  # parts of the beat over which distances are averaged: frames come from many beats


@dataclasses.dataclass(frozen=True)
class Misfit:
    """Misfit over the beat or over time, in ``unit``.

    ``x`` [N] is the phase or the time (s), as ``x_label`` says; ``lines`` maps names to values [N]. Of a finding on
    tracks, ``maps`` has the values [B, N] of each model over B stations ``bands`` of the span (0 root, 1 tip), and
    ``lines`` their root mean square over the span. ``noise``: the misfit by noise alone, None if it is not known.
    ``signed``: whether the lines are differences, recorded minus simulated, rather than sizes.
    """

    title: str
    unit: str
    x: Array
    x_label: str
    lines: Mapping[str, Array]
    noise: float | None = None
    signed: bool = False
    bands: Array | None = None
    maps: Mapping[str, Array] = dataclasses.field(default_factory=dict)


def misfits_of(source: object, recording: str | None = None) -> list[Misfit]:
    """Return the misfit over the beat of ``source``: of a finding or tracks one, of forces one for each force.

    Args:
        source: as for :func:`wingfit.plot.curves.curves_of`.
        recording: of series and forces, only its misfits; a finding and tracks have one misfit.

    Raises:
        TypeError, ValueError: as :func:`wingfit.plot.curves.curves_of`.
    """
    match kind_of(source):
        case "finding":
            return _of_finding(source, recording)
        case "tracks":
            return [_of_tracks(source)]
    return [_of_curves(one) for one in curves_of(source, recording)]


def _of_finding(source: object, recording: str | None) -> list[Misfit]:
    finding = finding_data(source)
    given = finding["phase_map"]
    if recording is not None or given is None or not given["phase"]:
        return [_of_curves(one) for one in curves_of(source, recording)]
    factor, unit = misfit_unit(finding)
    maps = {name: factor * np.array(given[stage], dtype=float) for stage, name in model_names(finding).items()}
    over_span = {name: np.sqrt(np.mean(values**2, axis=0)) for name, values in maps.items()}
    several = len(given["bands"]) > 1
    return [
        Misfit(
            title="misfit over the beat, root mean square over all recordings",
            unit=unit,
            x=np.array(given["phase"], dtype=float),
            x_label=PHASE,
            lines=over_span,
            noise=factor * given["noise"],
            bands=np.array(given["bands"], dtype=float) if several else None,
            maps=maps if several else {},
        )
    ]


def _of_tracks(source: object) -> Misfit:
    assert isinstance(source, Mapping)  # noqa: S101  kind_of has found it to be an answer
    phase, recorded, simulated = track_arrays(source)
    distance = np.linalg.norm(recorded - simulated, axis=2)
    column = np.minimum((phase * COLUMNS).astype(int), COLUMNS - 1)
    kept = [k for k in range(COLUMNS) if np.isfinite(distance[column == k]).any()]
    return Misfit(
        title=f"distance between recorded and simulated markers, {source['recording']}",
        unit="mm",
        x=(np.array(kept) + 0.5) / COLUMNS,
        x_label=PHASE,
        lines={
            "mean of the markers": np.array([np.nanmean(distance[column == k]) for k in kept]),
            "largest": np.array([np.nanmax(distance[column == k]) for k in kept]),
        },
    )


def _of_curves(one: Curves) -> Misfit:
    lines = {name: one.residual(name) for name in one.models}
    return Misfit(f"residual: {one.title}", one.unit, one.x, one.x_label, lines, signed=True)
