"""Options of several commands, and functions that read their values."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from wingfit.client.answers import CONDITION

Url = Annotated[
    str, typer.Option("--url", envvar="WINGFIT_URL", help="Address of the server.", rich_help_panel="Server")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the server's answer as JSON.")]
JobId = Annotated[str, typer.Argument(help="Id, as the 'list' command prints it.")]
DatasetOrPath = Annotated[
    str | None, typer.Argument(help="Id of a dataset, or a folder, .zip or .nc file to upload first.")
]


def names(param: typer.CallbackParam, words: list[str] | None) -> list[str] | None:
    """Return the names in the ``words`` given to an option; None if there are none. A callback of typer.

    One word may hold several names, separated by commas. Hyphens become underscores: clap-and-peel is clap_and_peel.
    """
    listed = [name.strip().replace("-", "_") for word in words or [] for name in word.split(",")]
    if "" in listed:
        raise typer.BadParameter(
            "a name is empty; use one comma between names, or leave the option out", param_hint=param.opts[0]
        )
    return listed or None


def settings(ctx: typer.Context, *others: str) -> dict[str, Any]:
    """Return the options that the user gave, except those named ``others``, as {field of the API request: value}."""
    return {name: value for name, value in ctx.params.items() if name not in others and value not in (None, [], ())}


Division = Annotated[
    str | None, typer.Option(help="4, 11, 24, or number of bodies per strip, e.g. 3,3,3,2; default: 11.")
]
Accuracy = Annotated[
    float | None, typer.Option(help="Largest error of a simulated marker in mm, 0.02 to 1; default: 0.1.")
]
Recordings = Annotated[list[str] | None, typer.Option("--recording", help="Fit only this recording; repeatable.")]
Genes = Annotated[list[str] | None, typer.Option("--gene", help="Estimate only this gene; repeatable.")]
BoundsFactor = Annotated[
    float | None, typer.Option(help="Bounds of each gene: nominal value / factor to nominal value * factor.")
]
With = Annotated[
    list[str] | None,
    typer.Option(
        "--with", callback=names, help="Include these effects of 'wingfit effects', e.g. added_mass,hinge_offset."
    ),
]
Preset = Annotated[str | None, typer.Option(help="Vehicles: a model of 'wingfit models'; default: proposed.")]
Without = Annotated[
    list[str] | None,
    typer.Option(callback=names, help="Vehicles: leave out this term, e.g. clap_and_peel; repeatable."),
]
Axes = Annotated[
    list[str] | None,
    typer.Option(
        "--axis", help="Vehicles: fit this force axis, x or z; repeatable; default of runs: x, of diagnoses: all."
    ),
]
LowPass = Annotated[
    float | None, typer.Option(help="Vehicles: cut-off frequency; default: 3.2 x flap frequency; 0: no filter.")
]
PeelWidth = Annotated[
    float | None, typer.Option(help="Vehicles: width, in beats, over which the end of the peel is smoothed.")
]
Rig = Annotated[
    str | None,
    typer.Option(
        metavar="RIG",
        help="Series: your simulation, my_rig.py or package.module:rig, which runs on this machine; or the name of a "
        "rig that is installed where it is computed.",
    ),
]


def refuse(options: Mapping[str, object], why: str) -> None:
    """Raise a usage error with the reason ``why`` if the user gave any of ``options`` ({name: value}; unset: None)."""
    for option, value in options.items():
        if value not in (None, [], False):
            raise typer.BadParameter(f"{why}; leave it out", param_hint=option)


def read_condition(words: list[str]) -> dict[str, float]:
    """Convert words such as ``airspeed_m_s=6`` to {name: value}; usage error for a name not in CONDITION."""
    values = {}
    for word in words:
        name, _, value = word.partition("=")
        if name not in CONDITION:
            raise typer.BadParameter(f"{word}: the name must be one of {', '.join(CONDITION)}", param_hint="--at")
        values[name] = _number(value, f"{word}: give NAME=VALUE, such as airspeed_m_s=6", "--at")
    return values


def read_genome(words: list[str], option: str = "--genome") -> dict[str, float]:
    """Return {gene: value} from ``words``, each NAME=VALUE or the path of a JSON file; later words have priority.

    ``option``: name of the option, for usage errors.
    """
    values: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        values |= {name: value} if equals else _read_genes(Path(word), option)
    remedy = "the value must be a number in SI units"
    return {name: _number(value, f"{name}={value}: {remedy}", option) for name, value in values.items()}


def _read_genes(path: Path, option: str) -> dict[str, Any]:
    """Return {gene: value} from a JSON file.

    The file holds such a dict, the output of 'runs genome --json', or the true genome that 'wingfit campaign' writes.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise typer.BadParameter(
            f"{path}: {error.strerror}; give name=value or a JSON file", param_hint=option
        ) from error
    except ValueError as error:
        raise typer.BadParameter(f"{path} is not JSON: {error}", param_hint=option) from error
    if not isinstance(content, dict):
        raise typer.BadParameter(f"{path} must hold {{name: value}}", param_hint=option)
    if isinstance(content.get("genes"), list):
        return {gene["name"]: gene["best"] for gene in content["genes"]}
    return dict(content["genome"]) if isinstance(content.get("genome"), dict) else content


def _number(value: Any, message: str, option: str) -> float:
    """Return ``value`` as a number; raise a usage error with ``message`` if it is none."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise typer.BadParameter(message, param_hint=option) from None
