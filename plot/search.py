"""The figure of a search: its fitness by generation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from wingfit.plot.fitness import Fitness, fitness_of
from wingfit.plot.style import ACCENT, FAINT, QUIET, Figure, finish, log_axis, objects, plain

FEW = 12  # points up to which each has a dot
HEIGHT = 440
MARGIN = 1.2  # factor beyond the values at either end of the axis of the fitness


def history(items: Sequence[Mapping[str, Any]]) -> Figure:
    """Draw the fitness of a run by generation, on a logarithmic axis: best and mean of the individuals.

    Stages sum over different recordings, so that no line joins them. The fitness is a sum of squared differences, in
    m^2 (tracks) or N^2 (forces), or a root mean square in percent of the range of each channel (series); lower is
    better. The best misfit in mm, mN or percent stands at each point.

    Args:
        items: the generations, as :meth:`wingfit.Client.history` returns them.

    Raises:
        ValueError: there are no generations yet.
    """
    found = fitness_of(items)
    figure = objects().Figure()
    for name, values, look in (
        ("mean", found.mean, {"color": FAINT, "width": 1.5, "dash": "dash"}),
        ("best", found.best, {"color": ACCENT, "width": 2.5}),
    ):
        figure.add_trace(_trace(found, name, values, look))
    for start, name in found.stages:
        figure.add_vline(start - 0.5, line={"color": QUIET, "width": 1, "dash": "dot"})
        figure.add_annotation(
            text=plain(name), x=start - 0.5, y=1, yref="paper", xanchor="left", yanchor="bottom", showarrow=False
        )
    figure.update_xaxes(title_text="generation", showgrid=False, range=[found.x[0] - 0.5, found.x[-1] + 0.5])
    figure.update_xaxes(tickformat="d", **({"dtick": 1} if len(found.x) <= FEW else {}))
    known = [value for value in (*found.best, *found.mean) if value is not None]
    ends = (min(known) / MARGIN, max(known) * MARGIN) if known else (0.1, 10.0)
    figure.update_yaxes(title_text=f"fitness, {found.unit}", **log_axis(*ends))
    title = f"Fitness by generation: best {found.last}"
    return finish(figure, title, HEIGHT, hovermode="x unified")


def _trace(found: Fitness, name: str, values: Sequence[float | None], look: dict[str, Any]) -> Any:
    x: list[float | None] = []
    y: list[float | None] = []
    text: list[str] = []
    starts = {start for start, _ in found.stages}
    for at, value, note in zip(found.x, values, found.notes, strict=True):
        if at in starts and x:  # a gap between two stages
            x, y, text = [*x, None], [*y, None], [*text, ""]
        x, y, text = [*x, at], [*y, value], [*text, note if name == "best" else ""]
    mode = "lines+markers" if len(found.x) <= FEW * len(found.stages) else "lines"
    hover = f"%{{y:.4g}} {found.unit}%{{text}}<extra>{name}</extra>"
    return objects().Scatter(
        x=x, y=y, text=text, name=name, mode=mode, line=look, marker={"size": 6}, hovertemplate=hover
    )
