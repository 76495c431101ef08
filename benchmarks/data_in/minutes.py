"""How many minutes a new user needs from the file of a tracking system to a dataset that is shown on the page.

The person of :mod:`benchmarks.data_in.person` knows the file's units and axes, reads the introduction of README.md and
the sections to which it leads, and then does what the messages say: each option is copied from the error that asks for
it, the first of several. Installation and the first compilation are not counted. Both ways are really gone: the
commands are run, and the page is used in a browser.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from benchmarks.common.files import REPOSITORY
from benchmarks.common.server_process import Server
from benchmarks.data_in.person import Person

DATA = REPOSITORY.parent / "shared" / "data"
P = TypeVar("P")
LIMIT = 10.0  # minutes
SECTIONS = ("# wingfit", "## Install", "## From a file to a dataset")  # of README.md: the first leads to the others
PROGRAM = "import sys; from wingfit.cli.main import main; sys.exit(main())"
ROUNDS = 6


@dataclass(frozen=True)
class Source:
    """A file, and what its user knows: the unit of positions and of times, and the axes if it shows a wing.

    ``also`` holds options that choose another recording than the first.
    """

    file: str
    unit: str = ""
    time_unit: str = ""
    axes: str = ""
    also: str = ""


HAWK = "x out, y fore, z up"
SOURCES = {
    "hawk, both wings": Source("hawk/2024-06-03-TestBilateralMarkers.csv", "m", "s", HAWK),
    "hawk, one wing": Source("hawk/2024-06-03-TestUnilateralMarkers.csv", "m", "s", HAWK),
    "hawk, repeated times": Source(
        "hawk/2024-06-03-TestUnilateralMarkers.csv", "m", "s", HAWK, "seqID=02_07_074,Left=1"
    ),
    "walk, C3D": Source("mocap/optitrack_walking.c3d"),
    "arm, TRC cut off": Source("mocap/markers.trc"),
}


def readme() -> str:
    """Return the sections of README.md that lead from a file to a dataset, whole."""
    parts = re.split(r"^(?=#{1,2} )", (REPOSITORY / "README.md").read_text(), flags=re.MULTILINE)
    found = [part for part in parts if part.startswith(tuple(f"{title}\n" for title in SECTIONS))]
    assert len(found) == len(SECTIONS)  # noqa: S101  # or a section has another name
    return "".join(found)


def run(say: Callable[[str], None], data: Path = DATA) -> tuple[dict[str, Any], bool]:
    """Return minutes by file and way, and whether all are at most LIMIT; without the files, none and a note."""
    found = {name: source for name, source in SOURCES.items() if (data / source.file).is_file()}
    result: dict[str, Any] = {"limit": LIMIT, "skipped": [], "by_file": {}}
    if len(found) < len(SOURCES):
        result["skipped"] = [
            f"{name}: {source.file} is not there" for name, source in SOURCES.items() if name not in found
        ]
    if not found:
        return {"minutes_mocap_to_dataset": None, "mocap_to_dataset": result}, True
    for name, source in found.items():
        row = {"command line": _with_server(partial(_by_commands, data, source)).summary()}
        page = _with_server(partial(_by_page, data, source, result))
        row |= {} if page is None else {"page": page.summary()}
        result["by_file"][name] = row
        say(f"{name:<22}" + ", ".join(f"{way} {one['minutes']:.1f} min" for way, one in row.items()))
    most = max(one["minutes"] for row in result["by_file"].values() for one in row.values())
    return {"minutes_mocap_to_dataset": most, "mocap_to_dataset": result}, most <= LIMIT


def _with_server(way: Callable[[str, float], P]) -> P:
    """Return what ``way`` returns for the address of a new, empty server and the seconds in which it started."""
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        server = Server(Path(scratch), "in_process")
        began = time.monotonic()
        server.start()
        try:
            return way(f"http://127.0.0.1:{server.port}", time.monotonic() - began)
        finally:
            server.stop()


def started(start_s: float) -> Person:
    """Return a person who has read the README and started a server in a second terminal."""
    person = Person()
    person.reads(readme())
    for command in (". .venv/bin/activate", ". .venv/bin/activate", "wingfit serve --data wingfit-data"):
        person.types(len(command) + 1)
    person.waits(start_s)
    return person


def _by_commands(data: Path, source: Source, url: str, start_s: float) -> Person:
    person = started(start_s)
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        folder = Path(scratch) / "my-data"
        words = ["import", str(data / source.file)]
        # A shell completes the path of a file; the rest is typed.
        typed = f"wingfit import {Path(source.file).name[:8]}\t"
        done, text = _run(person, words, typed)
        added = [f"--axes {shlex.quote(source.axes)}"] if source.axes else []
        added.append(f"--dataset {folder}")
        for _ in range(ROUNDS):
            added = [*_remedies(text, source, words), *added]
            words += [word for one in added for word in shlex.split(one)]
            # The last command comes back with one key; what is added is typed.
            done, text = _run(person, words, "^" + " " + " ".join(one.replace(str(folder), "my-data") for one in added))
            added = []
            if done:
                break
        if not done:
            raise RuntimeError(f"{source.file}: no dataset after {ROUNDS} commands: {text}")
        for command in ("check", "upload"):
            words = ["datasets", command, str(folder), *(["--url", url] if command == "upload" else [])]
            done, text = _run(person, words, f"wingfit datasets {command} my-data")
            if not done:
                raise RuntimeError(f"{source.file}: datasets {command}: {text}")
    address = re.search(r"its page: (\S+)", text)
    assert address, text  # noqa: S101
    person.clicks_on()
    _look(person, address[1])
    return person


def _run(person: Person, words: list[str], typed: str) -> tuple[bool, str]:
    """Run a command; the person types it, waits, and reads all output. Return whether it went well, and its output."""
    person.types(len(typed) + 1)
    began = time.monotonic()
    ran = subprocess.run(  # noqa: S603  # our own command
        [sys.executable, "-c", PROGRAM, *words],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    person.waits(time.monotonic() - began)
    person.reads(ran.stdout + ran.stderr)
    return ran.returncode == 0, ran.stdout + ran.stderr


def _remedies(text: str, source: Source, words: list[str]) -> list[str]:
    """Return the options that the errors in ``text`` name, with the values they offer, or those that the user knows."""
    errors = " ".join(line for line in text.splitlines() if line.startswith("  "))
    known = {"--unit": source.unit, "--time-unit": source.time_unit, "--rows": source.also}
    found = list[str]()
    for option, value in re.findall(r"(--[a-z-]+)((?: (?!--)[\w.=,*'-]+)?)", errors):
        if option in words or any(one.startswith(f"{option} ") or one == option for one in found):
            continue
        if option == "--repeated":
            value = " gaps"
        takes = value.strip() if option not in ("--incomplete", "--keep-unlabelled", "--keep-zeros") else ""
        found.append(f"{option} {known.get(option) or takes}".rstrip())
    return found


def _by_page(data: Path, source: Source, result: dict[str, Any], url: str, start_s: float) -> Person | None:
    from benchmarks.data_in import minutes_page

    return minutes_page.walked(data, source, url, started(start_s), result)


def _look(person: Person, address: str) -> None:
    """The page of the dataset is opened and read, as far as it can be without a browser: its name and recordings."""
    from benchmarks.data_in import minutes_page

    minutes_page.looked(person, address)
