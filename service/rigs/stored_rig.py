"""The rig of a job on series: one that is installed on the server, or one that its user declares and drives."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Discriminator, Field, Tag

from wingfit.records import AnyDataset, SeriesDataset
from wingfit.rigs.declaration import Name, RigDeclaration
from wingfit.rigs.load import RigError, load_rig, plug_ins
from wingfit.rigs.rig import Rig
from wingfit.service.http.problems import error_item, invalid

INSTALLED, DECLARED = "installed", "declared"
MOST_DRIVEN_VALUES = 300_000  # of a recording; each takes up to 26 bytes of a message

RigIn = Annotated[
    Annotated[Name, Tag("name")] | Annotated[RigDeclaration, Tag("declaration")],
    Discriminator(lambda given: "name" if isinstance(given, str) else "declaration"),  # else errors come from both
    Field(
        description="for a dataset of series: the name of a rig that is installed on the server (/v1/rigs), or the "
        "declaration of one that you simulate with 'wingfit drive'"
    ),
]


def stored_rig(given: str | RigDeclaration | None) -> dict[str, Any]:
    """Return the columns with which a job stores its rig, by name; empty without a rig."""
    if given is None:
        return {}
    if isinstance(given, str):
        return {"rig": {INSTALLED: given}, "rig_name": given, "driven": False}
    return {"rig": {DECLARED: given.model_dump()}, "rig_name": given.name, "driven": True}


def given_rig(stored: Mapping[str, Any]) -> str | RigDeclaration:
    """Return what the request of a job gave as its rig; ``stored``: the column ``rig`` of the job."""
    return RigDeclaration.model_validate(stored[DECLARED]) if DECLARED in stored else str(stored[INSTALLED])


def requested(stored: Mapping[str, Any]) -> Any:
    """Return what the request of a job gave as its rig, as JSON."""
    return stored[DECLARED] if DECLARED in stored else stored[INSTALLED]


def rig_of(stored: Mapping[str, Any]) -> Rig:
    """Return the rig of a job; ValueError if it is no longer installed."""
    given = given_rig(stored)
    return _installed(given) if isinstance(given, str) else given.rig()


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
        if isinstance(given, str):
            return _installed(given)
        _refuse_large(dataset)
        return given.rig()
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


def _refuse_large(dataset: SeriesDataset) -> None:
    """ValueError for a recording whose simulation does not fit into the message of a driver."""
    for one in dataset.recordings:
        if one.values.size > MOST_DRIVEN_VALUES:
            raise ValueError(
                f"recording {one.name!r} has {one.values.size} values; a driver can return {MOST_DRIVEN_VALUES} for a "
                "simulation: thin or cut the recording, install the rig on the server, or diagnose it with --local"
            )
