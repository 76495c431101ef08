"""Describes the planform of a wing from an outline: a drawing (SVG, DXF), a table of points, or one of stations.

The contract of :func:`wing_template`:

- **An outline** is one closed line without crossings. Curves are flattened. Open, crossing, tiny or several outlines
  are refused with a remedy.
- **Nothing is guessed.** Scale, the side of the root, the side of the leading edge and the flapping axis are stated by
  the file or the user; errors list all that is missing at once. What only follows from a convention (where x and y are
  zero) is listed as such.
- **Stations** approximate both edges within a stated accuracy.
- **The description** has a placeholder for everything that geometry does not show. Validation refuses it in clear words
  until it is filled in (:mod:`wingfit.records.description.placeholder`).

Readers (``svg``, ``dxf``, ``table``) return :class:`~wingfit.importers.planform.shapes.Drawn`: lines in the coordinates
of the file. ``placement`` is the only place where the file's statements and the user's meet. See ``docs/outlines.md``.
"""

from wingfit.importers.planform.wing_template import WingTemplate, wing_template

__all__ = ["WingTemplate", "wing_template"]
