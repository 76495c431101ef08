"""``wingfit simulate``: simulates one recording with given gene values."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from wingfit.cli.base import options as o
from wingfit.cli.base.files import new_file, write_csv
from wingfit.cli.base.output import emit, mm, progress, say, table
from wingfit.cli.forces.results import force_simulation, write_forces
from wingfit.cli.loads import accuracy, summary, write_loads, write_plot
from wingfit.client import answers as a
from wingfit.client.client import DEFAULT_URL, Client
from wingfit.client.load_answers import Loads


def simulate(
    dataset: Annotated[str, typer.Option(help="Id of a dataset.")],
    recording: Annotated[str | None, typer.Option(help="Recording; default: the first one.")] = None,
    division: o.Division = None,
    genome: Annotated[
        list[str] | None,
        typer.Option(help="FILE.json or NAME=VALUE; repeatable. Other genes have their nominal values."),
    ] = None,
    accuracy_mm: o.Accuracy = None,
    output: Annotated[Path | None, new_file("Write the tracks or forces as CSV.", "--output", "-o")] = None,
    loads: Annotated[
        Path | None,
        new_file(
            "Write loads, powers and energies over the beat: FILE.csv (a row per instant) or FILE.json.",
            "--loads",
            "--outputs",
        ),
    ] = None,
    plot: Annotated[
        Path | None,
        new_file("Plot motor torque, powers, lift, bending moments and energies, or forces: FILE.html.", "--plot"),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(
            help="NAME=VALUE; repeatable. Loads under another condition than the recording's, without tracks: "
            "flap_frequency_hz, phase_lag_deg, pressure_mbar, temperature_c, airspeed_m_s, angle_of_attack_deg."
        ),
    ] = None,
    effects: o.With = None,
    preset: o.Preset = None,
    without: o.Without = None,
    low_pass_hz: o.LowPass = None,
    peel_width_beats: o.PeelWidth = None,
    url: o.Url = DEFAULT_URL,
    as_json: o.AsJson = False,
) -> None:
    """Simulate one recording on the server and print the distance between simulation and recording.

    --loads and --plot add the loads inside the wing and on it: motor torque and power, lift and thrust, the load in
    every connector, and the energy balance.

    Example: wingfit simulate --dataset ID --genome best.json --genome E_f=6e6 --loads loads.csv --plot loads.html
    """
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
    given: dict[str, Any] = {"genome": o.read_genome(genome or []), "effects": effects or ()}
    condition = o.read_condition(at or [])
    with Client(url) as client:
        described = client.dataset(dataset)
        name = recording or described["recordings"][0]["name"]
        if described["kind"] == "forces":
            o.refuse(of_wings, "the dataset describes a vehicle, and this is for wings")
            given |= {"preset": preset or "proposed", "without": without or ()}
            given |= {"low_pass_hz": low_pass_hz, "peel_width_beats": peel_width_beats or 0.0}
            forces = client.simulate_forces(dataset, name, **given)
            write_forces(forces, output, plot)
            emit(forces, force_simulation, as_json=as_json, then=_next(dataset, plot))
            return
        o.refuse(of_vehicles, "the dataset describes a wing, and this is for vehicles")
        given |= {"division": division or "11", "accuracy_mm": accuracy_mm}
        with progress("simulating") as report:
            report(None)
            if condition:
                answer: Any = client.loads_under(dataset, name, condition=condition, **given)
            else:
                answer = client.simulate(dataset, name, outputs=loads is not None or plot is not None, **given)
    if plot:
        write_plot(
            answer["outputs"], plot, ", ".join([f"Loads under {name}", *(at or []), f"{given['division']} bodies"])
        )
    if output:
        write_tracks(answer, output)
    if loads:
        write_loads(answer["outputs"], loads)
    emit(answer, lambda answer: _show(answer, name), as_json=as_json, then=_next(dataset, plot))


def _next(dataset: str, plot: Path | None) -> str:
    return f"open {plot} in a browser" if plot else f"wingfit runs submit {dataset}, which estimates the genes"


def _show(answer: a.Simulation | Loads, recording: str) -> None:
    tracks = cast(a.Simulation, answer) if "numerics" in answer else None
    if tracks:
        table(["marker", ">mean distance mm"], [[name, mm(mean)] for name, mean in marker_distances(tracks).items()])
    if "outputs" in answer:
        table(["over one beat", "value"], summary(answer["outputs"]))
    if tracks:
        say(f"recording {recording}: mean distance {mm(tracks['mean_distance_mm'])} mm per marker")
        say(solved(tracks["numerics"]))


def solved(numerics: a.Numerics) -> str:
    """Return the number of time steps and the estimated error of a simulation as one line of text."""
    return f"solved with {accuracy(numerics)}"


def marker_distances(tracks: a.Comparison) -> dict[str, float | None]:
    """Return {marker: mean distance (mm) between simulation and recording}; None for a marker never tracked."""
    sums = {name: [0.0, 0] for name in tracks["markers"]}
    for recorded, simulated in zip(tracks["recorded_mm"], tracks["simulated_mm"], strict=True):
        for name, seen, drawn in zip(tracks["markers"], recorded, simulated, strict=True):
            if None not in seen and None not in drawn:
                sums[name][0] += math.dist(seen, drawn)  # type: ignore[arg-type]
                sums[name][1] += 1
    return {name: total / count if count else None for name, (total, count) in sums.items()}


def write_tracks(tracks: a.Comparison, path: Path) -> None:
    """Write CSV, one row per frame and marker: phase, marker, recorded x, y, z and simulated x, y, z in mm."""
    header = ["phase", "marker"] + [f"{kind}_{axis}_mm" for kind in ("recorded", "simulated") for axis in "xyz"]
    frames = zip(tracks["phase"], tracks["recorded_mm"], tracks["simulated_mm"], strict=True)
    rows = (
        [phase, name, *("" if value is None else value for value in (*seen, *drawn))]
        for phase, recorded, simulated in frames
        for name, seen, drawn in zip(tracks["markers"], recorded, simulated, strict=True)
    )
    write_csv(path, header, rows, "tracks")
