"""Reads an outline and returns the description of the wing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from wingfit.importers.options import Decimal
from wingfit.importers.planform.description import description
from wingfit.importers.planform.dxf import read_dxf
from wingfit.importers.planform.markers import PlacedMarker, placed_markers
from wingfit.importers.planform.measures import Measures, measures
from wingfit.importers.planform.options import OutlineOptions
from wingfit.importers.planform.outline import outline_of, signed_area
from wingfit.importers.planform.placement import place
from wingfit.importers.planform.shapes import FLATTENING, Drawn, Fact
from wingfit.importers.planform.stations import MIN_CHORD, Sections, sections
from wingfit.importers.planform.svg import read_svg
from wingfit.importers.planform.table import read_table
from wingfit.records.errors import check_most, decode, fail
from wingfit.records.limits import MIB

MAX_FILE_BYTES = 32 * MIB
TITLES = {"svg": "SVG drawing", "dxf": "DXF drawing", "points": "table of points", "stations": "table of stations"}


@dataclass(frozen=True, eq=False)
class WingTemplate:
    """The wing in an outline.

    Attributes:
        file: name of the file, without folders.
        title: what kind of file it is.
        outline: name of the outline in the file.
        facts: what was stated about it, and by whom.
        sections: stations along the span.
        hinge: place (y, z) of the flapping axis, m.
        markers: markers on the wing.
        measures: span, area, aspect ratio and second moment of area.
        outline_area_m2: area of the outline itself, m^2.
        yaml: text of ``dataset.yaml``, with placeholders for what geometry does not show.
        remarks: what was not read or was changed.
    """

    file: str
    title: str
    outline: str
    facts: tuple[Fact, ...]
    sections: Sections
    hinge: tuple[float, float]
    markers: tuple[PlacedMarker, ...]
    measures: Measures
    outline_area_m2: float
    yaml: str
    remarks: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Return everything but the text of the description, for JSON."""
        rows = zip(self.sections.y, self.sections.leading, self.sections.chord, strict=True)
        return {
            "file": self.file,
            "title": self.title,
            "outline": self.outline,
            "facts": [asdict(fact) for fact in self.facts],
            "measures": asdict(self.measures),
            "outline_area_m2": self.outline_area_m2,
            "hinge_m": list(self.hinge),
            "stations": [{"y_m": y, "leading_edge_m": x, "chord_m": c} for y, x, c in np.array([*rows]).tolist()],
            "markers": [asdict(marker) for marker in self.markers],
            "remarks": list(self.remarks),
        }


def wing_template(
    path: str | PathLike[str],
    *,
    root: str | None = None,
    leading_edge: str | None = None,
    unit: str | None = None,
    mm_per_unit: float | None = None,
    span_mm: float | None = None,
    hinge_mm: float | None = None,
    hinge_z_mm: float | None = None,
    origin: tuple[float, float] | None = None,
    outline: str | None = None,
    close: bool = False,
    fill_gaps: bool = False,
    accuracy: float = 0.001,
    structure: str | None = None,
    mass_g: float | None = None,
    thickness_mm: tuple[float, float] | None = None,
    marker_grid: tuple[int, int] | None = None,
    marker_file: str | None = None,
    marker_z_mm: float | None = None,
    marker_mass_g: float | None = None,
    name: str | None = None,
    decimal: Decimal = "point",
) -> WingTemplate:
    """Describe the wing whose planform is outlined in an SVG, a DXF, or a table of points or stations.

    Args:
        path: the file.
        root: side of the drawing on which the root is: left, right, top, bottom; in a table low-x, high-x, low-y,
            high-y.
        leading_edge: side on which the leading edge is, in the same words.
        unit: of the coordinates: m, cm, mm, um, in or ft; page, if the size on the page of an SVG is the real one.
        mm_per_unit: millimetres per unit of the coordinates, instead of ``unit``.
        span_mm: distance from root end to tip, instead of ``unit``.
        hinge_mm: distance from the flapping axis out to the root end of the outline.
        hinge_z_mm: height of the flapping axis above the plane of the wing; by convention it lies in the plane.
        origin: point (x, y) of the file where x and y of the wing are zero; by convention the leading edge at the root.
        outline: name of the outline, where the file has several.
        close: the straight line from the last point to the first belongs to the outline.
        fill_gaps: gaps and overhangs count as wing.
        accuracy: largest error of the area of the stations, as a fraction of it.
        structure: "sheet" or "rigid" for a wing without rods, such as that of an animal.
        mass_g: of the wing without markers, spread evenly over its area; for a wing without rods.
        thickness_mm: of the wing at its root and its tip.
        marker_grid: numbers of markers along span and chord.
        marker_file: table of markers: name,x,y in the coordinates of the outline; optional z_mm, mass_g.
        marker_z_mm: height of each marker above the plane of the wing.
        marker_mass_g: mass of each marker.
        name: of the wing; by default that of the file.
        decimal: "comma" if a table has decimal commas.

    Returns:
        Stations, measures, and the text of a ``dataset.yaml`` with placeholders.

    Raises:
        DatasetError: lists what is wrong with the outline, and which options are missing or contradict it.

    """
    given = {key: value for key, value in locals().items() if key != "path"}
    options, file = OutlineOptions(**given), Path(path).name
    options.check()
    drawn = _read(Path(path), options)
    points, outline_name, remarks = outline_of(drawn, options, file)
    placement, facts = place(points, drawn, options, file)
    placed = placement.apply(points)
    area = abs(signed_area(placed))
    found = sections(placed, area, options.accuracy, file, fill=options.fill_gaps)
    hinge = (round(float(found.y[0]) - (options.hinge_mm or 0.0) * 1e-3, 12), (options.hinge_z_mm or 0.0) * 1e-3)
    sizes = measures(found, hinge[0])
    markers = placed_markers(options, placement, found)
    title = " ".join((name or Path(path).stem).split())[:200] or "wing"
    return WingTemplate(
        file=file,
        title=TITLES[drawn.format],
        outline=outline_name,
        facts=(*facts, *_facts(options, found, drawn)),
        sections=found,
        hinge=hinge,
        markers=tuple(markers),
        measures=sizes,
        outline_area_m2=area,
        yaml=description(file, title, found, hinge, sizes.area_m2, markers, options),
        remarks=(*drawn.remarks, *remarks, *_remarks(found, sizes, area, options)),
    )


def _read(path: Path, options: OutlineOptions) -> Drawn:
    try:
        if path.is_dir():
            raise fail(path.name, str(path), "is a folder; name the file of the outline")
        check_most(path.name, "has", path.stat().st_size / MIB, MAX_FILE_BYTES / MIB, "MiB", "remove pictures from it")
        raw = path.read_bytes()
    except OSError as error:
        raise fail(path.name, str(path), f"cannot be read: {error.strerror or error}; check the path") from None
    start = raw[:4096].lstrip(b"\xef\xbb\xbf \t\r\n")
    if not raw.strip():
        raise fail(path.name, 0, "the file is empty; export the outline again")
    if start.startswith(b"<"):
        return read_svg(decode(raw, path.name), path.name)
    if start.startswith((b"AutoCAD Binary DXF", b"0\r\nSECTION", b"0\nSECTION", b"999")):
        return read_dxf(raw, path.name)
    return read_table(raw, path.name, options.decimal)


def _facts(options: OutlineOptions, found: Sections, drawn: Drawn) -> list[Fact]:
    facts = [Fact("flapping axis", f"{options.hinge_mm:g} mm inboard of the root end", "user", "--hinge-mm")]
    if options.hinge_z_mm is None:
        facts.append(Fact("its height", "in the plane of the wing, z = 0", "convention", "--hinge-z-mm"))
    else:
        facts.append(Fact("its height", f"{options.hinge_z_mm:g} mm", "user", "--hinge-z-mm"))
    by = "convention" if options.accuracy == OutlineOptions.accuracy else "user"
    facts.append(Fact("accuracy", f"edges within {found.tolerance * 1e3:.2g} mm", by, "--accuracy"))  # type: ignore[arg-type]
    if drawn.format in ("svg", "dxf"):
        facts.append(Fact("curves", f"flattened within {FLATTENING:g} of their extent", "convention", ""))
    return facts


def _remarks(found: Sections, sizes: Measures, area: float, options: OutlineOptions) -> Sequence[str]:
    remarks = []
    if found.filled > 1e-9 * area:
        remarks.append(f"gaps and overhangs of {100 * found.filled / area:.2g} % of the area count as wing")
    if found.widened:
        remarks.append(f"chords below {MIN_CHORD * 1e3:g} mm, the least of a dataset, are widened to it")
    if (error := abs(sizes.area_m2 / (area + found.filled) - 1)) > options.accuracy:
        remarks.append(f"the area of the stations differs by {100 * error:.2g} % from that of the outline")
    return remarks
