"""What the commands share: options, tables, JSON, numbers as people read them, and progress."""

from __future__ import annotations

import json
import sys
import time
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
from rich.table import Table
from rich.text import Text

Url = Annotated[
    str, typer.Option("--url", envvar="WINGFIT_URL", help="Address of the server.", rich_help_panel="Server")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the server's answer as JSON.")]

# A pipe has no width: wide enough that no id is cut off in a table that a script reads.
PIPE_WIDTH = 160
PLAIN_EVERY_S = 5.0
WHOLE_BELOW = 1e6
REVERSING = ("LRE", "RLE", "PDF", "LRO", "RLO", "LRI", "RLI", "FSI", "PDI")

Report = Callable[..., None]


def out() -> Console:
    """Console of what was asked for."""
    return Console(width=None if sys.stdout.isatty() else PIPE_WIDTH, highlight=False, soft_wrap=False)


def err() -> Console:
    """Console of progress and errors, so that a pipe gets only results."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


def _shown(text: str, *, lines: bool = True) -> str:
    """``text`` without characters that steer a terminal, reverse the text or cannot be printed.

    A name may be somebody else's.
    """
    kept = "\n\t" if lines else ""
    return "".join(one if one in kept or not _steers(one) else "\ufffd" for one in text)


def _steers(character: str) -> bool:
    return unicodedata.category(character) in ("Cc", "Cs") or unicodedata.bidirectional(character) in REVERSING


def say(text: str) -> None:
    """Print one result line as it is."""
    out().print(Text(_shown(text)), soft_wrap=True)


def note(text: str) -> None:
    """Print one line that is no result to standard error."""
    err().print(Text(_shown(text)))


def print_json(value: Any) -> None:
    """Print ``value`` as indented JSON."""
    sys.stdout.write(json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def table(columns: Sequence[str], rows: Sequence[Sequence[str]], empty: str = "none") -> None:
    """Print rows under headings; a column whose heading starts with ``>`` is right-aligned."""
    if not rows:
        say(empty)
        return
    grid = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    for index, name in enumerate(columns):
        grid.add_column(name.removeprefix(">"), justify="right" if name.startswith(">") else "left", no_wrap=index == 0)
    for row in rows:
        grid.add_row(*(Text(_shown(cell, lines=False)) for cell in row))
    out().print(grid)


def number(value: float | None, digits: int = 4, unit: str = "") -> str:
    """``value`` with significant digits, whole from 100 to a million, a dash where there is none."""
    if value is None:
        return "–"
    text = f"{value + 0.0:.{digits}g}"  # 0.0 takes the sign from -0
    if "e+" in text and abs(value) < WHOLE_BELOW:
        text = f"{value:.0f}"
    return f"{text}{' ' + unit if unit else ''}"


def mm(value: float | None) -> str:
    """Format a distance in mm with two decimals, a dash where there is none."""
    return "–" if value is None else f"{value:.2f}"


def moment(text: str | None) -> str:
    """Format a time of the API to the second, in UTC as it came."""
    return "–" if text is None else text[:19].replace("T", " ") + " UTC"


def duration(seconds: float | None) -> str:
    """``seconds`` as 0:07, 3:12 or 1:02:45."""
    if seconds is None:
        return "–"
    minutes, rest = divmod(int(max(seconds, 0) + 0.5), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


@contextmanager
def progress(title: str) -> Iterator[Report]:
    """Show a bar with the time left on a terminal, a line every few seconds elsewhere.

    Yields ``report(fraction, eta_s=None, note="")``; without ``eta_s`` the time left follows from the time
    spent, and ``fraction=None`` says that work goes on without a known end.
    """
    console = err()
    started = time.monotonic()

    def left(fraction: float | None, eta_s: float | None) -> str:
        spent = time.monotonic() - started
        if eta_s is None and fraction:
            eta_s = spent * (1 - fraction) / fraction
        return f"{duration(eta_s)} left" if eta_s is not None else f"{duration(spent)} so far"

    if not console.is_terminal:
        yield _plain(title, console, left)
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=30),
        TaskProgressColumn(),
        TextColumn("{task.fields[left]}"),
        TextColumn("[dim]{task.fields[note]}"),
    )
    with Progress(*columns, console=console, transient=False) as bars:
        task = bars.add_task(title, total=None, left="", note="")

        def show(fraction: float | None, eta_s: float | None = None, note: str = "") -> None:
            total = None if fraction is None else 1.0
            bars.update(task, total=total, completed=fraction, left=left(fraction, eta_s), note=note)

        yield show


def _plain(title: str, console: Console, left: Callable[[float | None, float | None], str]) -> Report:
    """Report as lines: the first one, then one whenever the last is old enough, and the end."""
    last = -PLAIN_EVERY_S
    done = False

    def show(fraction: float | None, eta_s: float | None = None, note: str = "") -> None:
        nonlocal last, done
        ended = fraction is not None and fraction >= 1
        if done or (not ended and time.monotonic() - last < PLAIN_EVERY_S):
            return
        last, done = time.monotonic(), ended
        percent = "" if fraction is None else f"{100 * fraction:3.0f} %  "
        console.print(Text(f"{title}  {percent}{left(fraction, eta_s)}  {note}".rstrip()))

    return show
