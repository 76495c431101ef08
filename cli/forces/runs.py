"""``wingfit runs forces`` and ``predict``, ``wingfit models``; and the tables of results on forces."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, cast, get_args

import typer

from wingfit.cli.base.files import check_file, write_csv
from wingfit.cli.base.output import AsJson, Url, note, number, print_json, say, table
from wingfit.cli.base.rounding import ForceUnit, correlation, force_unit, kept
from wingfit.cli.forces.plot import QUANTITIES, write_plot
from wingfit.client import force_answers as f
from wingfit.client.client import DEFAULT_URL, Client
from wingfit.service.units import MN

SOURCES = get_args(f.Source)
PREFERENCE: tuple[f.Source, ...] = ("local", "joint", "global", "average", "nominal")

RunId = Annotated[str, typer.Argument(help="Id of a run, from 'wingfit runs list'.")]


def forces(
    run_id: RunId,
    recording: Annotated[str | None, typer.Option(help="Recording; default: the first one.")] = None,
    source: Annotated[
        str | None,
        typer.Option(help=f"Whose coefficients: {', '.join(SOURCES)}; default: the run's best for that recording."),
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the beat: FILE.csv.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw forces over the beat and their spectra: FILE.html.")] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Print, write or draw recorded and modelled forces of one recording over the beat.

    Example: wingfit runs forces ID --recording test-4 --source global --plot forces.html
    """
    check_file(output, "--output", (".csv",))
    check_file(plot, "--plot", (".html",))
    if source is not None and source not in SOURCES:
        raise typer.BadParameter(f"{source}: must be one of {', '.join(SOURCES)}", param_hint="--source")
    with Client(url) as client:
        answer = client.forces(run_id, recording, cast("f.Source | None", source))
    write_files(answer, output, plot)
    if as_json:
        print_json(answer)
        return
    say(f"recording {answer['recording']}, coefficients: {answer['source']}")
    _beats(answer)
    for remark in answer["remarks"]:
        note(f"note: {remark}")


def predict(
    run_id: RunId,
    flap_frequency_hz: Annotated[float, typer.Option(help="Beats per second.")],
    body_pitch_deg: Annotated[float, typer.Option(help="Nose up from level.")],
    airspeed_m_s: Annotated[float, typer.Option(help="Level speed through the air.")],
    pressure_mbar: Annotated[float | None, typer.Option(help="Of the air; 1013.25 if left out.")] = None,
    temperature_c: Annotated[float | None, typer.Option(help="Of the air; 20 if left out.")] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Write the beat: FILE.csv.")] = None,
    url: Url = DEFAULT_URL,
    as_json: AsJson = False,
) -> None:
    """Predict the forces under any condition from the global model of a finished run.

    Example: wingfit runs predict ID --flap-frequency-hz 12 --body-pitch-deg 60 --airspeed-m-s 0.7
    """
    check_file(output, "--output", (".csv",))
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
        names = ("phase", "x_n", "z_n", "lift_n", "drag_n")
        _write_forces(output, names, [answer[name] for name in names])  # type: ignore[literal-required]
    for warning in answer["warnings"]:
        note(f"warning: {warning}")
    if as_json:
        print_json(answer)
        return
    table(["coefficient", ">value"], [[name, number(value)] for name, value in answer["coefficients"].items()])
    say("")
    forces: dict[Literal["lift", "drag"], list[float]] = {"lift": answer["lift_n"], "drag": answer["drag_n"]}
    unit = force_unit(value for series in forces.values() for value in series)
    rows = [
        [name, *(unit.show(value) for value in (answer["averages_n"][name], min(series), max(series)))]
        for name, series in forces.items()
    ]
    table(["over one beat", f">mean {unit.name}", f">smallest {unit.name}", f">largest {unit.name}"], rows)


def models(url: Url = DEFAULT_URL, as_json: AsJson = False) -> None:
    """List the blade-element models of vehicles and the terms that they are made of, with their sources.

    Example: wingfit models
    """
    with Client(url) as client:
        answer = client.models()
    if as_json:
        print_json(answer)
        return
    for preset in answer["presets"]:
        say(f"{preset['name']}: {preset['description']}")
        say(f"  {', '.join(preset['terms'])}")
        say(f"  {preset['source']}")
    say("")
    rows = [
        [t["name"], " ".join(g["name"] for g in t["genes"]), t["equation"], t["description"]] for t in answer["terms"]
    ]
    table(["term", "genes", "equation", "what it is"], rows)


def force_result(answer: f.ForceResult) -> None:
    """Print misfits, coefficients with their intervals, agreements, and the global model."""
    found = [["fitted", answer["before_mn"], answer["after_mn"]]]
    if answer["held_out"]:
        found.append(["held out", answer["held_out_before_mn"], answer["held_out_after_mn"]])
    misfits = [[_newtons(before), _newtons(after)] for _, before, after in found]
    unit = force_unit(value for pair in misfits for value in pair)
    rows = [[str(use), *map(unit.show, pair)] for (use, *_), pair in zip(found, misfits, strict=True)]
    table(["RMS difference of the fitted axes", f">before {unit.name}", f">after {unit.name}"], rows)
    say("")
    _coefficients(answer["estimates"])
    say("")
    _agreements(answer)
    if answer["global_model"]:
        say("")
        _global(answer["global_model"])
    for remark in dict.fromkeys(answer["remarks"]):
        note(f"note: {remark}")


def given_forces(answer: f.ForceSimulation) -> None:
    """Print how a genome of one's own agrees with a recording."""
    forces = [[one["mean_recorded_n"], one["mean_modelled_n"], one["rmse_n"]] for one in answer["agreements"]]
    unit = force_unit(value for row in forces for value in row)
    rows = [
        [
            QUANTITIES[one["quantity"]],
            *map(unit.show, row),
            kept(one["rmse_percent"]),
            correlation(one["correlation"]),
        ]
        for one, row in zip(answer["agreements"], forces, strict=True)
    ]
    heads = [f">{what} {unit.name}" for what in ("mean recorded", "mean modelled", "RMS")]
    table([f"recording {answer['recording']}: force", *heads, ">% of range", ">correlation"], rows)
    for remark in answer["remarks"]:
        note(f"note: {remark}")


def write_files(answer: f.Forces, output: Path | None, plot: Path | None) -> None:
    """Write the beat as CSV, and a page with plots."""
    if output:
        columns = {"phase": answer["phase"]}
        for kind in ("recorded_n", "standard_deviation_n", "modelled_n"):
            columns |= {f"{kind[:-2]}_{name}_n": series for name, series in answer[kind].items()}
        _write_forces(output, list(columns), list(columns.values()))
    if plot:
        write_plot(answer, plot)


def _newtons(millinewtons: Any) -> float | None:
    return None if millinewtons is None else float(millinewtons) / MN


def _coefficients(estimates: Sequence[f.Estimate]) -> None:
    rows = [
        [
            estimate["name"],
            c["name"],
            number(c["value"]),
            number(c["standard_error"], 2),
            f"[{number(c['low_90'])}, {number(c['high_90'])}]",
            "yes" if estimate["converged"] else "no",
        ]
        for estimate in estimates
        for c in estimate["coefficients"]
    ]
    table(["estimate on", "coefficient", ">value", ">standard error", "90 % interval", "converged"], rows)
    for estimate in estimates:
        for remark in estimate["remarks"]:
            note(f"note: {estimate['name']}: {remark}")


def _agreements(answer: f.ForceResult) -> None:
    """Models side by side: RMS difference of each force, also in % of its range; mean and correlation of the lift."""
    shown = [source for source in PREFERENCE if _has(answer["agreements"], source)]
    heads = [f">{source}" for source in shown] + ([">global, left out"] if answer["leave_one_out"] else [])
    cells = {(a["recording"], a["quantity"], a["source"]): a for a in answer["agreements"]}
    left_out = {(a["recording"], a["quantity"]): a for a in answer["leave_one_out"]}
    every = [*answer["agreements"], *answer["leave_one_out"]]
    quantity = answer["agreements"][0]["quantity"]
    of_rms = force_unit(a["rmse_n"] for a in every)
    of_means = force_unit(
        a[key] for a in every if a["quantity"] == quantity for key in ("mean_recorded_n", "mean_modelled_n")
    )
    rms, means = [], []
    for recording, force in dict.fromkeys((a["recording"], a["quantity"]) for a in answer["agreements"]):
        name = f"{recording} (held out)" if recording in answer["held_out"] else recording
        models = [cells.get((recording, force, source)) for source in shown]
        models += [left_out.get((recording, force))] if left_out else []
        rms.append([name, force, *(_rms(model, of_rms) for model in models)])
        if force == quantity:
            recorded = next(model["mean_recorded_n"] for model in models if model)
            means.append([name, of_means.show(recorded), *(_mean_and_correlation(model, of_means) for model in models)])
    table([f"RMS difference, {of_rms.name} (% of range)", "force", *heads], rms)
    say("")
    table([f"mean {quantity} over a beat, {of_means.name} (correlation)", ">recorded", *heads], means)


def _mean_and_correlation(agreement: f.Agreement | None, unit: ForceUnit) -> str:
    if agreement is None:
        return "–"
    return f"{unit.show(agreement['mean_modelled_n'])} ({correlation(agreement['correlation'])})"


def _global(law: f.GlobalModel) -> None:
    rows = [
        [
            gene["name"],
            number(gene["constant"]),
            number(gene["per_hz"]),
            number(gene["per_deg"]),
            _percent(gene["largest_error_percent"]),
            _percent(gene["leave_one_out_error_percent"]),
        ]
        for gene in law["genes"]
    ]
    table(["global model", ">constant", ">per Hz", ">per deg", ">largest error", ">left out"], rows)
    (slow, fast), (low, high) = law["frequency_range_hz"], law["pitch_range_deg"]
    say(f"fitted from {slow:g} to {fast:g} Hz and from {low:g} to {high:g} deg of body pitch")


def _beats(answer: f.Forces) -> None:
    found = {}
    for name, recorded in answer["recorded_n"].items():
        modelled = answer["modelled_n"][name]
        rms = (sum((m - r) ** 2 for m, r in zip(modelled, recorded, strict=True)) / len(recorded)) ** 0.5
        found[QUANTITIES[name]] = (_mean(recorded), _mean(modelled), rms)
    unit = force_unit(value for values in found.values() for value in values)
    heads = [f">{what} {unit.name}" for what in ("recorded", "modelled", "RMS difference")]
    table(["mean beat", *heads], [[name, *map(unit.show, values)] for name, values in found.items()])


def _write_forces(path: Path, names: Sequence[str], columns: Sequence[Sequence[float]]) -> None:
    write_csv(path, names, zip(*columns, strict=True))
    note(f"forces written to {path}")


def _rms(one: f.Agreement | None, unit: ForceUnit) -> str:
    return "–" if one is None else f"{unit.show(one['rmse_n'])} ({kept(one['rmse_percent'], 2)})"


def _has(agreements: Sequence[f.Agreement], source: str) -> bool:
    return any(one["source"] == source for one in agreements)


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{kept(value, 2)} %"


def _mean(series: Sequence[float]) -> float:
    return sum(series) / len(series)
