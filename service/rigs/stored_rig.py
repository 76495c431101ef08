"""The rig of a job on series: one that is installed on the server, or one that its user declares and drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field

from wingfit.records import AnyDataset, SeriesDataset
from wingfit.rigs.declaration import Name, RigDeclaration
from wingfit.rigs.load import RigError, load_rig, plug_ins
from wingfit.rigs.rig import Rig
from wingfit.service.http.problems import error_item, invalid

INSTALLED, DECLARED = "installed", "declared"

RigIn = Annotated[
    Name | RigDeclaration,
    Field(
        description="for a dataset of series: the name of a rig that is installed on the server (/v1/rigs), or the "
        "declaration of one that you simulate with 'wingfit drive'"
    ),
]


def stored_rig(given: str | RigDeclaration) -> dict[str, Any]:
    """Return what a job stores of its rig, as JSON."""
    return {INSTALLED: given} if isinstance(given, str) else {DECLARED: given.model_dump()}


def given_rig(stored: Mapping[str, Any]) -> str | RigDeclaration:
    """Return what the request of a job gave as its rig; the inverse of :func:`stored_rig`."""
    return RigDeclaration.model_validate(stored[DECLARED]) if DECLARED in stored else str(stored[INSTALLED])


def requested(stored: Mapping[str, Any]) -> Any:
    """Return what the request of a job gave as its rig, as JSON."""
    return stored[DECLARED] if DECLARED in stored else stored[INSTALLED]


def rig_of(stored: Mapping[str, Any]) -> Rig:
    """Return the rig of a job; ValueError if it is no longer installed."""
    given = given_rig(stored)
    return _installed(given) if isinstance(given, str) else given.rig()


def is_driven(stored: Mapping[str, Any] | None) -> bool:
    """Return whether a driver simulates the rig of a job, and not the server."""
    return stored is not None and DECLARED in stored


def rig_in_words(stored: Mapping[str, Any] | None) -> str | None:
    """Return the name of a job's rig; None if its dataset describes the rig."""
    if stored is None:
        return None
    return str(stored[DECLARED]["name"] if DECLARED in stored else stored[INSTALLED])


def requested_rig(given: str | RigDeclaration | None, dataset: AnyDataset) -> Rig | None:
    """Return the rig that a request names for ``dataset``; None where the dataset describes its own.

    Raises a 422 where it is missing, unknown or contradicts itself.
    """
    if not isinstance(dataset, SeriesDataset):
        if given is not None:
            message = "the dataset describes its own rig, a wing or a vehicle; leave rig out"
            raise invalid("the request names a rig", [error_item("body.rig", None, message)])
        return None
    if given is None:
        message = (
            f"the dataset has series of rig {dataset.rig!r}; name a rig that is installed on the server "
            f"({', '.join(plug_ins()) or 'there is none'}), or declare yours and simulate it: "
            "wingfit diagnose DATASET --rig my_rig.py"
        )
        raise invalid("there is no simulation", [error_item("body.rig", None, message)])
    try:
        return _installed(given) if isinstance(given, str) else given.rig()
    except ValueError as error:
        shown = given if isinstance(given, str) else given.name
        raise invalid("the rig cannot be used", [error_item("body.rig", shown, str(error))]) from None


def _installed(name: str) -> Rig:
    # Only names: a path or a module would run any file of the server.
    if name not in plug_ins():
        raise RigError(
            f"no rig {name!r} is installed on the server; it has {', '.join(plug_ins()) or 'none'}. To simulate a rig "
            "on your machine, send its declaration ('wingfit diagnose DATASET --rig my_rig.py' does)"
        )
    return load_rig(name)
