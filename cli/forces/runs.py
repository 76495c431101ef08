"""``wingfit runs forces``, ``runs predict``: print forces over the beat; ``wingfit models``: lists the models."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, cast, get_args

import typer

from wingfit.cli.base.files import new_file, write_csv
from wingfit.cli.base.options import AsJson, JobId, Url
from wingfit.cli.base.output import emit, remarks, say, table
from wingfit.cli.base.rounding import force_unit
from wingfit.cli.forces.results import force_beats, write_forces
from wingfit.client import force_answers as f
from wingfit.client.client import DEFAULT_URL, Client

BeatFile = Annotated[Path | None, new_file("Write the beat: FILE.csv.", "--output", "-o")]
SOURCES = get_args(f.Source)


def forces(
    run_id: JobId,
    recording: Annotated[str | None, typer.Option(help="Recording; default: the first one.")] = None,
    source: Annotated[
        str | None,
        typer.Option(help=f"Source of the coefficients: {', '.join(SOURCES)}; default: the best for that recording."),
    ] = None,
    output: BeatFile = None,
    plot: Annotated[Path | None, new_file("Plot forces over the beat and their spectra: FILE.html.", "--plot")] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Print, write or plot the recorded and modelled forces of one recording over the beat.

    Example: wingfit runs forces ID --recording test-4 --source global --plot forces.html
    """
    if source is not None and source not in SOURCES:
        raise typer.BadParameter(f"{source}: must be one of {', '.join(SOURCES)}", param_hint="--source")
    with Client(url) as client:
        answer = client.forces(run_id, recording, cast("f.Source | None", source))
    write_forces(answer, output, plot)
    then = f"wingfit runs forces {run_id} --plot forces.html"
    if plot:
        then = f"open {plot} in a browser"
    emit(answer, force_beats, as_json=as_json, then=then)


def predict(
    run_id: JobId,
    flap_frequency_hz: Annotated[float, typer.Option(help="Flap frequency, Hz.")],
    body_pitch_deg: Annotated[float, typer.Option(help="Body pitch, deg, nose up from level.")],
    airspeed_m_s: Annotated[float, typer.Option(help="Airspeed of level flight, m/s.")],
    pressure_mbar: Annotated[float | None, typer.Option(help="Air pressure; default: 1013.25.")] = None,
    temperature_c: Annotated[float | None, typer.Option(help="Air temperature; default: 20.")] = None,
    output: BeatFile = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Predict the forces under any condition from the global model of a finished run.

    Example: wingfit runs predict ID --flap-frequency-hz 12 --body-pitch-deg 60 --airspeed-m-s 0.7
    """
    with Client(url) as client:
        answer = client.predict(
            run_id,
            flap_frequency_hz=flap_frequency_hz,
            body_pitch_deg=body_pitch_deg,
            airspeed_m_s=airspeed_m_s,
            pressure_mbar=pressure_mbar,
            temperature_c=temperature_c,
        )
    if output:
        series = {name: answer[name] for name in ("phase", "x_n", "z_n", "lift_n", "drag_n")}
        write_csv(output, series, zip(*series.values(), strict=True), "forces")
    remarks(answer["warnings"], "warning")
    then = "the same command with -o beat.csv" if output is None else f"wingfit diagnose --run {run_id}"
    emit(answer, _prediction, as_json=as_json, then=then)


def models(url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """List the blade-element models of vehicles and their terms, with sources.

    Example: wingfit models
    """
    with Client(url) as client:
        emit(client.models(), _models, as_json=as_json, then="wingfit runs submit DATASET --preset NAME")


def _prediction(answer: f.Prediction) -> None:
    table(["coefficient", ">value"], list(answer["coefficients"].items()))
    say("")
    forces: dict[Literal["lift", "drag"], list[float]] = {"lift": answer["lift_n"], "drag": answer["drag_n"]}
    unit = force_unit(value for series in forces.values() for value in series)
    rows = [
        [name, *map(unit.show, (answer["averages_n"][name], min(series), max(series)))]
        for name, series in forces.items()
    ]
    table(["over one beat", *(f">{what} {unit.name}" for what in ("mean", "smallest", "largest"))], rows)


def _models(answer: f.Models) -> None:
    for preset in answer["presets"]:
        say(f"{preset['name']}: {preset['description']}")
        say(f"  {', '.join(preset['terms'])}")
        say(f"  {preset['source']}")
    say("")
    rows = [
        [t["name"], " ".join(g["name"] for g in t["genes"]), t["equation"], t["description"]] for t in answer["terms"]
    ]
    table(["term", "genes", "equation", "description"], rows)
