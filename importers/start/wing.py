"""A first description of a wing from its tracks alone: rest positions, hinge and drive; the planform is assumed."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from wingfit.importers.options import question
from wingfit.importers.start.correlation import correlated_rows
from wingfit.importers.start.harmonics import columns
from wingfit.importers.start.hinge import Hinge, find_hinge
from wingfit.importers.tracks import ImportedTracks
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import DatasetError, counted, fail
from wingfit.records.limits import IMPLAUSIBLE_SPANS

_OTHER_SIDE = 0.25  # of the outermost distance: markers so far on the other side belong to another wing
_MARGIN = 0.08  # of the span, by which the assumed planform is larger than the area of the markers
_LEAST_CHORD = 0.15  # of the span
_LEAST_FLAP = 0.2  # of the variance of the flap angle, by the frequency
_MOST_DRIFT = 3.0  # of the peak-to-peak flapping of the middle of the markers; a wing that folds has up to 2
_STILL = 1e-6  # rad: a flap angle that varies less is that of a wing at rest
_THICKNESS = (0.04, 0.008)  # at root and tip, of the span
_FIXED = 0.2  # of that flapping: with more drift, the circles are not about a fixed point
_LEAST_ROWS = 8
_THINNEST = 1e-5  # m
_AREAL_DENSITY = 1.0  # kg/m^2
# Of a wing, m: positions are rounded to 1e-6 m, and dataset.yaml has limits (docs/formats.md).
_LEAST_SIZE, _LARGEST_SIZE = 1e-4, 10.0
_LARGEST_CHORD, _THICKEST, _FARTHEST = 5.0, 0.5, 9.0
_NOISY = 0.05  # of the flap angle: a standard error at which the user measures it


@dataclass(frozen=True)
class Fact:
    """One number of a description: ``what``, its ``value`` as text, and where it is from: the tracks, or assumed."""

    what: str
    value: str
    source: str


@dataclass(frozen=True)
class FirstWing:
    """The key ``wing`` of ``dataset.yaml`` as ``yaml``, and the ``facts`` in it."""

    yaml: str
    facts: tuple[Fact, ...]


def describe_wing(tracks: ImportedTracks, frequency: float, name: str) -> FirstWing:
    """Return the description of a rigid wing whose markers moved as ``tracks``, which are in the axes of the wing.

    The flap angle is a cosine of ``frequency`` (Hz) about the mean pose, in which the markers rest. The hinge is that
    of :func:`find_hinge`. The planform is assumed as the rectangle around the markers at rest. DatasetError for markers
    that do not flap at ``frequency``, that drift away with a body, or that are on a wing to which y points in.
    """
    places = tracks.positions
    extent = float(np.max(np.nanmax(places, axis=(0, 1)) - np.nanmin(places, axis=(0, 1))))
    _check_size(tracks, "extent", min(extent, _LARGEST_SIZE), _LARGEST_SIZE)  # a larger one may be that of a flight
    drift, flapping = _drift(tracks, frequency)
    _refuse_drift(tracks, drift, flapping)
    found = find_hinge(tracks, frequency, drifts=drift > _FIXED * flapping)
    _refuse_other_side(tracks, found)
    hinge = found.place
    arms = places[..., 1] - hinge[0] + 1j * (places[..., 2] - hinge[1])
    flap = _flap(tracks.times, arms, frequency)
    if flap.explained < _LEAST_FLAP:
        message = (
            f"does not flap at {frequency:.4g} Hz, which explains {100 * flap.explained:.0f} % of the variance of the "
            "flap angle; choose markers and a part of the recording that flap, or give another frequency: "
            "--flap-frequency-hz 5"
        )
        raise DatasetError([question("flap_frequency_hz", tracks.file, frequency, message)])
    level = np.nanmean(arms * np.exp(-1j * flap.angle)[:, None], axis=0)
    rest = np.column_stack([np.nanmean(places[..., 0], axis=0), level.real + hinge[0], level.imag + hinge[1]])
    amplitude = float(np.degrees(flap.amplitude))
    root, tip = min(float(hinge[0]), float(rest[:, 1].min())), float(rest[:, 1].max())
    _check_size(tracks, "span", tip - root, _LARGEST_SIZE)
    margin = _MARGIN * (tip - root)
    tip += margin
    front, back = float(rest[:, 0].min()) - margin, float(rest[:, 0].max()) + margin
    chord = max(back - front, _LEAST_CHORD * (tip - root), _LEAST_SIZE)
    _check_size(tracks, "chord", chord, _LARGEST_CHORD)
    front = 0.5 * (front + back - chord)
    _check_place(tracks, rest, hinge, tip - root)
    nearest = tracks.markers[int(np.argmin(np.abs(level)))]
    lines = [
        "wing:",
        f"  name: {json.dumps(name, ensure_ascii=False)}",
        "  structure: rigid                # or sheet, to estimate a stiffness (docs/formats.md)",
        "  stations:                       # ASSUMED: the rectangle around the markers; replace it by your planform",
        *(
            f"    - {{y_m: {y:.6f}, leading_edge_m: {front:.6f}, chord_m: {chord:.6f}, "
            f"thickness_m: {min(max(part * (tip - root), _THINNEST), _THICKEST):.6f}}}"
            for y, part in zip((root, tip), _THICKNESS, strict=True)
        ),
        f"  materials: {{foam_density_kg_m3: 0, skin_areal_density_kg_m2: {_AREAL_DENSITY:g}}}   # ASSUMED",
        "  markers:                        # mean positions in the tracks, turned back by the flap angle",
        *(
            f"    - {{name: {json.dumps(marker)}, x_m: {x:.6f}, y_m: {y:.6f}, z_m: {z:.6f}, mass_kg: 0}}"
            for marker, (x, y, z) in zip(tracks.markers, rest.tolist(), strict=True)
        ),
        f"  reference_markers: [{json.dumps(nearest)}]",
        f"  hinge: {{y_m: {hinge[0]:.6f}, z_m: {hinge[1]:.6f}}}   # {found.source}",
        f"  drive: {{kind: fourier, mean_deg: 0, cosine_deg: [0], sine_deg: [{amplitude:.2f}]}}",
        "",
    ]
    digits = max(0, 2 - int(np.log10(1e3 * (tip - root))))
    where = f"y {_millimetres(hinge[0], digits)}, z {_millimetres(hinge[1], digits)}"
    where += "" if found.error is None else f", standard error {_at_least(1e3 * found.error)} mm"
    size = f"{_millimetres(tip - root, digits)} x {_millimetres(chord, digits)}, flat"
    facts = (
        Fact("rest positions", f"{counted(len(rest), 'marker')}, in the mean pose", "tracks"),
        _flap_fact(flap, found, float(np.nanmean(np.abs(level)))),
        Fact("hinge", where, found.source),
        Fact("planform", size, "assumed: a rectangle around the markers"),
        Fact("mass", f"{_AREAL_DENSITY:g} kg/m^2", "assumed"),
    )
    return FirstWing("\n".join(lines), facts)


def _flap_fact(flap: _Flap, hinge: Hinge, arm: float) -> Fact:
    """Return the flap angle with its standard error; ``arm``: mean distance of the markers from the hinge, m."""
    value = f"{np.degrees(flap.amplitude):.1f} deg to both sides of the mean"
    source = f"tracks: a cosine explains {100 * flap.explained:.0f} % of its variance"
    if hinge.error is None:
        return Fact("flap angle", value, f"{source}, about the assumed hinge: not exact, larger if it is farther out")
    # A hinge that is farther in makes the arms longer, and the angle smaller in proportion.
    error = float(np.hypot(flap.error, flap.amplitude * hinge.error / arm))
    noisy = "; measure it, or export a longer part" if error > _NOISY * flap.amplitude else ""
    return Fact("flap angle", f"{value}, standard error {_at_least(np.degrees(error))} deg", source + noisy)


def _at_least(error: float) -> str:
    """Return a standard error as text; 0.01 mm or deg is the least that recordings can have."""
    return f"{max(float(error), 0.01):.2g}"


def _millimetres(metres: float, digits: int) -> str:
    return f"{round(1e3 * float(metres), digits) + 0.0:.{digits}f} mm"


def _check_size(tracks: ImportedTracks, what: str, size: float, most: float) -> None:
    """Raise DatasetError if a wing with these markers has an implausible ``size`` (m): ``what``."""
    if _LEAST_SIZE <= size <= most:
        return
    message = (
        f"has the markers of a wing with {what} {size:.3g} m; it must be {_LEAST_SIZE:g} to {most:g} m: check the unit "
        "of positions (--unit), or choose the markers of one wing: --markers"
    )
    raise fail(tracks.file, f"{size:.3g} m", message)


def _check_place(tracks: ImportedTracks, rest: Float[Array, "M 3"], hinge: Array, span: float) -> None:
    """Raise DatasetError if a marker at ``rest`` (m) is farther from ``hinge`` or origin than a dataset allows."""
    for what, away, most in (
        ("the origin", rest, _FARTHEST),
        (f"the hinge of a wing with {span:.3g} m span", rest - [0.0, *hinge], IMPLAUSIBLE_SPANS * span),
    ):
        farthest = int(np.argmax(np.abs(away).max(axis=1)))
        distance = float(np.abs(away[farthest]).max())
        if distance > most:
            message = (
                f"has the marker {tracks.markers[farthest]} {distance:.3g} m from {what}; at most {most:.3g} m are "
                "read: subtract the position of the root of the wing from all, or check their unit (--unit)"
            )
            raise fail(tracks.file, f"{distance:.3g} m", message)


def refuse_two_wings(tracks: ImportedTracks) -> None:
    """Raise DatasetError, which asks for the option ``markers``, if the markers are clearly those of two wings."""
    middle = np.nanmedian(tracks.positions[..., 1], axis=0)
    far = float(np.abs(middle).max())
    if middle.min() > -_OTHER_SIDE * far or middle.max() < _OTHER_SIDE * far:
        return
    wing = [name for name, y in zip(tracks.markers, middle, strict=True) if y > _OTHER_SIDE * far]
    message = (
        f"has markers on both sides of y = 0, those of two wings; y must point out along the described one: choose "
        f"its markers: --markers {','.join(wing)}"
    )
    raise DatasetError([question("markers", tracks.file, None, message)])


def _drift(tracks: ImportedTracks, frequency: float) -> tuple[float, float]:
    """Return how far (m) the middle of the markers moves away, and its flapping from peak to peak (m)."""
    middle, times = _middle(tracks)
    if len(times) < _LEAST_ROWS:
        return 0.0, 0.0
    basis = columns(times, frequency, 1, drifts=True)
    found = np.linalg.lstsq(basis, middle, rcond=None)[0]
    return float(np.linalg.norm(found[1]) * np.ptp(times)), 2 * float(np.sqrt((found[2:] ** 2).sum()))


def _refuse_drift(tracks: ImportedTracks, drift: float, flapping: float) -> None:
    """Raise DatasetError if a ``drift`` (m) is most of the motion, and more than the ``flapping`` (m)."""
    if drift <= _MOST_DRIFT * flapping:
        return
    extent = float(np.ptp(_middle(tracks)[0], axis=0).max())
    if drift <= 0.5 * extent:
        return
    message = (
        f"has markers that move away by {drift:.3g} m while they flap by {flapping:.3g} m, as on a body that moves; a "
        "wing is described in the axes of its body: subtract the positions of a marker at the root of the wing, or "
        "import a part in which the body rests"
    )
    raise fail(tracks.file, f"{drift:.3g} m", message)


def _middle(tracks: ImportedTracks) -> tuple[Array, Array]:
    """Return the middle of the markers [N, 3] (m) and the times [N] (s), where all are seen."""
    complete = np.isfinite(tracks.positions).all(axis=(1, 2))
    return tracks.positions[complete].mean(axis=1), tracks.times[complete]


def _refuse_other_side(tracks: ImportedTracks, hinge: Hinge) -> None:
    """Raise DatasetError if the markers swing about a hinge that is farther out than they are."""
    farthest = float(np.nanmedian(tracks.positions[..., 1], axis=0).max())
    if not hinge.found or hinge.place[0] <= farthest:
        return
    message = (
        f"has markers that move on circles about y = {hinge.place[0]:.3g} m, farther out than all of them (at most "
        f"{farthest:.3g} m): y points to the body; exchange 'in' and 'out' in --axes"
    )
    raise DatasetError([question("axes", tracks.file, None, message)])


@dataclass(frozen=True)
class _Flap:
    """The flap angle about its mean, ``angle`` [T], and its ``amplitude`` with its standard ``error``, rad.

    ``explained``: of its variance, by the harmonic.
    """

    angle: Array
    amplitude: float
    error: float
    explained: float


def _flap(times: Array, arms: Array, frequency: float) -> _Flap:
    """Fit one harmonic of ``frequency`` (Hz) to the angles of all ``arms`` [T, M] (complex, m), less their means."""
    mean = np.nanmean(arms, axis=0)
    # About the mean direction, so that no angle jumps by a turn; inner markers, which resolve it worse, count less.
    angles = np.angle(arms / np.where(np.abs(mean) > 0, mean, 1.0))
    weight = np.where(np.isfinite(angles), np.abs(np.nan_to_num(mean)), 0.0)
    total = np.maximum(weight.sum(axis=1), 1e-30)
    common = (np.nan_to_num(angles) * weight).sum(axis=1) / total
    seen = weight.sum(axis=1) > 0
    basis = columns(times, frequency, 1)
    found = np.linalg.lstsq(basis[seen], common[seen], rcond=None)[0]
    flap = basis[:, 1:] @ found[1:]
    moved, left = common[seen] - common[seen].mean(), common[seen] - found[0] - flap[seen]
    still = float(np.ptp(common[seen])) < _STILL
    error = float(np.sqrt(2 * correlated_rows(left[:, None]) * left @ left) / len(left)) if not still else 0.0
    explained = 0.0 if still else 1 - float(left @ left / (moved @ moved))
    return _Flap(flap, float(np.hypot(found[1], found[2])), error, explained)
