"""Files of each format: those that must be read, with what the user states, and those that must be refused."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from benchmarks.data_in import binary_writers as binary
from benchmarks.data_in import text_writers as text
from benchmarks.data_in.truth import Truth, flapping


@dataclass(frozen=True, eq=False)
class Case:
    """A file of a ``format`` that must be read as ``truth``, with the ``options`` that it does not state."""

    format: str
    raw: bytes
    truth: Truth
    options: dict[str, Any] = field(default_factory=dict)
    start_s: float = 0.0
    named: bool = True


@dataclass(frozen=True, eq=False)
class Refusal:
    """A file that must be refused, with a message that has all the ``words``."""

    format: str
    raw: bytes
    words: tuple[str, ...]
    options: dict[str, Any] = field(default_factory=dict)


def cases(seed: int) -> Iterator[Case]:
    """Yield files of every format, of a truth that depends on ``seed``."""
    truth, slow = flapping(seed), flapping(seed, rate=119.88)
    yield from _c3d(seed, truth)
    encodings = ("utf-8", "utf-8-sig", "utf-16", "utf-16-le")
    yield Case("trc", text.trc(truth).encode(encodings[seed % 4]), truth)
    yield Case("trc", text.trc(truth, separator=",", end="\n", missing="NaN").encode(), truth)
    yield Case("trc", text.trc(truth, unit="m", scale=1e-3, digits=6, decimals=3).encode(), truth)
    yield Case("motive", text.motive(truth).encode(encodings[seed % 4]), truth)
    yield Case("motive", text.motive(slow, unit="Meters", scale=1e-3, labelled=False).encode(), slow)
    yield Case("qualisys", text.qualisys(truth).encode(), truth, {"unit": "mm"})
    yield Case("qualisys", text.qualisys(slow, times=True, header=True).encode("utf-16"), slow, {"unit": "mm"})
    external = text.qualisys(truth, rate="EXT", missing="NULL").encode()
    yield Case("qualisys", external, truth, {"unit": "mm", "rate_hz": truth.rate})
    yield Case("vicon", text.vicon(truth).encode(), truth)
    yield Case("vicon", text.vicon(slow, devices=False, first=101).encode("utf-8-sig"), slow, start_s=100 / slow.rate)
    stated = {"unit": "m", "rate_hz": truth.rate}
    yield Case("dltdv", text.dltdv(truth).encode(), truth, stated, named=False)
    sparse = text.dltdv_sparse(truth).encode()
    yield Case("dltdv-sparse", sparse, truth, stated | {"format": "dltdv-sparse"}, named=False)
    stated = {"unit": "mm", "rate_hz": truth.rate}
    yield Case("deeplabcut", text.deeplabcut(truth).encode(), truth, stated)
    yield Case("deeplabcut", text.deeplabcut(truth, individuals=True).encode(), truth, stated)
    yield Case("anipose", text.anipose(truth, shuffled=seed % 2 == 1).encode(), truth, stated)
    yield Case("sleap", binary.sleap(truth), truth, stated)
    yield Case("sleap", binary.sleap(truth, form="triangulated", packed=False), truth, stated, named=False)
    yield from _plain(truth)


def _c3d(seed: int, truth: Truth) -> Iterator[Case]:
    coarse = flapping(seed, step_mm=0.01)
    if binary.have_ezc3d():
        yield Case("c3d", binary.by_ezc3d(truth), truth)
        yield Case("c3d", binary.by_ezc3d(truth, unit="m", scale=1e-3, analogue=True), truth)
    for processor in (binary.INTEL, binary.DEC, binary.MIPS):
        yield Case("c3d", binary.by_hand(truth, processor=processor), truth)
        yield Case("c3d", binary.by_hand(coarse, processor=processor, integers=0.01), coarse)
    yield Case("c3d", binary.by_hand(truth, first=70_000, trial=True), truth, start_s=69_999 / truth.rate)


def _plain(truth: Truth) -> Iterator[Case]:
    def case(written: str, **options: Any) -> Case:
        return Case("plain", written.encode(), truth, options)

    yield case(text.plain(truth))
    yield case(text.plain(truth, separator=";", decimal=",", missing="#N/A"), decimal="comma")
    yield case(text.plain(truth, names="{axis} {marker} [m]", time="t (ms)", scale=1e-3, time_scale=1e3))
    yield case(text.plain(truth, names="{marker}_xyz_{n}", time="", separator="\t"), unit="mm", rate_hz=truth.rate)
    yield case(text.plain(truth, names="{marker}.{axis}", time="time"), unit="mm", time_unit="s")
    columns = "; ".join(f"{name}=a{name}x,b{name}y,c{name}z" for name in truth.names)
    odd = text.plain(truth, names="{marker}{axis}", time="clock")
    for name in truth.names:
        for axis, letter in zip("xyz", "abc", strict=True):
            odd = odd.replace(f"{name}{axis}", f"{letter}{name}{axis}", 1)
    yield case(odd, columns=f"time=clock; {columns}", unit="mm", time_unit="s")


def refusals(seed: int) -> Iterator[Refusal]:
    """Yield files that do not state what is needed, with no option, and options that contradict the file."""
    truth = flapping(seed)

    def refused(name: str, raw: bytes | str, *words: str, **options: Any) -> Refusal:
        return Refusal(name, raw.encode() if isinstance(raw, str) else raw, words, options)

    both = ("--unit", "--rate-hz")
    yield refused("c3d", binary.by_hand(truth, unit="", rate=0.0), *both)
    yield refused("c3d", binary.by_hand(truth), *both, unit="m", rate_hz=truth.rate * 1.01)
    yield refused("c3d", binary.by_hand(truth)[: -512 * 4], "cut off")
    yield refused("trc", text.trc(truth, unit=""), "--unit")
    yield refused("trc", text.trc(truth), *both, unit="cm", rate_hz=100)
    yield refused("trc", text.trc(truth).replace("240.0", "100.0"), "--rate-hz")
    yield refused("motive", text.motive(truth, unit=""), "--unit")
    yield refused("motive", text.motive(truth), "--unit", unit="m")
    yield refused("qualisys", text.qualisys(truth, rate="EXT"), *both)
    yield refused("qualisys", text.qualisys(truth), "--rate-hz", unit="mm", rate_hz=200)
    yield refused("vicon", text.vicon(truth, unit=""), "--unit")
    yield refused("vicon", text.vicon(truth), *both, unit="in", rate_hz=241)
    yield refused("dltdv", text.dltdv(truth), *both)
    yield refused("dltdv", text.dltdv(truth).replace("pt1_X", "pt1_cam1_X"), "triangulate")
    yield refused("dltdv-sparse", text.dltdv_sparse(truth), "--format dltdv-sparse", unit="m", rate_hz=240)
    yield refused("dltdv-sparse", text.dltdv_sparse(truth), *both, format="dltdv-sparse")
    yield refused("deeplabcut", text.deeplabcut(truth), *both)
    yield refused("deeplabcut", text.deeplabcut(truth, coordinates="xy"), "triangulate", unit="mm", rate_hz=240)
    yield refused("anipose", text.anipose(truth), *both)
    yield refused("sleap", binary.sleap(truth), *both)
    yield refused("sleap", binary.sleap(truth, coordinates=2), "triangulate", unit="mm", rate_hz=240)
    yield refused("plain", text.plain(truth, names="{marker}_{axis}", time=""), *both)
    yield refused("plain", text.plain(truth, names="{marker}_{axis}", time="time"), "--unit", "--time-unit")
    yield refused("plain", text.plain(truth), "--unit", unit="m")
    yield refused("plain", text.plain(truth, separator=";", decimal=","), "--decimal comma")
    yield refused("plain", text.plain(truth, names="c{marker}{axis}q"), "--columns", unit="mm", rate_hz=240)
