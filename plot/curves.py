"""Recorded and simulated values over the beat or over time, from any answer of the client or result of the library.

Nothing here draws or needs plotly: the plots of the command line use the same values.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import numpy as np

from wingfit.records.array_types import Array
from wingfit.report.gaps import starts_after_gaps

AXES = "xyz"
MOST_MARKERS = 4  # drawn unless markers are named: more rows cannot be read
PHASE, TIME = "phase of the beat", "time, s"
QUANTITIES = {"lift": "lift", "drag": "drag", "x": "force along x", "z": "force along z"}
ONE_NEWTON = 1.0

Kind = Literal["finding", "tracks", "forces", "series"]


@dataclasses.dataclass(frozen=True)
class Curves:
    """One recorded channel and its simulations, N values each, in ``unit``; NaN where nothing was recorded.

    ``x`` [N] is the phase of the beat or the time (s), as ``x_label`` says, and increases. ``models`` maps the name of
    a simulation to its values [N]. ``spread`` [N] is the standard deviation between beats; None if it is not known.
    """

    title: str
    unit: str
    x: Array
    x_label: str
    recorded: Array
    models: Mapping[str, Array]
    spread: Array | None = None

    @property
    def several_beats(self) -> bool:
        """Whether the values come from several beats, so that neighbours in phase are not neighbours in time."""
        return self.x_label == PHASE and self.spread is None

    def residual(self, model: str) -> Array:
        """Return recorded minus simulated values [N] of one of ``models``."""
        return self.recorded - self.models[model]


def kind_of(source: object) -> Kind:
    """Return what ``source`` holds. TypeError if it is nothing that has values over the beat or over time."""
    keys = set(source) if isinstance(source, Mapping) else set(vars(source)) if hasattr(source, "__dict__") else set()
    marks: dict[str, Kind] = {
        "overlays": "finding",
        "recorded_mm": "tracks",
        "recorded_n": "forces",
        "curves": "series",
    }
    for mark, kind in marks.items():
        if mark in keys:
            return kind
    raise TypeError(
        f"{type(source).__name__} has no recorded and simulated values; give a finding, Client.comparison(...), "
        "Client.forces(...), Client.simulate(...) or the result of a run on series"
    )


def curves_of(source: object, recording: str | None = None, channels: Sequence[str] | None = None) -> list[Curves]:
    """Return the curves that ``source`` holds.

    Args:
        source: a finding (:class:`wingfit.Finding`, or its JSON), an answer of :meth:`wingfit.Client.comparison`,
            ``simulate``, ``forces`` or ``simulate_forces``, or the result of a run on series.
        recording: only its curves; None: of all that ``source`` has.
        channels: only these: of tracks "MARKER_x", "MARKER_y", "MARKER_z", of forces "x", "z", "lift", "drag", else the
            names of the channels. None: of tracks the heights z of up to 4 markers from root to tip, else all.

    Raises:
        TypeError: ``source`` has no such values.
        ValueError: there are none of this recording or of these channels; the message names those that there are.
    """
    found = list(_EVERY[kind_of(source)](source, channels))
    known = dict.fromkeys(name for name, _, _ in found)
    if recording is not None and recording not in known:
        raise ValueError(f"there are no curves of the recording {recording!r}; there are those of {_listed(known)}")
    here = [(name, _with_gaps(curves)) for where, name, curves in found if recording in (None, where)]
    missing = [one for one in channels or () if one not in {name for name, _ in here}]
    if missing or not here:
        there = _listed(dict.fromkeys(name for name, _ in here))
        raise ValueError(f"there are no curves of {_listed(missing) or 'any channel'}; there are {there or 'none'}")
    return [curves for name, curves in here if channels is None or name in channels]


def finding_data(finding: object) -> Mapping[str, Any]:
    """Return the JSON of ``finding``, a :class:`wingfit.Finding` or already its JSON; TypeError for anything else."""
    if isinstance(finding, Mapping):
        if "hypotheses" not in finding:
            raise TypeError(f"not the JSON of a finding: it has {_listed(finding)}; give Client.finding(...)")
        return finding
    if not hasattr(finding, "hypotheses"):
        raise TypeError(f"{type(finding).__name__} is not a finding; give what wingfit.diagnose(...) returns")
    from wingfit.report.finding_file import finding_json  # imported late: JSON needs nothing that computes

    return finding_json(finding)  # type: ignore[arg-type]  # checked above


def model_names(finding: Mapping[str, Any]) -> dict[str, str]:
    """Return the names of the models that a finding compares: "before" and, where effects were added, "after"."""
    if not finding["added_effects"]:
        return {"before": "nominal model, refitted"}
    after = "the named effects" if finding["named"] else "the closest of the library"
    return {"before": "before: nominal model, refitted", "after": f"after: with {after}"}


def misfit_unit(finding: Mapping[str, Any]) -> tuple[float, str]:
    """Return the factor from the unit of a finding to that of its figures, and the latter: mm, mN or × noise."""
    return {"m": (1e3, "mm"), "N": (1e3, "mN")}.get(finding["unit"], (1.0, "× noise"))


def _with_gaps(curves: Curves) -> Curves:
    """Return ``curves`` over time with an instant without values in each gap, over which no line is drawn."""
    starts = starts_after_gaps(curves.x) if curves.x_label == TIME else []
    if not starts:
        return curves
    between = (curves.x[starts] + curves.x[np.array(starts) - 1]) / 2

    def parted(values: Array) -> Array:
        return np.insert(values, starts, np.nan)

    return dataclasses.replace(
        curves,
        x=np.insert(curves.x, starts, between),
        recorded=parted(curves.recorded),
        models={name: parted(values) for name, values in curves.models.items()},
    )


Found = Iterator[tuple[str, str, Curves]]  # recording, channel, curves


def _of_finding(source: object, _: Sequence[str] | None) -> Found:
    finding = finding_data(source)
    factor, unit = misfit_unit(finding)
    names = model_names(finding)
    for one in finding["overlays"]:
        own = one.get("unit") or ""
        scale, shown = (1.0, "" if own == "1" else own) if own or finding["kind"] == "series" else (factor, unit)
        times = one.get("times") or []
        use = "held out" if one["held_out"] else "fitted"
        yield (
            one["recording"],
            one["channel"],
            Curves(
                title=f"{one['channel']}, {one['recording']} ({use})",
                unit=shown,
                x=_array(times or one["phase"]),
                x_label=TIME if times else PHASE,
                recorded=scale * _array(one["recorded"]),
                models={name: scale * _array(one[stage]) for stage, name in names.items()},
            ),
        )


def _of_tracks(source: Any, channels: Sequence[str] | None) -> Found:
    phase, recorded, simulated = track_arrays(source)
    for m in chosen_markers(recorded, simulated, phase) if channels is None else range(len(source["markers"])):
        for k, axis in enumerate(AXES):
            if channels is None and axis != "z":
                continue
            name = f"{source['markers'][m]}_{axis}"
            yield (
                source["recording"],
                name,
                Curves(
                    title=f"marker {source['markers'][m]}, {simulated[0, m, 1]:.3g} mm along the span: {axis}",
                    unit="mm",
                    x=phase,
                    x_label=PHASE,
                    recorded=recorded[:, m, k],
                    models={"simulated": simulated[:, m, k]},
                ),
            )


def _of_forces(source: Any, _: Sequence[str] | None) -> Found:
    x = _array(source["phase"])
    for name, recorded in source["recorded_n"].items():
        values = _array(recorded), _array(source["modelled_n"][name])
        factor, unit = force_scale(*values)
        spread = source["standard_deviation_n"].get(name)
        yield (
            source["recording"],
            name,
            Curves(
                title=f"{QUANTITIES.get(name, name)}, {source['recording']}",
                unit=unit,
                x=x,
                x_label=PHASE,
                recorded=factor * values[0],
                models={f"modelled, {source['source']} coefficients": factor * values[1]},
                spread=None if spread is None else factor * _array(spread),
            ),
        )


def _of_series(source: Any, _: Sequence[str] | None) -> Found:
    curves = source["curves"] if isinstance(source, Mapping) else source.curves
    for one in curves:
        given = one if isinstance(one, Mapping) else vars(one) | {"time_s": one.time}
        models = {"nominal genome": given["nominal"], "best genome": given["best"]}
        yield (
            given["recording"],
            given["channel"],
            Curves(
                title=f"{given['channel']}, {given['recording']} ({'held out' if given['held_out'] else 'fitted'})",
                unit="" if given["unit"] == "1" else given["unit"],
                x=_array(given["time_s"]),
                x_label=TIME,
                recorded=_array(given["recorded"]),
                models={name: _array(values) for name, values in models.items() if values is not None},
            ),
        )


_EVERY = {"finding": _of_finding, "tracks": _of_tracks, "forces": _of_forces, "series": _of_series}


def track_arrays(tracks: Mapping[str, Any]) -> tuple[Array, Array, Array]:
    """Return phase [T], recorded and simulated positions [T, M, 3] (mm) in the order of the phase; NaN for none."""
    phase = _array(tracks["phase"])
    order = np.argsort(phase, kind="stable")  # a stroboscopic recording takes its frames from many beats
    recorded, simulated = (np.array(tracks[key], dtype=float)[order] for key in ("recorded_mm", "simulated_mm"))
    return phase[order], recorded, simulated


def chosen_markers(recorded: Array, simulated: Array, phase: Array) -> list[int]:
    """Return the indices of up to 4 markers that were seen in half of the frames at least, from the root to the tip."""
    seen = np.isfinite(recorded).all(axis=2).sum(axis=0)
    kept = np.flatnonzero(seen >= len(phase) / 2)
    by_span = kept[np.argsort(simulated[0, kept, 1], kind="stable")]
    if len(by_span) <= MOST_MARKERS:
        return [int(m) for m in by_span]
    return [int(by_span[round(k * (len(by_span) - 1) / (MOST_MARKERS - 1))]) for k in range(MOST_MARKERS)]


def force_scale(*newtons: Array) -> tuple[float, str]:
    """Return the factor from newtons to the unit that suits the largest value, and that unit: N or mN."""
    largest = max((float(np.nanmax(np.abs(one))) for one in newtons if len(one)), default=0.0)
    return (1.0, "N") if largest >= ONE_NEWTON else (1e3, "mN")


def _array(values: Any) -> Array:
    return np.array(values, dtype=float)


def _listed(names: Any) -> str:
    return ", ".join(str(name) for name in names)
