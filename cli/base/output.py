"""Prints tables, JSON, numbers with units, and progress."""

from __future__ import annotations

import json
import sys
import time
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from operator import itemgetter
from typing import Any, TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn
from rich.table import Table
from rich.text import Text

# A pipe has no width: wide enough that no id is cut off in a table that a script reads.
PIPE_WIDTH = 160
PLAIN_EVERY_S = 5.0
LATE_S = 2.0
WHOLE_BELOW = 1e6
REVERSING = ("LRE", "RLE", "PDF", "LRO", "RLO", "LRI", "RLI", "FSI", "PDI")

Report = Callable[..., None]
T = TypeVar("T")
Columns = Mapping[str, str | Callable[[T], object]]  # heading: key of an item, or function of it


def out() -> Console:
    """Return the console for results, on standard output."""
    return Console(width=None if sys.stdout.isatty() else PIPE_WIDTH, highlight=False, soft_wrap=False)


def err() -> Console:
    """Return the console for progress and messages, on standard error, so that a pipe receives results only."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


def printable(text: str, *, lines: bool = True) -> str:
    """Return ``text`` with control characters replaced, by which a dataset's name could manipulate the terminal.

    ``lines``: keep line feeds and tabs.
    """
    allowed = "\n\t" if lines else ""
    return "".join(one if one in allowed or not _is_control(one) else "\ufffd" for one in text)


def _is_control(character: str) -> bool:
    return unicodedata.category(character) in ("Cc", "Cs") or unicodedata.bidirectional(character) in REVERSING


def say(text: str) -> None:
    """Print ``text``, part of the result, to standard output."""
    out().print(Text(printable(text)), soft_wrap=True)


def note(text: str) -> None:
    """Print ``text``, a message that is not part of the result, to standard error."""
    err().print(Text(printable(text)))


def next_step(text: str) -> None:
    """Print the command that comes next, with which every command ends, to standard error: a pipe gets results only."""
    note(f"next: {text}")


def print_json(value: Any) -> None:
    """Print ``value`` as indented JSON."""
    sys.stdout.write(json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def emit(answer: Any, show: Callable[[Any], None], *, as_json: bool, then: str = "") -> None:
    """Print an answer of the server as JSON; or, by calling ``show``, as text, with the next step ``then``, if any."""
    if as_json:
        print_json(answer)
        return
    show(answer)
    if then:
        next_step(then)


def remarks(lines: Iterable[str], label: str = "note") -> None:
    """Print each different remark in ``lines`` once, after ``label``, to standard error."""
    for line in dict.fromkeys(lines):
        note(f"{label}: {line}")


def table(columns: Sequence[str], rows: Sequence[Sequence[object]], empty: str = "none") -> None:
    """Print ``rows`` of cells under the headings ``columns``; if there are no rows, print ``empty``.

    A column whose heading starts with ``>`` is right-aligned. Cells: None is shown as a dash, a float with four digits.
    """
    if not rows:
        say(empty)
        return
    grid = Table(box=None, pad_edge=False, header_style="bold", padding=(0, 2, 0, 0))
    for index, name in enumerate(columns):
        grid.add_column(name.removeprefix(">"), justify="right" if name.startswith(">") else "left", no_wrap=index == 0)
    for row in rows:
        grid.add_row(*(Text(printable(_cell(value), lines=False)) for value in row))
    out().print(grid)


def records(items: Iterable[Any], columns: Columns[Any], empty: str = "none") -> None:
    """Print a table with one row per item; ``columns`` maps a heading to a key or a function of the item."""
    cells = [itemgetter(column) if isinstance(column, str) else column for column in columns.values()]
    table([*columns], [[cell(item) for cell in cells] for item in items], empty)


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return number(value) if value is None or isinstance(value, float) else str(value)


def interval(low: float | None, high: float | None, digits: int = 3) -> str:
    """Return "[low, high]", or e.g. "above 3" if an end is None (not bounded by the data)."""
    if low is None or high is None:
        ends = [f"{word} {number(end, digits)}" for word, end in (("above", low), ("below", high)) if end is not None]
        return ends[0] if ends else "not bounded by the data"
    return f"[{number(low, digits)}, {number(high, digits)}]"


def percent(part: float | None) -> str:
    """Return the fraction ``part`` as a whole percentage, e.g. "12 %"; a dash for None."""
    return "–" if part is None else f"{100 * part:.0f} %"


def size(count: int) -> str:
    """Return a number of bytes as text in kB or MB."""
    return f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{count / 1e3:.1f} kB"


def number(value: float | None, digits: int = 4, unit: str = "") -> str:
    """Return ``value`` to ``digits`` significant digits, then ``unit``; a dash for None.

    A number from 10^``digits`` to a million is rounded to an integer instead, so that it needs no exponent.
    """
    if value is None:
        return "–"
    text = f"{value + 0.0:.{digits}g}"  # 0.0 takes the sign from -0
    if "e+" in text and abs(value) < WHOLE_BELOW:
        text = f"{value:.0f}"
    return f"{text}{' ' + unit if unit else ''}"


def mm(value: float | None) -> str:
    """Return a distance (mm) with two decimals, without unit; a dash for None."""
    return "–" if value is None else f"{value:.2f}"


def moment(text: str | None) -> str:
    """Return ``text``, a time of the API (RFC 3339), as e.g. "2025-01-31 12:00:00 UTC"; a dash for None."""
    return "–" if text is None else text[:19].replace("T", " ") + " UTC"


def duration(seconds: float | None) -> str:
    """Return ``seconds`` as 0:07, 3:12 or 1:02:45 (hours:minutes:seconds); a dash for None."""
    if seconds is None:
        return "–"
    minutes, rest = divmod(int(max(seconds, 0) + 0.5), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


@contextmanager
def progress(title: str) -> Iterator[Report]:
    """Show the progress of the with-block: a bar on a terminal, else a line every few seconds.

    Yields a function ``report(fraction, eta_s=None, note="")`` that the block calls. ``fraction``: part done, None if
    unknown; ``eta_s``: remaining time, by default extrapolated from the fraction.
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


@contextmanager
def late_progress(title: str) -> Iterator[Report]:
    """Show progress as :func:`progress` does, but only of work that has taken LATE_S; that of short work is noise."""
    started, shown = time.monotonic(), list[Report]()
    with ExitStack() as stack:

        def show(fraction: float | None, eta_s: float | None = None, note: str = "") -> None:
            if not shown and time.monotonic() - started > LATE_S:
                shown.append(stack.enter_context(progress(title)))
            if shown:
                shown[0](fraction, eta_s, note)

        yield show


def _plain(title: str, console: Console, left: Callable[[float | None, float | None], str]) -> Report:
    """Return a function ``report`` as :func:`progress` yields it, for an output that is no terminal.

    It prints the first report, then at most one every PLAIN_EVERY_S seconds, and the last (fraction 1). ``left``
    returns the remaining time as text.
    """
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
