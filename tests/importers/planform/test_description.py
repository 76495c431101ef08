"""The description that is written, its placeholders, markers, and the drawing."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import typer

from tests.command_line import Wingfit, in_process
from tests.importers.planform.outlines import described, polygon, refused, svg
from tests.records.samples import falcon_wing
from tests.records.vehicles import delfly
from wingfit.cli.importing.template import wing_drawing as drawing_command
from wingfit.cli.importing.template import wing_template as template_command
from wingfit.records import DatasetError, load_dataset, wing_or_vehicle
from wingfit.records.description.wing_plan import read_plan
from wingfit.report.wing_drawing import wing_drawing

SWEPT = svg(polygon((0, 0), (200, 30), (200, 60), (0, 80)))
FILLED = {
    "foam_density_kg_m3": "30",
    "skin_areal_density_kg_m2": "0.1",
    "rods": "\n    - {name: front, x_root_m: 0.01, y_root_m: 0, x_tip_m: 0.03, y_tip_m: 0.19, diameter_m: 0.002, "
    "density_kg_m3: 1600, glue_linear_density_kg_m: 0.003}\n    - {name: rear, x_root_m: 0.05, y_root_m: 0, "
    "x_tip_m: 0.04, y_tip_m: 0.19, diameter_m: 0.002, density_kg_m3: 1600, glue_linear_density_kg_m: 0.003}",
    "driven_rods": "[front, rear]",
    "reference_markers": "[s1c1, s1c2]",
    "drive": "{kind: fourier, mean_deg: 5, cosine_deg: [0], sine_deg: [30]}",
    "rig": "vacuum_chamber",
    "flap_frequency_hz": "3",
    "phase_lag_deg": "0",
    "pressure_mbar": "10",
    "temperature_c": "20",
}


def folder_of(place: Path, text: str) -> Path:
    (place / "wing" / "recordings").mkdir(parents=True, exist_ok=True)
    (place / "wing" / "dataset.yaml").write_text(text)
    return place / "wing"


def test_placeholders_are_refused_and_a_filled_description_loads(tmp_path: Path) -> None:
    options: dict[str, Any] = {
        "thickness_mm": (8.0, 4.0),
        "marker_grid": (3, 2),
        "marker_z_mm": 3.0,
        "marker_mass_g": 0.05,
    }
    found = described(tmp_path, SWEPT, name='my "wing"', **options)
    with pytest.raises(DatasetError) as caught:
        load_dataset(folder_of(tmp_path, found.yaml))
    assert caught.value.count == found.yaml.count('"FILL IN: ') == len(FILLED)
    assert all("is not filled in yet; replace the placeholder by the" in fault.message for fault in caught.value.errors)
    text = found.yaml
    for key, value in FILLED.items():
        text = re.sub(rf'(?<!_){key}: "FILL IN: [^"]*"', lambda _, k=key, v=value: f"{k}: {v}", text)  # type: ignore[misc]
    names = [marker.name for marker in found.markers]
    folder = folder_of(tmp_path, text)
    header = ",".join(["time_s", *(f"{name}_{axis}_m" for name in names for axis in "xyz")])
    places = ",".join(f"{marker.x},{marker.y},{marker.z}" for marker in found.markers)
    rows = [f"{k / 60:.4f},{places}" for k in range(20)]
    (folder / "recordings" / "first.csv").write_text("\n".join([header, *rows]) + "\n")
    wing = wing_or_vehicle(load_dataset(folder)).wing
    assert wing.name == 'my "wing"'
    assert [(s.y, s.leading_edge, s.chord) for s in wing.stations] == [(0, 0, 0.08), (0.2, 0.03, 0.03)]
    assert [s.thickness for s in wing.stations] == [0.008, 0.004]
    assert wing.hinge.y == 0
    marker = wing.marker("s2c1")
    assert np.allclose(marker.position, [0.015 + 0.25 * 0.055, 0.1, 0.003])
    assert math.isclose(marker.mass, 5e-5)


def test_markers_are_listed_in_the_coordinates_of_the_outline(tmp_path: Path) -> None:
    (tmp_path / "m.csv").write_text("name,x,y,z_mm,mass_g\nroot,20,40,2.5,0.1\ntip,190,45,1,0.2\n")
    options = {"marker_file": str(tmp_path / "m.csv")}
    root, tip = described(tmp_path, SWEPT, **options).markers
    assert (root.name, root.x, root.y, root.z, root.mass) == ("root", 0.04, 0.02, 0.0025, 0.0001)
    assert (tip.x, tip.y) == (0.045, 0.19)
    moved, _ = described(tmp_path, SWEPT, origin=(10.0, 20.0), **options).markers
    assert np.allclose([moved.x, moved.y], [0.02, 0.01])
    for text, words in (
        ("name,x\nroot,20\n", "needs the columns name,x,y"),
        ("name,x,y,mass\nroot,20,40,1\n", "has the column 'mass'"),
        ("name,x,y\nroot,20,\n,20,30\n", "line 2, column 'y': is empty"),
        ("name,x,y\n", "lists no markers"),
    ):
        (tmp_path / "m.csv").write_text(text)
        assert words in refused(tmp_path, SWEPT, **options)


def texts(drawing: str, class_: str) -> list[ElementTree.Element]:
    return [one for one in ElementTree.fromstring(drawing).iter() if one.get("class") == class_]  # noqa: S314


def test_the_drawing_is_to_scale(tmp_path: Path) -> None:
    drawing = wing_drawing(read_plan(described(tmp_path, SWEPT, hinge_mm=20.0, marker_grid=(2, 2)).yaml.encode(), "w"))
    (outline,) = texts(drawing, "outline")
    points = np.array(re.findall(r"[-0-9.]+", outline.get("d", "")), dtype=np.float64).reshape(-1, 2)
    (hinge,) = [one for one in texts(drawing, "hinge") if one.tag.endswith("path")]
    across = float(re.findall(r"[-0-9.]+", hinge.get("d", ""))[0])
    scale = np.ptp(points[:, 0]) / 200
    assert math.isclose(np.ptp(points[:, 1]) / scale, 80, abs_tol=0.05)
    assert math.isclose((points[0, 0] - across) / scale, 20, abs_tol=0.05)
    (bar,) = [one for one in texts(drawing, "scale") if one.tag.endswith("path")]
    (label,) = [one for one in texts(drawing, "scale") if one.tag.endswith("text")]
    ends = np.array(re.findall(r"[-0-9.]+", bar.get("d", "")), dtype=np.float64)[[0, 4]]
    assert math.isclose(np.ptp(ends) / scale, float((label.text or "").split()[0]), abs_tol=0.05)
    assert len([one for one in texts(drawing, "marker") if one.tag.endswith("circle")]) == 4


def test_wings_and_vehicles_are_drawn() -> None:
    wing = falcon_wing()
    drawing = wing_drawing(wing)
    assert len([one for one in texts(drawing, "rod") if one.tag.endswith("path")]) == len(wing.rods)
    circles = [one for one in texts(drawing, "marker") if one.tag.endswith("circle")]
    assert len(circles) == len(wing.markers)
    assert sum(one.get("fill") != "#ffffff" for one in circles) == len(wing.reference_markers)
    assert texts(wing_drawing(delfly()), "outline")


@pytest.fixture
def wingfit() -> Wingfit:
    app = typer.Typer()
    app.command("template")(template_command)
    app.command("drawing")(drawing_command)

    return in_process(app)


def test_the_commands(wingfit: Wingfit, tmp_path: Path) -> None:
    source, target, picture = (tmp_path / name for name in ("w.svg", "wing.yaml", "wing.svg"))
    source.write_text(SWEPT)
    stated = ("--root", "left", "--leading-edge", "top", "--span-mm", "200", "--hinge-mm", "15")
    code, out, err = wingfit("template", source, *stated)
    assert code == 0, err
    assert re.search(r"area +110 +cm\^2", out)
    assert "user: --hinge-mm" in out
    assert "nothing was written" in err
    code, out, err = wingfit("template", source, *stated, "-o", target, "--drawing", picture, "--json")
    assert code == 0, err
    assert math.isclose(json.loads(out)["measures"]["area_m2"], 0.011)
    assert wingfit("template", source, *stated, "-o", target)[0] == 2
    again = tmp_path / "again.svg"
    assert wingfit("drawing", target, "-o", again)[0] == 0
    assert again.read_text() == picture.read_text()
    code, _, message = wingfit("template", source)
    assert code == 1
    assert "4 errors" in message
    assert wingfit("template", source, *stated, "--thickness-mm", "a")[0] == 2
    assert wingfit("template", source, *stated, "--marker-grid", "4")[0] == 2


def test_a_file_without_a_wing_is_not_drawn() -> None:
    for text, words in (
        ("name: a\n", "describes no wing"),
        ("wing: {stations: 3}\n", "wing.stations"),
        ("wing:\n  stations:\n    - {y_m: 0, chord_m: 0.1}\n    - {y_m: 1, chord_m: 0.1}\n", "leading_edge_m"),
    ):
        with pytest.raises(DatasetError, match=words):
            read_plan(text.encode(), "dataset.yaml")


def test_an_animal_s_wing_needs_no_rods(tmp_path: Path) -> None:
    found = described(tmp_path, SWEPT, structure="rigid", mass_g=11.0, thickness_mm=(8.0, 4.0))
    assert "rods" not in found.yaml
    assert "structure: rigid" in found.yaml
    density = float(re.findall(r"skin_areal_density_kg_m2: (\S+)", found.yaml)[0])
    assert math.isclose(density, 0.011 / 0.011, rel_tol=1e-5)  # 11 g on 0.011 m^2
    assert "give --structure" in refused(tmp_path, SWEPT, mass_g=11.0)
    assert "must be sheet or rigid" in refused(tmp_path, SWEPT, structure="soft")


def test_a_thickness_that_is_impossible_is_refused_once(tmp_path: Path) -> None:
    assert refused(tmp_path, SWEPT, thickness_mm=(1000.0, 1000.0)).count("--thickness-mm") == 1
    assert refused(tmp_path, SWEPT, thickness_mm=(1000.0, 2000.0)).count("--thickness-mm") == 2
