"""``wingfit runs history``, ``runs residual``, ``diagnoses residual``: charts in the terminal, or as one HTML file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from wingfit.cli.base.files import new_file, write_text
from wingfit.cli.base.options import AsJson, JobId, Url
from wingfit.cli.base.output import emit, number, say, table
from wingfit.cli.charts.chart import Chart, Line, show_chart
from wingfit.client import answers as a
from wingfit.client.client import DEFAULT_URL, Client, WingfitError

if TYPE_CHECKING:
    from wingfit.plot.misfits import Misfit

MOST_CHARTS = 4
Plot = Annotated[Path | None, new_file("Save the figure, to be looked at in a browser: FILE.html.", "--plot")]
Which = Annotated[str | None, typer.Option(help="Recording; default: the first one, of a diagnosis all.")]


def history(run_id: JobId, plot: Plot = None, url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """Draw the fitness of a run by generation in the terminal, with a row for each stage; lower is better.

    Example: wingfit runs history ID --plot history.html
    """
    with Client(url) as client:
        run, items = client.run(run_id), client.history(run_id)
    if not items and not as_json:
        raise WingfitError("nothing to draw", f"run {run_id} has no generation yet; wait: wingfit runs watch {run_id}")
    _save(plot, "history", items)
    then = f"open {plot} in a browser" if plot else f"wingfit runs residual {run_id}"
    if run["state"] in ("QUEUED", "RUNNING") and not plot:
        then = f"wingfit runs watch {run_id}"
    emit(items, _history, as_json=as_json, then=then)


def residual(
    run_id: JobId,
    recording: Which = None,
    genome: Annotated[
        Literal["best", "nominal"], typer.Option(help="Of a run on markers: simulate with this genome.")
    ] = "best",
    plot: Plot = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Draw how far simulation and recording differ over the beat, or over time, in the terminal.

    Of markers: their distance in mm, mean and largest. Of forces and series: recorded minus simulated values.

    Example: wingfit runs residual ID --recording test-4
    """
    with Client(url) as client:
        source: Any
        match client.run(run_id)["kind"]:
            case "tracks":
                source = client.comparison(run_id, recording, genome)
            case "forces":
                source = client.forces(run_id, recording)
            case _:
                source = client.result(run_id)
    then = f"open {plot} in a browser" if plot else f"wingfit diagnose --run {run_id}"
    _residual(source, recording, plot, as_json=as_json, then=then)


def finding_residual(
    diagnosis_id: JobId, recording: Which = None, plot: Plot = None, url: Url = DEFAULT_URL, as_json: AsJson = False
) -> None:
    """Draw the misfit of a diagnosis over the beat in the terminal, before and after effects are added.

    Example: wingfit diagnoses residual ID
    """
    with Client(url) as client:
        finding = client.finding(diagnosis_id)
    then = f"open {plot} in a browser" if plot else f"wingfit diagnoses watch {diagnosis_id} --report finding.html"
    _residual(finding, recording, plot, as_json=as_json, then=then)


def _residual(source: Any, recording: str | None, plot: Path | None, *, as_json: bool, then: str) -> None:
    from wingfit.plot.misfits import misfits_of  # imported late: other commands start faster

    try:
        found = misfits_of(source, recording)
    except (TypeError, ValueError) as error:
        raise WingfitError("nothing to draw", str(error)) from error
    _save(plot, "residual", source, recording)
    if as_json:
        emit([_data(one) for one in found], print, as_json=True)
        return
    for k, one in enumerate(found[:MOST_CHARTS]):
        if k:
            say("")
        show_chart(_chart(one))
    if len(found) > MOST_CHARTS:
        say(f"{len(found) - MOST_CHARTS} more are in --json and --plot; or choose one with --recording")
    emit(None, lambda _: None, as_json=False, then=then)


def _chart(one: Misfit) -> Chart:
    lines = [Line(name, list(one.x), list(values)) for name, values in one.lines.items()]
    if one.noise is not None:
        lines.reverse()  # "after" is drawn through, "before" with dashes
        lines.append(Line("noise", [float(one.x[0]), float(one.x[-1])], [one.noise, one.noise]))
    about = f"{'residual' if one.signed else 'misfit'}, {one.unit}" if one.unit else "residual"
    return Chart(one.title, one.x_label, about, lines, zero=True)


def _data(one: Misfit) -> dict[str, Any]:
    """Return the values of a chart as JSON: x, and y of each line; null where nothing was recorded."""
    lines = {name: [None if value != value else float(value) for value in line] for name, line in one.lines.items()}
    return {
        "title": one.title,
        "unit": one.unit,
        "x_label": one.x_label,
        "x": [float(x) for x in one.x],
        "noise": one.noise,
        "lines": lines,
    }


def _history(items: Sequence[a.HistoryItem]) -> None:
    from wingfit.plot.fitness import fitness_of

    found = fitness_of(items)
    starts = [start for start, _ in found.stages]
    x: list[float] = []
    best: list[float | None] = []
    mean: list[float | None] = []
    for at, low, middle in zip(found.x, found.best, found.mean, strict=True):
        if at in starts and x:  # stages sum over different recordings: no line joins them
            x, best, mean = [*x, at], [*best, None], [*mean, None]
        x, best, mean = [*x, at], [*best, low], [*mean, middle]
    lines = [Line("best", x, best), Line("mean", x, mean)]
    show_chart(
        Chart(
            f"fitness by generation: best {found.last}",
            "generation",
            f"fitness, {found.unit}",
            lines if any(value is not None for value in mean) else lines[:1],
            logarithmic=True,
            breaks=[start - 0.5 for start in starts[1:]],
        )
    )
    say("")
    table(["stage", ">generations", ">first best", ">last best", "fitness"], _stages(items, found.unit))


def _stages(items: Sequence[Mapping[str, Any]], unit: str) -> list[list[object]]:
    groups: dict[str, list[Mapping[str, Any]]] = {}
    for item in items:
        groups.setdefault(item["stage"], []).append(item)
    key = "best_percent" if unit.startswith("%") else "best"
    return [[stage, len(some), number(some[0][key]), number(some[-1][key]), unit] for stage, some in groups.items()]


def _save(path: Path | None, name: str, *values: Any) -> None:
    """Write the figure ``name`` of wingfit.plot as one HTML file that loads nothing; nothing without a path."""
    if path is None:
        return
    from wingfit import plot

    draw: Callable[..., Any] = getattr(plot, name)
    write_text(path, draw(*values).to_html(include_plotlyjs=True), "figure")
