"""``wingfit plan``: which genes and effects a campaign will identify, and which recordings to add."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from wingfit.cli.base import options as o
from wingfit.cli.base.output import emit, late_progress
from wingfit.cli.driving import rig_here
from wingfit.cli.planning.text import print_plan
from wingfit.client.client import DEFAULT_URL, Client, WingfitError

if TYPE_CHECKING:
    from wingfit.planning.spec import PlanSpec

NONE = "none"
DATASET = "ds_"  # ids of datasets begin with it


def plan(
    dataset: Annotated[
        str,
        typer.Argument(
            help="A dataset, or its description without recordings: folder, .zip, .nc or .yaml file; or the id of a "
            "dataset on a server, which then makes the plan."
        ),
    ],
    genes: Annotated[
        list[str] | None, typer.Option(help="Estimate only these genes, e.g. E_f,E_r; default: those of a calibration.")
    ] = None,
    effects: Annotated[
        list[str] | None,
        typer.Option(
            callback=o.names, help="Compare only these effects, e.g. added_mass,hinge_offset; 'none': no effects."
        ),
    ] = None,
    genome: Annotated[
        list[str] | None,
        typer.Option(help="FILE.json or NAME=VALUE, such as a calibrated genome; repeatable. Others are nominal."),
    ] = None,
    noise_mm: Annotated[float | None, typer.Option(help="Wings: noise of each coordinate in one frame.")] = None,
    noise_mn: Annotated[float | None, typer.Option(help="Vehicles: white noise of one sample of the force.")] = None,
    correlation: Annotated[float | None, typer.Option(help="Of the noise of successive frames, 0 to 0.99.")] = None,
    scatter_percent: Annotated[
        float | None, typer.Option(help="Vehicles: standard deviation of the force from beat to beat.")
    ] = None,
    zero_mn: Annotated[
        float | None, typer.Option(help="Vehicles: standard deviation of the zero of a recording, by drift.")
    ] = None,
    beats: Annotated[int | None, typer.Option(help="Beats of each recording; of a rig of your own: repeats.")] = None,
    frames: Annotated[int | None, typer.Option(help="Frames or samples per beat.")] = None,
    markers: Annotated[int | None, typer.Option(help="Wings: number of markers, spread over the wing.")] = None,
    add: Annotated[int | None, typer.Option(help="Recordings to propose, 0 to 20; default: 3.")] = None,
    power: Annotated[
        float | None, typer.Option(help="Probability with which an effect is to be detected; default: 0.9.")
    ] = None,
    target_percent: Annotated[
        float | None, typer.Option(help="Relative standard error that counts as identified; default: 7.5.")
    ] = None,
    recordings: Annotated[
        list[str] | None, typer.Option("--recording", help="Plan with this recording only; repeatable.")
    ] = None,
    division: o.Division = None,
    preset: o.Preset = None,
    without: o.Without = None,
    axes: o.Axes = None,
    included: o.With = None,
    rig: o.Rig = None,
    url: o.Url = DEFAULT_URL,
    as_json: Annotated[bool, typer.Option("--json", help="Print the plan as JSON.")] = False,
) -> None:
    """Plan an experiment: which genes and effects its recordings will identify, and which to add.

    Noise, beats, frames and markers are those of the recordings or, before the first recording, stated defaults. The
    description of an experiment is a dataset.yaml that lists the conditions; the files of recordings may be missing.

    Example: wingfit plan my-wing/dataset.yaml --noise-mm 0.4 --beats 10 --effects added_mass,hinge_offset
    """
    model = {"division": division, "preset": preset, "without": without, "axes": axes, "effects": included}
    listed = [name.strip() for word in genes or [] for name in word.split(",")]
    model |= {"genes": listed, "recordings": recordings}
    given: dict[str, Any] = {
        "noise_mm": noise_mm, "noise_mn": noise_mn, "correlation": correlation, "scatter_percent": scatter_percent,
        "zero_mn": zero_mn,         "beats": beats, "frames": frames, "markers": markers, "add": add, "power": power,
        "target_percent": target_percent, "genome": o.read_genome(genome or []) or None,
    }  # fmt: skip
    if effects is not None:
        given["effects"] = None if effects == [NONE] else tuple(effects)
    if dataset.startswith(DATASET) and not Path(dataset).exists():
        o.refuse({"--rig": rig}, "the server plans for wings and vehicles")
        made = _remote(url, dataset, given, model)
    else:
        made = _made(Path(dataset), given, model, rig)
    then = "record, then: wingfit diagnose FOLDER --local" if not as_json else ""
    emit(made, print_plan, as_json=as_json, then=then)


def _remote(url: str, dataset: str, given: dict[str, Any], model: dict[str, Any]) -> Mapping[str, Any]:
    """Return the plan that the server at ``url`` makes for the ``dataset`` with this id."""
    suspects = given.pop("effects", ())
    settings = {name: one for name, one in {**given, **model}.items() if one}
    with Client(url) as client, late_progress("planning") as show:
        show(None)
        return client.plan(dataset, suspects=suspects, **settings)


def _made(path: Path, given: dict[str, Any], model: dict[str, Any], rig: str | None) -> dict[str, Any]:
    """Return the plan for the dataset or description at ``path`` as plain data; WingfitError says what is wrong."""
    from wingfit.planning import plan_dataset, plan_rig  # imported late: other commands start faster
    from wingfit.planning.description import load_planned
    from wingfit.records import SeriesDataset
    from wingfit.workers import make_evaluator

    if not path.exists():
        raise WingfitError("no such dataset", f"{path} does not exist; give a folder, a .zip, a .nc or a .yaml file")
    try:
        spec = _spec(given, model)
        dataset, own = load_planned(path), rig_here(rig)
        with late_progress("planning") as show, closing(make_evaluator("in_process")) as evaluator:

            def report(fraction: float, stage: str) -> None:
                show(fraction, None, stage)

            if isinstance(dataset, SeriesDataset):
                if own is None:
                    raise WingfitError(
                        f"this dataset has series of rig {dataset.rig!r}", "name its simulation: --rig my_rig.py"
                    )
                return plan_rig(own, dataset, spec, evaluator, report).as_dict()
            if rig is not None:
                raise WingfitError("this dataset describes its own rig", "it has a wing or a vehicle: leave --rig out")
            return plan_dataset(dataset, spec, evaluator, report).as_dict()
    except ValueError as error:
        faults = [vars(fault) for fault in getattr(error, "errors", [])]
        raise WingfitError("no plan can be made", "" if faults else str(error), errors=faults) from error


def _spec(given: dict[str, Any], model: dict[str, Any]) -> PlanSpec:
    from wingfit.calibration.spec import CalibrationSpec
    from wingfit.planning.spec import PlanSpec

    settings: dict[str, Any] = {
        name: tuple(one) if isinstance(one, list) else one for name, one in model.items() if one
    }
    stated = {name: one for name, one in given.items() if one is not None or name == "effects"}
    return PlanSpec(calibration=CalibrationSpec(**settings), **stated)
