"""``wingfit simulate``: one recording simulated with a genome of one's own."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from wingfit.cli.base.files import check_file, write_csv
from wingfit.cli.base.output import AsJson, Url, mm, note, number, print_json, progress, say, table
from wingfit.cli.effects import With, names
from wingfit.cli.forces.runs import given_forces, write_files
from wingfit.cli.loads import summary, write_loads, write_plot
from wingfit.client import answers as a
from wingfit.client.client import DEFAULT_URL, Client
from wingfit.client.load_answers import Loads

Track = list[float | None]


def simulate(
    dataset: Annotated[str, typer.Option(help="Id of a dataset.")],
    recording: Annotated[str | None, typer.Option(help="Recording; default: the first one.")] = None,
    division: Annotated[
        str | None, typer.Option(help="4, 11, 24, or bodies per strip, e.g. 3,3,3,2; 11 if left out.")
    ] = None,
    genome: Annotated[
        list[str] | None, typer.Option(help="FILE.json or name=value; repeatable. Others stay nominal.")
    ] = None,
    accuracy_mm: Annotated[
        float | None, typer.Option(help="Largest error of a simulated marker, 0.02 to 1; 0.1 if left out.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the tracks or forces as CSV.")] = None,
    loads: Annotated[
        Path | None,
        typer.Option(
            "--loads",
            "--outputs",
            help="Write loads, powers and energies over the beat: FILE.csv (a row per instant) or FILE.json.",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw motor torque, powers, lift, bending moments and energies, or forces: FILE.html."),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME=VALUE; repeatable. Loads under another condition than the recording's, without tracks: "
            "flap_frequency_hz, phase_lag_deg, pressure_mbar, temperature_c, airspeed_m_s, angle_of_attack_deg."
        ),
    ] = None,
    with_: With = None,
    preset: Annotated[
        str | None, typer.Option(help="Vehicles: a model of 'wingfit models'; proposed if left out.")
    ] = None,
    without: Annotated[list[str] | None, typer.Option(help="Vehicles: leave out this term; repeatable.")] = None,
    low_pass_hz: Annotated[
        float | None, typer.Option(help="Vehicles: cut-off; 3.2 x flap frequency if left out, 0: none.")
    ] = None,
    peel_width_beats: Annotated[
        float | None, typer.Option(help="Vehicles: beats over which the end of the peel is smoothed.")
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
    of_wings = {"--division": division, "--accuracy-mm": accuracy_mm, "--loads": loads, "--at": at}
    of_vehicles = {
        "--preset": preset,
        "--without": without,
        "--low-pass-hz": low_pass_hz,
        "--peel-width-beats": peel_width_beats,
    }
    asked: dict[str, Any] = {"genome": read_genome(genome or []), "effects": names(with_) or ()}
    condition = read_condition(at or [])
    with Client(url) as client:
        described = client.dataset(dataset)
        name = recording or described["recordings"][0]["name"]
        if described["kind"] == "forces":
            _refuse(of_wings, "the dataset describes a vehicle, and this is for wings")
            asked |= {"preset": preset or "proposed", "without": without or (), "low_pass_hz": low_pass_hz}
            found = client.simulate_forces(dataset, name, peel_width_beats=peel_width_beats or 0.0, **asked)
            write_files(found, output, plot)
            print_json(found) if as_json else given_forces(found)
            return
        _refuse(of_vehicles, "the dataset describes a wing, and this is for vehicles")
        asked |= {"division": division or "11", "accuracy_mm": accuracy_mm}
        wanted = loads is not None or plot is not None or bool(condition)
        answer = _of_wing(client, dataset, name, condition, asked, wanted)
    if plot:
        what = ", ".join([f"Loads under {name}", *(at or []), f"{asked['division']} bodies"])
        write_plot(answer["outputs"], plot, what)
        note(f"plots written to {plot}; open it in a browser")
    _write_and_say(answer, name, output, loads, as_json=as_json)


def _of_wing(
    client: Client, dataset: str, recording: str, condition: dict[str, float], asked: dict[str, Any], wanted: bool
) -> a.Simulation | Loads:
    with progress("simulating") as report:
        report(None)
        if condition:
            return client.loads_under(dataset, recording, condition=condition, **asked)
        return client.simulate(dataset, recording, outputs=wanted, **asked)


def _write_and_say(
    answer: a.Simulation | Loads, recording: str, output: Path | None, loads: Path | None, *, as_json: bool
) -> None:
    tracks = cast(a.Simulation, answer) if "numerics" in answer else None
    if output and tracks:
        write_tracks(tracks, output)
        note(f"tracks written to {output}")
    if loads:
        write_loads(answer["outputs"], loads)
        note(f"loads written to {loads}")
    if as_json:
        print_json(answer)
        return
    if tracks:
        rows = [[name, mm(distance)] for name, distance in marker_distances(tracks).items()]
        table(["marker", ">mean distance mm"], rows)
    if "outputs" in answer:
        table(["over one beat", "value"], summary(answer["outputs"]))
    if tracks:
        say(f"recording {recording}: mean distance {mm(tracks['mean_distance_mm'])} mm per marker")
        say(solved(tracks["numerics"]))


def _refuse(options: Mapping[str, object], why: str) -> None:
    """Refuse options that were given and cannot be meant."""
    for option, value in options.items():
        if value not in (None, [], False):
            raise typer.BadParameter(f"{why}; leave it out", param_hint=option)


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


def read_genome(words: list[str], option: str = "--genome") -> dict[str, float]:
    """Gene values from ``name=value`` words and JSON files, later ones overriding earlier ones."""
    values: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        values |= {name: value} if equals else _read_file(Path(word), option)
    try:
        return {name: float(value) for name, value in values.items()}
    except (TypeError, ValueError):
        bad = next(f"{name}={value}" for name, value in values.items() if not _is_number(value))
        raise typer.BadParameter(f"{bad}: the value must be a number in SI units", param_hint=option) from None


def _read_file(path: Path, option: str) -> dict[str, Any]:
    """Read {name: value}, or an answer of /genome as 'runs genome --json' prints it."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise typer.BadParameter(
            f"{path}: {error.strerror}; give name=value or a JSON file", param_hint=option
        ) from error
    except ValueError as error:
        raise typer.BadParameter(f"{path} is not JSON: {error}", param_hint=option) from error
    if isinstance(content, dict) and isinstance(content.get("genes"), list):
        return {gene["name"]: gene["best"] for gene in content["genes"]}
    if isinstance(content, dict) and isinstance(content.get("genome"), dict):
        return dict(content["genome"])  # the truth that the virtual rig writes beside its dataset
    if not isinstance(content, dict):
        raise typer.BadParameter(f"{path} must hold {{name: value}}", param_hint=option)
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
    write_csv(
        path,
        header,
        (
            [phase, name, *_cells(seen), *_cells(drawn)]
            for phase, recorded, simulated in frames
            for name, seen, drawn in zip(tracks["markers"], recorded, simulated, strict=True)
        ),
    )


def _cells(track: Track) -> list[float | str]:
    return ["" if value is None else value for value in track]
