"""``wingfit simulate``: one recording simulated with a genome of one's own."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from service import answers as a
from service.client import DEFAULT_URL, Client, WingfitError
from service.commands.loads import check_file, summary, write_loads, write_plot
from service.commands.output import AsJson, Url, mm, note, number, print_json, progress, say, table

Track = list[float | None]


def simulate(
    dataset: Annotated[str, typer.Option(help="Id of a dataset.")],
    recording: Annotated[str | None, typer.Option(help="Recording; default: the first one.")] = None,
    division: Annotated[str, typer.Option(help="4, 11, 24, or bodies per strip, e.g. 3,3,3,2.")] = "11",
    genome: Annotated[
        list[str] | None, typer.Option(help="FILE.json or name=value; repeatable. Others stay nominal.")
    ] = None,
    accuracy_mm: Annotated[
        float | None, typer.Option(help="Largest error of a simulated marker, 0.02 to 1; 0.1 if left out.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the tracks as CSV.")] = None,
    loads: Annotated[
        Path | None,
        typer.Option(
            "--loads",
            "--outputs",
            help="Write loads, powers and energies over the beat: FILE.csv (a row per instant) or FILE.json.",
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw motor torque, powers, lift, bending moments and energies: FILE.html.")
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME=VALUE; repeatable. Loads under another condition than the recording's, without tracks: "
            "flap_frequency_hz, phase_lag_deg, pressure_mbar, temperature_c, airspeed_m_s, angle_of_attack_deg."
        ),
    ] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Simulate one recording on the server and say how far it is from what was recorded.

    With --loads or --plot also what acts inside the wing and on it: motor torque and power, lift and thrust, the load
    in every connector, and the balance of energy.

    Example: wingfit simulate --dataset ID --genome best.json --genome E_f=6e6 --loads loads.csv --plot loads.html
    """
    check_file(loads, "--loads", (".csv", ".json"))
    check_file(plot, "--plot", (".html",))
    check_file(output, "--output")
    if at and output:
        raise typer.BadParameter(
            "no tracks were recorded under another condition; leave out --output", param_hint="--at"
        )
    values, condition = read_genome(genome or []), read_condition(at or [])
    wanted = loads is not None or plot is not None or bool(condition)
    with Client(url) as client, progress("simulating") as report:
        report(None)
        recording = recording or client.dataset(dataset)["recordings"][0]["name"]
        answer: a.Simulation | a.Loads
        asked: dict[str, Any] = {"division": division, "genome": values, "accuracy_mm": accuracy_mm}
        if condition:
            answer = client.loads_under(dataset, recording, condition=condition, **asked)
        else:
            answer = client.simulate(dataset, recording, outputs=wanted, **asked)
    if output:
        write_tracks(cast(a.Simulation, answer), output)
        note(f"tracks written to {output}")
    if loads:
        write_loads(answer["outputs"], loads)
        note(f"loads written to {loads}")
    if plot:
        write_plot(answer["outputs"], plot, ", ".join([f"Loads under {recording}", *(at or []), f"{division} bodies"]))
        note(f"plots written to {plot}; open it in a browser")
    if as_json:
        print_json(answer)
        return
    if not condition:
        rows = [[name, mm(distance)] for name, distance in marker_distances(cast(a.Simulation, answer)).items()]
        table(["marker", ">mean distance mm"], rows)
    if wanted:
        table(["over one beat", "value"], summary(answer["outputs"]))
    if not condition:
        distance = cast(a.Simulation, answer)["mean_distance_mm"]
        say(f"recording {recording}: mean distance {mm(distance)} mm per marker")
        say(solved(cast(a.Simulation, answer)["numerics"]))


def solved(numerics: a.Numerics) -> str:
    """How a simulation was solved, in a line."""
    error = number(numerics["estimated_error_mm"], 2)
    return f"solved with {numerics['steps_per_beat']} steps a beat, estimated error {error} mm"


def read_condition(words: list[str]) -> dict[str, float]:
    """What ``name=value`` words change of a condition; the server knows the limits."""
    values = {}
    for word in words:
        name, _, value = word.partition("=")
        if name not in a.CONDITION:
            raise typer.BadParameter(f"{word}: the name must be one of {', '.join(a.CONDITION)}", param_hint="--at")
        if not _is_number(value):
            raise typer.BadParameter(f"{word}: give NAME=VALUE, such as airspeed_m_s=6", param_hint="--at")
        values[name] = float(value)
    return values


def read_genome(words: list[str]) -> dict[str, float]:
    """Gene values from ``name=value`` words and JSON files, later ones overriding earlier ones."""
    values: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        values |= {name: value} if equals else _read_file(Path(word))
    try:
        return {name: float(value) for name, value in values.items()}
    except (TypeError, ValueError):
        bad = next(f"{name}={value}" for name, value in values.items() if not _is_number(value))
        raise typer.BadParameter(f"{bad}: the value must be a number in SI units", param_hint="--genome") from None


def _read_file(path: Path) -> dict[str, Any]:
    """Read {name: value}, or an answer of /genome as 'runs genome --json' prints it."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise typer.BadParameter(
            f"{path}: {error.strerror}; give name=value or a JSON file", param_hint="--genome"
        ) from error
    except ValueError as error:
        raise typer.BadParameter(f"{path} is not JSON: {error}", param_hint="--genome") from error
    if isinstance(content, dict) and isinstance(content.get("genes"), list):
        return {gene["name"]: gene["best"] for gene in content["genes"]}
    if isinstance(content, dict) and isinstance(content.get("genome"), dict):
        return dict(content["genome"])  # the truth that the virtual rig writes beside its dataset
    if not isinstance(content, dict):
        raise typer.BadParameter(f"{path} must hold {{name: value}}", param_hint="--genome")
    return content


def _is_number(value: Any) -> bool:
    try:
        float(value)
    except (TypeError, ValueError):
        return False
    return True


def marker_distances(tracks: a.Comparison) -> dict[str, float | None]:
    """Mean distance per marker in mm over the frames that were recorded; None for a marker never seen."""
    sums = {name: [0.0, 0] for name in tracks["markers"]}
    for recorded, simulated in zip(tracks["recorded_mm"], tracks["simulated_mm"], strict=True):
        for name, seen, drawn in zip(tracks["markers"], recorded, simulated, strict=True):
            if None not in seen and None not in drawn:
                sums[name][0] += math.dist(seen, drawn)  # type: ignore[arg-type]
                sums[name][1] += 1
    return {name: total / count if count else None for name, (total, count) in sums.items()}


def write_tracks(tracks: a.Comparison, path: Path) -> None:
    """Write one row per frame and marker: phase, marker, recorded x, y, z and simulated x, y, z in mm."""
    header = ["phase", "marker"] + [f"{kind}_{axis}_mm" for kind in ("recorded", "simulated") for axis in "xyz"]
    frames = zip(tracks["phase"], tracks["recorded_mm"], tracks["simulated_mm"], strict=True)
    try:
        with path.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(header)
            for phase, recorded, simulated in frames:
                for name, seen, drawn in zip(tracks["markers"], recorded, simulated, strict=True):
                    writer.writerow([phase, name, *_cells(seen), *_cells(drawn)])
    except OSError as error:
        raise WingfitError(f"cannot write {path}", error.strerror or str(error)) from error


def _cells(track: Track) -> list[float | str]:
    return ["" if value is None else value for value in track]
