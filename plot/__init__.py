"""Figures of runs, findings and datasets, drawn with plotly: ``from wingfit import plot``.

Each function takes what :class:`wingfit.Client` or the functions of the library return, and returns a
``plotly.graph_objects.Figure``, which a notebook shows and ``figure.write_html(FILE)`` saves. Words and colours are
those of the web page and of the report. plotly is imported with the first figure.

- :func:`history`: the fitness of a run by generation.
- :func:`comparison`: recorded and simulated values, with the residual below them.
- :func:`residual`: the misfit over the beat; of a finding, before and after effects are added.
- :func:`forces`: forces over the beat.
- :func:`wing`: recorded and simulated markers and their difference in 3-D.
- :func:`ranking`: the hypotheses of a finding.
- :func:`intervals`: estimates of genes with their intervals and bounds.
- :func:`conditions`: the conditions of the recordings of a dataset.
- :func:`dark`: any of these figures in dark colours.
"""

from wingfit.plot.beats import comparison, forces, residual
from wingfit.plot.estimates import intervals, ranking
from wingfit.plot.recordings import conditions
from wingfit.plot.search import history
from wingfit.plot.themes import dark
from wingfit.plot.tracks import wing

__all__ = ["comparison", "conditions", "dark", "forces", "history", "intervals", "ranking", "residual", "wing"]
