"""Direction, length and position of a wing's connectors (springs between its bodies), for effects of the structure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Mask
from wingfit.sim.wing.structure import SPANWISE_MODULUS, Structure


@dataclass(frozen=True)
class Joints:
    """Geometry of C connectors.

    Attributes:
        along_span: [C]: True if it joins neighbours along the span (or the root with its drive): it then bends about
            the chord (x) and twists about the span (y). False for neighbours along the chord, with these axes
            exchanged.
        part: [C]: length of wing that the connector represents, as a fraction of the span. An angle divided by it is a
            curvature in radians over the span, which is the same in every discretisation.
        within: [C]: True if it joins two bodies of the wing, False if it joins the root to a driving rod. Effects do
            not act on the bending of the latter, because a law in parallel would bridge the play of ``backlash``.
        reach: [C, 2]: where that length of wing begins and ends, as fractions of the span from root to tip.
    """

    along_span: Mask
    part: Array
    within: Mask
    reach: Array

    @classmethod
    def of(cls, structure: Structure) -> Joints:
        """Return the geometry of the connectors of ``structure``."""
        edges = structure.planform.strips(structure.division)
        root, span = edges[0], edges[-1] - edges[0]
        along = np.array([c.modulus == SPANWISE_MODULUS for c in structure.connectors])
        part, reach = np.zeros(len(along)), np.zeros((len(along), 2))
        for k, c in enumerate(structure.connectors):
            outer, panel = structure.bodies[c.second].centroid, structure.panels[c.second]
            inner = structure.bodies[c.first].centroid if c.first >= 0 else np.array([outer[0], root, 0.0])
            part[k] = (outer - inner)[1 if along[k] else 0] / span
            ends = (inner[1], outer[1]) if along[k] else (panel.y0, panel.y1)
            reach[k] = (np.array(ends) - root) / span
        within = np.array([c.first >= 0 for c in structure.connectors])
        return cls(along, part, within, reach)

    def out_of_plane(self, stiffness: Array) -> tuple[Array, Array]:
        """Return the stiffness about x and y [C, W] of ``stiffness`` [C, 6, W]; 0 about x where root and rods join."""
        return np.where(self.within[:, None], stiffness[:, 0], 0.0), stiffness[:, 1]

    def bending(self, stiffness: Array) -> tuple[Array, Array]:
        """Return the bending stiffness about x and about y [C, W]: :meth:`out_of_plane` with torsion set to zero."""
        about_x, about_y = self.out_of_plane(stiffness)
        along = self.along_span[:, None]
        return np.where(along, about_x, 0.0), np.where(along, 0.0, about_y)
