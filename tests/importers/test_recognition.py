"""The content decides which format a file has, never its name."""

from __future__ import annotations

import pytest

from tests.importers.reading import read, refused
from tests.oracles.track_files import Case, cases, flapping, text_writers
from wingfit.importers.readers import SPECIFIC
from wingfit.importers.source import open_source


@pytest.mark.parametrize("case", [*cases(2)])
def test_exactly_one_reader_recognises_a_file(case: Case) -> None:
    source = open_source(case.raw, "data.trc")
    fitting = [reader.name for reader in SPECIFIC if reader.recognises(source)]
    expected = case.format
    assert fitting == ([] if expected == "plain" else [expected])


def test_a_file_that_fits_two_formats_needs_a_choice() -> None:
    lines = text_writers.trc(flapping()).splitlines(keepends=True)
    both = "".join([*lines[:5], "NO_OF_FRAMES\t3\n", "MARKER_NAMES\ta\n", *lines[5:]])
    assert "choose one: --format trc or qualisys" in refused(both)


def test_a_format_can_be_stated() -> None:
    truth = flapping()
    found = read(text_writers.dltdv(truth), format="plain", unit="m", rate_hz=truth.rate)
    assert found.format == "plain"
    assert found.markers == ("pt1", "pt2", "pt3", "pt4")
    for name in ("trc", "motive", "qualisys", "vicon", "dltdv", "deeplabcut", "anipose", "dltdv-sparse"):
        assert refused("a,b\n1,2\n", format=name, unit="mm", rate_hz=1)
    assert "is binary" in refused(b"\0\1\2", format="trc")
    assert refused("a,b\n1,2\n", format="c3d")
    assert refused("a,b\n1,2\n", format="sleap", unit="mm", rate_hz=1)
