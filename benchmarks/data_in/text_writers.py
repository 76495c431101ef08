"""Writers of the text formats, from the vendors' descriptions; they share no code with the importers."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence

import numpy as np

from benchmarks.data_in.truth import Truth

_TRC_KEYS = "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame OrigNumFrames"


def cell(value: float, missing: str = "", digits: int = 3) -> str:
    """Return ``value`` as a capture program prints it."""
    return missing if value != value else f"{value:.{digits}f}"


def _flat(truth: Truth, frame: int, scale: float, missing: str, digits: int) -> list[str]:
    return [cell(v * scale, missing, digits) for v in truth.mm[frame].reshape(-1)]


def _text(rows: Iterable[Sequence[object]], separator: str, end: str = "\n") -> str:
    return "".join(separator.join(str(one) for one in row) + end for row in rows)


def trc(
    truth: Truth,
    *,
    separator: str = "\t",
    unit: str = "mm",
    scale: float = 1.0,
    digits: int = 3,
    decimals: int = 6,
    missing: str = "",
    end: str = "\r\n",
) -> str:
    """Return a TRC file; ``decimals`` of the printed times."""
    count = len(truth.names)
    rows: list[Sequence[object]] = [
        ["PathFileType", 4, "(X/Y/Z)", "wing.trc"],
        [
            "DataRate",
            "CameraRate",
            "NumFrames",
            "NumMarkers",
            "Units",
            "OrigDataRate",
            "OrigDataStartFrame",
            "OrigNumFrames",
        ],
        [truth.rate, truth.rate, truth.frames, count, unit, truth.rate, 1, truth.frames],
        ["Frame#", "Time", *(part for name in truth.names for part in (name, "", ""))],
        ["", "", *(f"{axis}{m + 1}" for m in range(count) for axis in "XYZ")],
        [""],
    ]
    times = [f"{t / truth.rate:.{decimals}f}" for t in range(truth.frames)]
    rows += [[t + 1, time, *_flat(truth, t, scale, missing, digits)] for t, time in enumerate(times)]
    return _text(rows, separator, end)


def motive(
    truth: Truth,
    *,
    version: str = "1.23",
    unit: str = "Millimeters",
    scale: float = 1.0,
    digits: int = 6,
    labelled: bool = True,
) -> str:
    """Return a CSV of Motive with a rigid body beside the markers; ``labelled``: rows have titles in column two."""
    keys: list[object] = ["Format Version", version, "Take Name", "wing", "Capture Frame Rate", f"{truth.rate:.6f}"]
    keys += ["Export Frame Rate", f"{truth.rate:.6f}", "Total Exported Frames", truth.frames]
    keys += ["Rotation Type", "Quaternion", *(["Length Units", unit] if unit else []), "Coordinate Space", "Global"]
    body = ["Rigid Body"] * 7 + ["Rigid Body Marker"] * 3
    title = ["", "{}"] if labelled else ["", ""]
    rows: list[Sequence[object]] = [list(keys), []]

    def row(name: str, first: list[str], each: list[str]) -> None:
        rows.append([*(part.format(name) for part in title), *first, *(one for one in each for _ in range(3))])

    row("Type", body, ["Marker"] * len(truth.names))
    row("Name", ["Wing"] * 7 + ["Wing:1"] * 3, [f"Wing:{name}" for name in truth.names])
    row("ID", ['"8D0A"'] * 7 + ['"8D0B"'] * 3, [f'"{17 * m + 4096:X}"' for m in range(len(truth.names))])
    parts = ["Rotation"] * 4 + ["Position"] * 3 + ["Position"] * 3 + ["Position"] * 3 * len(truth.names)
    rows.append(["", "", *parts])
    rows.append(["Frame", "Time (Seconds)", *"XYZW", *"XYZ", *"XYZ", *("XYZ" * len(truth.names))])
    for t in range(truth.frames):
        ten = ["0.000000"] * 10
        rows.append([t, f"{t / truth.rate:.6f}", *ten, *_flat(truth, t, scale, "", digits)])
    return _text(rows, ",")


def qualisys(
    truth: Truth, *, times: bool = False, header: bool = False, rate: str | None = None, missing: str = ""
) -> str:
    """Return a TSV of Qualisys Track Manager, in mm; with ``times``, columns of frames and times come first."""
    rows: list[Sequence[object]] = [
        ["NO_OF_FRAMES", truth.frames],
        ["NO_OF_CAMERAS", 8],
        ["NO_OF_MARKERS", len(truth.names)],
        ["FREQUENCY", rate or f"{truth.rate:g}"],
        ["NO_OF_ANALOG", 0],
        ["ANALOG_FREQUENCY", 0],
        ["DESCRIPTION", "--"],
        ["TIME_STAMP", "2024-05-02, 10:47:36.627", "94247.45402301"],
        ["DATA_INCLUDED", "3D"],
        ["MARKER_NAMES", *truth.names],
        ["TRAJECTORY_TYPES", *(["Measured"] * len(truth.names))],
    ]
    before = ["Frame", "Time"] if times else []
    if header:
        rows.append([*before, *(f"{name} {axis}" for name in truth.names for axis in "XYZ")])
    for t in range(truth.frames):
        first = [t + 1, f"{t / truth.rate:.5f}"] if times else []
        rows.append([*first, *_flat(truth, t, 1.0, missing, 3)])
    return _text(rows, "\t", "\r\n")


def vicon(truth: Truth, *, unit: str = "mm", devices: bool = True, first: int = 1) -> str:
    """Return a CSV of Vicon Nexus, with a section of devices before the trajectories; ``first`` frame."""
    names = ["", "", *(part for name in truth.names for part in (f"Bird:{name}", "", ""))]
    rows: list[Sequence[object]] = []
    if devices:
        rows += [["Devices"], [1000], ["", "", "Balance - Force", "", ""], ["Frame", "Sub Frame", "Fx", "Fy", "Fz"]]
        rows += [["", "", "N", "N", "N"], *([n // 4 + 1, n % 4, 0.1, 0.2, 0.3] for n in range(40)), []]
    rows += [["Trajectories"], [f"{truth.rate:g}"], names]
    rows += [["Frame", "Sub Frame", *("XYZ" * len(truth.names))], ["", "", *([unit] * 3 * len(truth.names))]]
    rows += [[t + first, 0, *_flat(truth, t, 1.0, "", 3)] for t in range(truth.frames)]
    return _text(rows, ",", "\r\n")


def dltdv(truth: Truth) -> str:
    """Return a dense *xyzpts.csv, in m."""
    header = [f"pt{m + 1}_{axis}" for m in range(len(truth.names)) for axis in "XYZ"]
    rows: list[Sequence[object]] = [header, *(_flat(truth, t, 1e-3, "NaN", 6) for t in range(truth.frames))]
    return _text(rows, ",")


def dltdv_sparse(truth: Truth) -> str:
    """Return a sparse *xyzpts.tsv, in m, sorted by columns as MATLAB does."""
    flat = truth.mm.reshape(truth.frames, -1)
    places = [(t, c) for c in range(flat.shape[1]) for t in range(truth.frames) if flat[t, c] == flat[t, c]]
    rows: list[Sequence[object]] = [["DLTdv8 sparse data"], [truth.frames, flat.shape[1], len(places)]]
    rows += [[t + 1, c + 1, f"{flat[t, c] * 1e-3:.6f}"] for t, c in places]
    return _text(rows, "\t")


def deeplabcut(truth: Truth, *, individuals: bool = False, coordinates: str = "xyz") -> str:
    """Return a CSV as pandas writes a table with several levels of columns; by hand where pandas is not installed."""
    labels = [(name, axis) for name in truth.names for axis in coordinates]
    levels = {"scorer": ["DLC_resnet50"] * len(labels)}
    if individuals:
        levels["individuals"] = ["bird1"] * len(labels)
    levels |= {"bodyparts": [name for name, _ in labels], "coords": [axis for _, axis in labels]}
    values = truth.mm[:, :, : len(coordinates)].reshape(truth.frames, -1)
    try:
        import pandas
    except ImportError:
        rows: list[Sequence[object]] = [[level, *cells] for level, cells in levels.items()]
        rows += [[t, *("" if v != v else repr(float(v)) for v in values[t])] for t in range(truth.frames)]
        return _text(rows, ",")
    columns = pandas.MultiIndex.from_arrays([*levels.values()], names=[*levels])
    buffer = io.StringIO()
    pandas.DataFrame(values, columns=columns).to_csv(buffer)
    return buffer.getvalue()


def anipose(truth: Truth, *, shuffled: bool = False) -> str:
    """Return a CSV of 3-D poses of Anipose, in mm."""
    header = [f"{name}_{what}" for name in truth.names for what in ("x", "y", "z", "error", "ncams", "score")]
    header += [*(f"M_{i}{j}" for i in range(3) for j in range(3)), *(f"center_{i}" for i in range(3)), "fnum"]
    rows = []
    for t in range(truth.frames):
        row = []
        for m in range(len(truth.names)):
            row += [*(cell(v, "", 4) for v in truth.mm[t, m]), "0.71", "3.0", "0.98"]
        rows.append([*row, *"100010001", "0.0", "0.0", "0.0", str(t)])
    order = np.random.default_rng(1).permutation(len(header)) if shuffled else np.arange(len(header))
    return _text([[row[k] for k in order] for row in (header, *rows)], ",")


def plain(
    truth: Truth,
    *,
    names: str = "{marker}_{axis}_mm",
    time: str = "time_s",
    separator: str = ",",
    decimal: str = ".",
    missing: str = "",
    scale: float = 1.0,
    time_scale: float = 1.0,
) -> str:
    """Return a plain table; ``names`` is the pattern of the columns, "" for no column of times."""
    header = [names.format(marker=name, axis=axis, n="xyz".index(axis) + 1) for name in truth.names for axis in "xyz"]
    rows = [[time, *header] if time else header]
    for t in range(truth.frames):
        first = [f"{t / truth.rate * time_scale:.9f}"] if time else []
        rows.append([one.replace(".", decimal) for one in [*first, *_flat(truth, t, scale, missing, 6)]])
    return _text(rows, separator)
