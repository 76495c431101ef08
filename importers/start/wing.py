"""A first description of a wing from its tracks alone: rest positions, hinge and drive; the planform is assumed."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from wingfit.importers.options import question
from wingfit.importers.tracks import ImportedTracks
from wingfit.records.array_types import Array, Float
from wingfit.records.errors import DatasetError

_STEADY = 0.03  # radius of a marker about the hinge: standard deviation over mean, at most, for a hinge that is found
_OTHER_SIDE = 0.25  # of the outermost distance: markers so far on the other side belong to another wing
_MARGIN = 0.08  # of the span, by which the assumed planform is larger than the area of the markers
_LEAST_CHORD = 0.15  # of the span
_THICKNESS = (0.04, 0.008)  # at root and tip, of the span
_THINNEST = 1e-5  # m
_AREAL_DENSITY = 1.0  # kg/m^2


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

    The flap angle is a cosine of ``frequency`` (Hz) about the mean pose, in which the markers rest. The hinge is the
    common centre of the markers' circles in the y-z plane (least squares after Kasa 1976), if they are circles; else it
    is assumed. The planform is assumed as the rectangle around the markers at rest.
    """
    places = tracks.positions
    hinge, source = _hinge(places)
    arms = places[..., 1] - hinge[0] + 1j * (places[..., 2] - hinge[1])
    flap = _flap(tracks.times, arms, frequency)
    level = np.nanmean(arms * np.exp(-1j * flap.angle)[:, None], axis=0)
    rest = np.column_stack([np.nanmean(places[..., 0], axis=0), level.real + hinge[0], level.imag + hinge[1]])
    amplitude = float(np.degrees(flap.amplitude))
    root, tip = min(float(hinge[0]), float(rest[:, 1].min())), float(rest[:, 1].max())
    margin = _MARGIN * (tip - root)
    tip += margin
    front, back = float(rest[:, 0].min()) - margin, float(rest[:, 0].max()) + margin
    chord = max(back - front, _LEAST_CHORD * (tip - root))
    front = 0.5 * (front + back - chord)
    nearest = tracks.markers[int(np.argmin(np.abs(level)))]
    lines = [
        "wing:",
        f"  name: {json.dumps(name, ensure_ascii=False)}",
        "  structure: rigid                # or sheet, to estimate a stiffness (docs/formats.md)",
        "  stations:                       # ASSUMED: the rectangle around the markers; replace it by your planform",
        *(
            f"    - {{y_m: {y:.6f}, leading_edge_m: {front:.6f}, chord_m: {chord:.6f}, "
            f"thickness_m: {max(part * (tip - root), _THINNEST):.6f}}}"
            for y, part in zip((root, tip), _THICKNESS, strict=True)
        ),
        f"  materials: {{foam_density_kg_m3: 0, skin_areal_density_kg_m2: {_AREAL_DENSITY:g}}}   # ASSUMED",
        "  markers:                        # mean positions in the tracks, turned back by the flap angle",
        *(
            f"    - {{name: {json.dumps(marker)}, x_m: {x:.6f}, y_m: {y:.6f}, z_m: {z:.6f}, mass_kg: 0}}"
            for marker, (x, y, z) in zip(tracks.markers, rest.tolist(), strict=True)
        ),
        f"  reference_markers: [{json.dumps(nearest)}]",
        f"  hinge: {{y_m: {hinge[0]:.6f}, z_m: {hinge[1]:.6f}}}   # {source}",
        f"  drive: {{kind: fourier, mean_deg: 0, cosine_deg: [0], sine_deg: [{amplitude:.2f}]}}",
        "",
    ]
    where = f"y {1e3 * hinge[0]:.0f} mm, z {1e3 * hinge[1]:.0f} mm"
    size = f"{1e3 * (tip - root):.0f} mm x {1e3 * chord:.0f} mm, flat"
    facts = (
        Fact("rest positions", f"{len(rest)} markers, in their mean pose", "tracks"),
        Fact("flap angle", f"{amplitude:.1f} deg to both sides of the mean", "tracks"),
        Fact("hinge", where, source),
        Fact("planform", size, "assumed: a rectangle around the markers"),
        Fact("mass", f"{_AREAL_DENSITY:g} kg/m^2", "assumed"),
    )
    return FirstWing("\n".join(lines), facts)


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


def _hinge(places: Float[Array, "T M 3"]) -> tuple[Array, str]:
    """Return y and z (m) of the hinge, and where they are from."""
    count = places.shape[1]
    rows, right = [], []
    for m in range(count):
        seen = places[:, m, 1:][np.isfinite(places[:, m]).all(axis=1)]
        one = np.zeros((len(seen), count))
        one[:, m] = 1.0
        rows.append(np.column_stack([2 * seen, one]))
        right.append((seen**2).sum(axis=1))
    centre = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0][:2]
    radius = np.hypot(places[..., 1] - centre[0], places[..., 2] - centre[1])
    middle = np.nanmedian(places[..., 1], axis=0)
    inside = float(middle.min())
    if centre[0] < inside and (np.nanstd(radius, axis=0) < _STEADY * np.nanmean(radius, axis=0)).all():
        return np.round(centre, 6) + 0.0, "from the tracks: the markers move on circles about it"
    if inside > 0:
        return np.zeros(2), "assumed: the origin of the axes"
    span = float(middle.max()) - inside
    height = float(np.nanmedian(places[:, int(np.argmin(middle)), 2]))
    return np.array([inside - 0.1 * span, height]), "assumed: beside the innermost marker"


@dataclass(frozen=True)
class _Flap:
    """The flap angle about its mean, ``angle`` [T], and its ``amplitude``, rad."""

    angle: Array
    amplitude: float


def _flap(times: Array, arms: Array, frequency: float) -> _Flap:
    """Fit one harmonic of ``frequency`` (Hz) to the angles of all ``arms`` [T, M] (complex, m), less their means."""
    mean = np.nanmean(arms, axis=0)
    # About the mean direction, so that no angle jumps by a turn; inner markers, which resolve it worse, count less.
    angles = np.angle(arms / np.where(np.abs(mean) > 0, mean, 1.0))
    weight = np.where(np.isfinite(angles), np.abs(np.nan_to_num(mean)), 0.0)
    total = np.maximum(weight.sum(axis=1), 1e-30)
    common = (np.nan_to_num(angles) * weight).sum(axis=1) / total
    seen = weight.sum(axis=1) > 0
    turn = 2 * np.pi * frequency * times
    basis = np.column_stack([np.ones_like(turn), np.cos(turn), np.sin(turn)])
    found = np.linalg.lstsq(basis[seen], common[seen], rcond=None)[0]
    return _Flap(basis[:, 1:] @ found[1:], float(np.hypot(found[1], found[2])))
