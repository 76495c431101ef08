"""A refitted hypothesis as plain data from which its simulation can be made again."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FittedModel:
    """A refitted hypothesis with the values of all its genes.

    Attributes:
        effects: in the model, also those that the nominal model has.
        added: of these, the effects of the hypothesis; empty for the nominal model.
        values: of all genes by name, in the order of the model.
        free: names of the F fitted genes.
        covariance: [F][F] of the values of these genes, each in the product of the units, widened so that normal
            intervals allow for few recordings (Student's distribution); empty for improbable hypotheses.
        division: discretisation of a wing; "" for others.
        elements, instants: resolution of the blade elements of a vehicle; 0 for others.
    """

    effects: tuple[str, ...]
    added: tuple[str, ...]
    values: dict[str, float]
    free: tuple[str, ...]
    covariance: tuple[tuple[float, ...], ...] = ()
    division: str = ""
    elements: int = 0
    instants: int = 0
