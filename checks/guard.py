"""An error inside one check must not refuse a dataset, nor end an upload: it is logged, and becomes a warning."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from typing import Literal

from wingfit.checks.mistake import Mistake

LOGGER = logging.getLogger(__name__)
NOT_CARRIED_OUT: Literal["not carried out"] = "not carried out"


def guarded(
    check: str, where: str, carry_out: Callable[[], Iterable[Mistake | None] | Mistake | None]
) -> list[Mistake]:
    """Return what ``carry_out`` finds, None left out; if it raises, a warning that ``check`` could not be carried out.

    ``where``: place in the dataset that is checked, as in :attr:`wingfit.checks.Mistake.where`.
    """
    try:
        found = carry_out()
        if found is None or isinstance(found, Mistake):
            found = [found]
        return [one for one in found if one is not None]
    except Exception as error:  # whatever it is, the dataset is not to blame
        LOGGER.exception("the check of %s could not be carried out on %s", check, where)
        return [
            Mistake(
                NOT_CARRIED_OUT,
                where,
                f"the check of {check} could not be carried out ({type(error).__name__})",
                "a result",
                "an error in wingfit; what this check finds is not known",
                "nothing in the dataset; report the error, with the log of the server or of this command",
            )
        ]


def is_finding(mistake: Mistake) -> bool:
    """Return whether ``mistake`` is one, not the note that a check could not be carried out."""
    return mistake.kind != NOT_CARRIED_OUT
