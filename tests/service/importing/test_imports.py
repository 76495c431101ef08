"""Files of tracking systems through the API: what is understood, asked for, and refused; as on the command line."""

from __future__ import annotations

import io
import json
import re
import socket
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from tests.importers.start.test_start import FREQUENCY, wing_table
from tests.oracles.track_files import Case, Truth, binary_writers, cases, flapping, refusals, text_writers
from tests.service.conftest import Api, As, toy_service
from tests.service.shapes import valid
from wingfit.client.answers import Problem
from wingfit.client.client import Client, WingfitError
from wingfit.client.importing.answers import FirstDescription, TrackImport
from wingfit.importers import Given, import_bytes, inspect_bytes
from wingfit.importers.inspection import PREVIEW_FRAMES, PREVIEW_POSITIONS
from wingfit.importers.readers import READERS
from wingfit.importers.summary import as_json
from wingfit.records import DatasetError
from wingfit.service.http import concurrency_limit, header_limits, request_limits
from wingfit.service.settings import Settings

CASES = {case.format: case for case in cases(0)}
SLOW = "sleap"  # each file is read by a process of its own, whose start takes a second
REFUSALS = [case for case in refusals(0) if case.format != SLOW]
SEVERAL = "run,side,clock,u,v,w\n" + "".join(
    f"{run},{side},{t},{t},2,3\n" for run in ("a", "b") for side in ("left", "right") for t in range(10)
)
AXES = "x aft, y out, z up"
SEVERAL_OPTIONS = {"columns": "time=clock; tip=u,v,w", "unit": "mm", "time_unit": "ms"}


@pytest.fixture(scope="module")
def api(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Api]:
    with toy_service(tmp_path_factory.mktemp("imports") / "data") as (_, api):
        yield api


def post(api: Api, raw: bytes | str, path: str = "/v1/imports", name: str = "trial.dat", **options: Any) -> Any:
    content = raw.encode() if isinstance(raw, str) else raw
    return api.client.post(path, files={"file": (name, content)}, data=options)


def understood(api: Api, raw: bytes | str, **options: Any) -> Any:
    answer = post(api, raw, **options)
    assert answer.status_code == 200, answer.text
    return valid(TrackImport, answer.json())


def problem(answer: Any) -> Any:
    assert answer.status_code == 422, answer.text
    assert answer.headers["Content-Type"] == "application/problem+json"
    return valid(Problem, answer.json())


@pytest.mark.parametrize("case", CASES.values(), ids=[*CASES])
def test_every_format_is_understood_as_on_the_command_line(api: Api, case: Case) -> None:
    found = understood(api, case.raw, **case.options)
    local = import_bytes(case.raw, "trial.dat", Given(**case.options))
    expected = json.loads(json.dumps(as_json(local)))
    assert (found.file, found.format, found.questions) == (expected.pop("file"), expected.pop("format"), [])
    preview = found.tracks.pop("preview")
    assert found.tracks == expected
    assert found.contents.frames == case.truth.frames
    assert preview.time_s == local.times.tolist()
    shown = np.array(preview.positions_mm, dtype=np.float64)
    assert np.allclose(shown, 1e3 * local.positions, atol=6e-4, rtol=0, equal_nan=True)
    if case.format == SLOW:
        return
    table = post(api, case.raw, "/v1/imports/table", **case.options)
    assert table.headers["Content-Type"].startswith("text/csv")
    assert table.headers["Content-Disposition"] == 'attachment; filename="trial.csv"'
    assert table.text == local.csv()


def test_every_format_is_tested() -> None:
    assert set(CASES) == set(READERS)


def test_what_the_file_does_not_state_is_asked_for(api: Api) -> None:
    found = understood(api, text_writers.dltdv(flapping()))
    assert (found.format, found.title, found.tracks) == ("dltdv", "DLTdv CSV", None)
    assert [(one.option, one.choices, one.hint) for one in found.questions] == [
        ("unit", ["m", "cm", "mm", "um", "in", "ft"], "positions are in the unit of the calibration"),
        ("rate_hz", [], "each row is a frame of the video"),
    ]
    assert (found.contents.labels, found.contents.frames) == (["pt1", "pt2", "pt3", "pt4"], 60)
    assert found.contents.high[1] == pytest.approx(0.29, rel=0.01), "the file is in metres, which its ranges show"


@pytest.mark.parametrize(
    ("raw", "given", "option", "choices"),
    [
        (text_writers.dltdv_sparse(flapping()), {}, "format", ["dltdv-sparse"]),
        (text_writers.plain(flapping(), names="c{marker}{axis}q"), {}, "columns", ["time_s", "crootxq"]),
        (text_writers.plain(flapping(), names="{marker}_{axis}_m", time="time"), {}, "time_unit", ["s", "ms"]),
        (text_writers.plain(flapping(), separator=";", decimal=","), {}, "decimal", ["comma"]),
        (text_writers.trc(flapping()).replace("240.0", "100.0"), {}, "rate_hz", ["100", "240"]),
        ("\n".join(text_writers.trc(flapping()).split("\n")[:-20]), {}, "incomplete", []),
        (text_writers.trc(flapping()).replace("root", "*1").replace("mid_1", "*2").replace("tip-2", "*3").replace(
            "trailing.edge", "*4"), {}, "keep_unlabelled", []),
        (SEVERAL, SEVERAL_OPTIONS, "rows", ["run=a,side=left", "run=a,side=right"]),
    ],
)  # fmt: skip
def test_every_option_can_be_asked_for(
    api: Api, raw: str, given: dict[str, str], option: str, choices: list[str]
) -> None:
    found = understood(api, raw, **given)
    one = next(one for one in found.questions if one.option == option)
    assert one.choices[: len(choices)] == choices
    assert one.message
    refused = problem(post(api, raw, "/v1/imports/table", **given))
    assert [one.option for one in refused.questions] == [one.option for one in found.questions]


def test_the_rows_that_are_offered_are_one_recording_each(api: Api) -> None:
    offered = understood(api, SEVERAL, **SEVERAL_OPTIONS).questions[0].choices
    assert len(offered) == 4
    for rows in offered:
        assert understood(api, SEVERAL, rows=rows, **SEVERAL_OPTIONS).tracks.frames == 10


@pytest.mark.parametrize("case", REFUSALS, ids=lambda case: f"{case.format}-{'-'.join(case.words)}")
def test_faults_are_those_of_the_command_line(api: Api, case: Any) -> None:
    with pytest.raises(DatasetError) as caught:
        import_bytes(case.raw, "trial.dat", Given(**case.options))
    expected = [vars(fault) for fault in caught.value.errors]
    refused = problem(post(api, case.raw, "/v1/imports/table", **case.options))
    assert refused.detail == "no tracks were imported"
    assert [(one.where, one.message) for one in refused.errors] == [(one["where"], one["message"]) for one in expected]
    answer = post(api, case.raw, **case.options)
    settled = inspect_bytes(case.raw, "trial.dat", Given(**case.options)).settled_by_options
    assert answer.status_code == (200 if settled else 422)


@pytest.mark.parametrize(
    ("raw", "words"),
    [
        (b"", "the file is empty"),
        (b"PK\x03\x04rest", "unpack it"),
        (b"\0\1\2", "is binary"),
        ("a,b\n\xe9".encode("latin-1"), "UTF-8"),
        (b"x" * 2_000_000, "is a row of a table"),
    ],
)
def test_other_files_are_a_422(api: Api, raw: bytes, words: str) -> None:
    refused = problem(post(api, raw))
    assert words in " ".join(one.message for one in refused.errors)
    assert all(one.where for one in refused.errors)


@pytest.mark.parametrize(
    ("options", "where"),
    [
        ({"unit": "furlong"}, "body.unit"),
        ({"rate_hz": "nan"}, "body.rate_hz"),
        ({"rate_hz": "0"}, "body.rate_hz"),
        ({"rate": "100"}, "body.rate"),
        ({"decimal": "dot"}, "body.decimal"),
        ({"keep_zeros": "perhaps"}, "body.keep_zeros"),
        ({"axes": "x" * 201}, "body.axes"),
        ({"axes": "x up"}, "--axes"),
        ({"format": "mkv"}, "--format"),
        ({"rows": "1"}, "--rows"),
    ],
)
def test_options_are_checked(api: Api, options: dict[str, str], where: str) -> None:
    refused = problem(post(api, text_writers.plain(flapping()), **options))
    assert [one.where for one in refused.errors] == [where]


def test_a_file_is_needed(api: Api) -> None:
    assert problem(api.client.post("/v1/imports", data={"unit": "m"})).errors[0].where == "body.file"


def test_the_preview_is_bounded(api: Api) -> None:
    many = text_writers.plain(flapping(frames=2000))
    preview = understood(api, many).tracks.preview
    assert (preview.stride, len(preview.time_s), preview.time_s[1]) == (7, 286, pytest.approx(7 / 240))
    assert len(preview.positions_mm) == len(preview.time_s) <= PREVIEW_FRAMES
    header = "time_s," + ",".join(f"m{m}_{axis}_m" for m in range(1000) for axis in "xyz")
    wide = "\n".join([header, *(f"{t}" + ",1" * 3000 for t in range(50))])
    preview = understood(api, wide).tracks.preview
    assert len(preview.positions_mm) * 1000 <= PREVIEW_POSITIONS
    assert len(preview.positions_mm[0]) == 1000


def test_a_file_that_is_too_large_is_a_413(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(request_limits, "UPLOAD_LIMIT", 1000)
    answer = post(api, b"x" * 70_000)
    assert (answer.status_code, answer.json()["type"]) == (413, "urn:wingfit:problem:too-large")


def test_nothing_is_stored(api: Api) -> None:
    understood(api, text_writers.trc(flapping()))
    assert api.get("/v1/datasets")["items"] == []


def test_the_client_imports(api: Api, tmp_path: Path) -> None:
    file = tmp_path / "dive_xyzpts.csv"
    file.write_text(text_writers.dltdv(flapping()))
    with Client(str(api.client.base_url)) as client:
        asked = client.import_tracks(file)
        assert [one["option"] for one in asked["questions"]] == ["unit", "rate_hz"]
        found = client.import_tracks(file, unit="m", rate_hz=240, axes="x aft, y out, z up", keep_zeros=True)
        assert found["tracks"] is not None
        assert found["tracks"]["frame"] == "wing"
        table = client.import_table(file, unit="m", rate_hz=240)
        assert table == import_bytes(file.read_bytes(), file.name, Given("m", 240)).csv()
        with pytest.raises(WingfitError, match=r"(?s)states no unit.*states neither a rate"):
            client.import_table(file)
        with pytest.raises(WingfitError, match="is no file"):
            client.import_tracks(tmp_path)


def test_a_file_with_many_frames_is_sent_in_parts(api: Api) -> None:
    text = text_writers.plain(flapping(frames=2500))
    table = post(api, text, "/v1/imports/table").text
    assert table == import_bytes(text.encode(), "trial.dat", Given()).csv()
    assert table.count("time_s") == 1
    assert np.loadtxt(io.StringIO(table), delimiter=",", skiprows=1, usecols=0).shape == (2500,)


def test_clients_that_do_not_read_keep_nobody_from_importing(api: Api, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(header_limits, "SLOW_SECONDS", 600.0)  # after which they are disconnected
    one = flapping(frames=3000, gaps=False)
    wide = Truth(tuple(f"m{k}" for k in range(120)), one.rate, np.tile(one.mm, (1, 30, 1)))
    large = {"file": ("large.c3d", binary_writers.by_hand(wide))}
    small = httpx.HTTPTransport(socket_options=[(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)])
    with ExitStack() as waiting, httpx.Client(base_url=api.client.base_url, transport=small, timeout=60.0) as slow:
        for _ in range(concurrency_limit.UPLOADS):
            answer = waiting.enter_context(slow.stream("POST", "/v1/imports/table", files=large))
            assert answer.status_code == 200
        file = {"file": ("trial.trc", text_writers.trc(flapping()))}
        assert api.client.post("/v1/imports", files=file, timeout=60.0).status_code == 200


class TestKeys:
    """Where keys are required, an import needs the scope of an upload."""

    @pytest.fixture
    def settings(self, tmp_path: Path) -> Settings:
        return Settings(data=tmp_path / "data", require_keys=True)

    def test_a_key_that_may_write_is_needed(self, as_: As) -> None:
        raw = text_writers.trc(flapping())
        assert post(as_("ann"), raw).status_code == 200
        assert post(as_("ann-reads"), raw).status_code == 403
        assert post(as_("ann-reads"), raw, "/v1/imports/table").status_code == 403


def test_a_wing_is_described_by_its_tracks(api: Api) -> None:
    path = "/v1/imports/description"
    found = valid(FirstDescription, post(api, wing_table(), path, "hawk 1.csv", axes="x aft, y out, z up").json())
    assert found.kind == "wing"
    assert found.flap_frequency_hz == pytest.approx(FREQUENCY, rel=0.01)
    assert found.conditions["pressure_mbar"] == 1013.25
    assert found.yaml.startswith('wing:\n  name: "hawk_1"\n  structure: rigid')
    assert {"planform", "mass"} <= {one.what for one in found.facts if one.source.startswith("assumed")}
    stated = post(api, wing_table(), path, axes="x aft, y out, z up", flap_frequency_hz=3).json()
    assert stated["flap_frequency_hz"] == 3
    series = valid(FirstDescription, post(api, wing_table(), path).json())
    assert (series.kind, series.flap_frequency_hz, series.conditions) == ("series", None, {})
    assert "channels:" in series.yaml
    two = problem(post(api, wing_table(both=True), path, axes="x aft, y out, z up"))
    assert "--markers in,mid,tip" in two.errors[0].message
    assert problem(post(api, "tip_x,tip_y,tip_z\n" + "1,2,3\n" * 9, path)).questions[0].option == "unit"
    assert "unknown field" in problem(post(api, wing_table(), flap_frequency_hz=3)).errors[0].message


def form(*fields: tuple[str, str | bytes, str | None]) -> dict[str, Any]:
    """A form of (name, value, name of the file), in this order."""
    parts = [
        f'--x\r\nContent-Disposition: form-data; name="{name}"{f"; filename={file!r}" if file else ""}\r\n\r\n'.encode()
        + (value.encode() if isinstance(value, str) else value)
        + b"\r\n"
        for name, value, file in fields
    ]
    return {"content": b"".join(parts) + b"--x--\r\n", "headers": {"Content-Type": "multipart/form-data; boundary=x"}}


FILE = ("file", text_writers.trc(flapping()), "trial.trc")
PATHS = ("/v1/imports", "/v1/imports/table", "/v1/imports/description")


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    ("fields", "where", "words"),
    [
        ([FILE, FILE], "body.file", "more than once"),
        ([FILE, ("axes", AXES, None), ("axes", "x aft, y in, z up", None)], "body.axes", "more than once"),
        ([FILE, ("markers", "", None)], "body.markers", "is empty"),
        ([FILE, ("axes", "", None)], "body.axes", "is empty"),
        ([FILE, ("axes[]", AXES, None)], "body.axes[]", "unknown field"),
        ([("unit", "m", None)], "body.file", "send it as the field 'file' of multipart/form-data"),
        ([("file", "time_s,a_x_m", None)], "body.file", "send it as the field 'file' of multipart/form-data"),
    ],
)
def test_forms_of_which_a_part_would_be_ignored_are_refused(
    api: Api, path: str, fields: Any, where: str, words: str
) -> None:
    refused = problem(api.client.post(path, **form(*fields)))
    assert [one.where for one in refused.errors] == [where]
    assert words in refused.errors[0].message


def test_a_body_that_is_no_form_is_refused_with_the_form_to_send(api: Api) -> None:
    for path in PATHS:
        refused = problem(api.client.post(path, json={"file": "a.csv"}))
        assert "content type: application/json" in refused.errors[0].message


def test_the_flap_frequency_is_a_field_of_the_description_alone(api: Api) -> None:
    for path in PATHS[:2]:
        assert "unknown field" in problem(post(api, wing_table(), path, flap_frequency_hz=3)).errors[0].message
    for hertz in ("0", "1001", "nan"):
        refused = problem(post(api, wing_table(), PATHS[2], axes=AXES, flap_frequency_hz=hertz))
        assert refused.errors[0].where == "body.flap_frequency_hz"


def test_files_larger_than_other_bodies_are_read_by_every_route(api: Api) -> None:
    large = wing_table(rate=4000.0, seconds=4.5)
    assert len(large) > request_limits.BODY_LIMIT
    for path in PATHS:
        assert post(api, large, path, axes=AXES).status_code == 200, path


@pytest.mark.parametrize(
    "name", ["../../x.csv", "a\nb.csv", "%0d%0aSet-Cookie: a.csv", "ü\u202ee.csv", "..", "x\0.csv"]
)
def test_names_of_files_stay_names(api: Api, name: str) -> None:
    table = post(api, wing_table(), "/v1/imports/table", name)
    assert table.status_code == 200
    assert re.fullmatch(r'attachment; filename="[A-Za-z0-9._-]+\.csv"', table.headers["Content-Disposition"])
    assert "Set-Cookie" not in table.headers
    found = post(api, wing_table(), "/v1/imports/description", name, axes=AXES).json()
    assert re.match(r'wing:\n  name: "[A-Za-z0-9._-]+"\n', found["yaml"])


def test_the_client_asks_for_a_description(api: Api, tmp_path: Path) -> None:
    file = tmp_path / "wing.csv"
    file.write_text(wing_table())
    with Client(str(api.client.base_url)) as client:
        found = client.import_description(file, axes="x aft, y out, z up", markers="in,tip")
    assert "2 markers" in {one["what"]: one["value"] for one in found["facts"]}["rest positions"]
