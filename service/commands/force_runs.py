"""``wingfit runs forces`` and ``predict``, ``wingfit models``; and the tables of results on forces."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, cast, get_args

import typer

from service import force_answers as f
from service.client import DEFAULT_URL, Client, WingfitError
from service.commands.loads import COLOURS, check_file
from service.commands.output import AsJson, Url, note, number, print_json, say, table

MN = 1e3
QUANTITIES = {"lift": "lift", "drag": "drag", "x": "X (forward)", "z": "Z (down)"}
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
    table(["mean beat", ">recorded mN", ">modelled mN", ">RMS difference mN"], _beat_rows(answer))
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
        _write_csv(output, names, [answer[name] for name in names])  # type: ignore[literal-required]
    for warning in answer["warnings"]:
        note(f"warning: {warning}")
    if as_json:
        print_json(answer)
        return
    table(["coefficient", ">value"], [[name, number(value)] for name, value in answer["coefficients"].items()])
    say("")
    rows = [[name, mn(answer["averages_n"][name]), *_extremes(answer, name)] for name in ("lift", "drag")]
    table(["over one beat", ">mean mN", ">smallest mN", ">largest mN"], rows)


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
    rows = [["fitted", mn_(answer["before_mn"]), mn_(answer["after_mn"])]]
    if answer["held_out"]:
        rows.append(["held out", mn_(answer["held_out_before_mn"]), mn_(answer["held_out_after_mn"])])
    table(["RMS difference of the fitted axes", ">before mN", ">after mN"], rows)
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
    rows = [
        [QUANTITIES[one["quantity"]], mn(one["mean_recorded_n"]), mn(one["mean_modelled_n"]), *_fit(one)]
        for one in answer["agreements"]
    ]
    columns = ["force", ">mean recorded mN", ">mean modelled mN", ">RMS mN", ">% of range", ">correlation"]
    table([f"recording {answer['recording']}: {columns[0]}", *columns[1:]], rows)
    for remark in answer["remarks"]:
        note(f"note: {remark}")


def write_files(answer: f.Forces, output: Path | None, plot: Path | None) -> None:
    """Write the beat as CSV, and a page with plots."""
    if output:
        columns = {"phase": answer["phase"]}
        for kind in ("recorded_n", "spread_n", "modelled_n"):
            columns |= {f"{kind[:-2]}_{name}_n": series for name, series in answer[kind].items()}
        _write_csv(output, list(columns), list(columns.values()))
    if plot:
        _write_plot(answer, plot)


def mn(newtons: float | None) -> str:
    """Newtons as millinewtons with two decimals, a dash where there is none."""
    return mn_(None if newtons is None else MN * newtons)


def mn_(millinewtons: float | None) -> str:
    """Millinewtons with two decimals, a dash where there is none."""
    return "–" if millinewtons is None else f"{millinewtons:.2f}"


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
    """Models side by side: RMS difference of each force, in mN and % of its range; mean and correlation of the lift."""
    shown = [source for source in PREFERENCE if _has(answer["agreements"], source)]
    heads = [f">{source}" for source in shown] + ([">global, left out"] if answer["left_out"] else [])
    cells = {(a["recording"], a["quantity"], a["source"]): a for a in answer["agreements"]}
    left_out = {(a["recording"], a["quantity"]): a for a in answer["left_out"]}
    rms, means = [], []
    for recording, quantity in dict.fromkeys((a["recording"], a["quantity"]) for a in answer["agreements"]):
        name = f"{recording} (held out)" if recording in answer["held_out"] else recording
        models = [cells.get((recording, quantity, source)) for source in shown]
        models += [left_out.get((recording, quantity))] if left_out else []
        rms.append([name, quantity, *(_rms(model) for model in models)])
        if quantity == answer["agreements"][0]["quantity"]:
            recorded = next(model["mean_recorded_n"] for model in models if model)
            means.append([name, mn(recorded), *(_mean_and_correlation(model) for model in models)])
    table(["RMS difference, mN (% of range)", "force", *heads], rms)
    say("")
    quantity = answer["agreements"][0]["quantity"]
    table([f"mean {quantity} over a beat, mN (correlation)", ">recorded", *heads], means)


def _mean_and_correlation(agreement: f.Agreement | None) -> str:
    return "–" if agreement is None else f"{mn(agreement['mean_modelled_n'])} ({number(agreement['correlation'], 4)})"


def _global(law: f.GlobalModel) -> None:
    rows = [
        [
            gene["name"],
            number(gene["constant"]),
            number(gene["per_hz"]),
            number(gene["per_deg"]),
            _percent(gene["largest_error_percent"]),
            _percent(gene["left_out_error_percent"]),
        ]
        for gene in law["genes"]
    ]
    table(["global model", ">constant", ">per Hz", ">per deg", ">largest error", ">left out"], rows)
    (slow, fast), (low, high) = law["frequency_range_hz"], law["pitch_range_deg"]
    say(f"fitted from {slow:g} to {fast:g} Hz and from {low:g} to {high:g} deg of body pitch")


def _beat_rows(answer: f.Forces) -> list[list[str]]:
    rows = []
    for name, recorded in answer["recorded_n"].items():
        modelled = answer["modelled_n"][name]
        rms = (sum((m - r) ** 2 for m, r in zip(modelled, recorded, strict=True)) / len(recorded)) ** 0.5
        rows.append([QUANTITIES[name], mn(_mean(recorded)), mn(_mean(modelled)), mn(rms)])
    return rows


def _write_plot(answer: f.Forces, path: Path) -> None:
    from plotly import graph_objects
    from plotly.subplots import make_subplots

    names = list(answer["recorded_n"])
    titles = [f"{QUANTITIES[name]}{what}" for name in names for what in ("", ", spectrum")]
    figure = make_subplots(rows=len(names), cols=2, subplot_titles=titles, vertical_spacing=0.08)

    def draw(row: int, column: int, x: Sequence[float], y: Sequence[float], what: str) -> None:
        k = ("recorded", "modelled").index(what)
        line = {"width": 2, "simplify": False, "color": COLOURS[k]}
        named: dict[str, Any] = {"name": what, "legendgroup": what, "showlegend": (row, column) == (1, 1)}
        figure.add_trace(graph_objects.Scatter(x=x, y=y, line=line, **named), row=row, col=column)

    for row, name in enumerate(names, 1):
        draw(row, 1, answer["phase"], answer["recorded_n"][name], "recorded")
        draw(row, 1, answer["phase"], answer["modelled_n"][name], "modelled")
        for what, spectra in (
            ("recorded", answer["recorded_spectrum_n2_hz"]),
            ("modelled", answer["modelled_spectrum_n2_hz"]),
        ):
            if name in spectra:  # the mean, at 0 Hz, has been taken off
                draw(row, 2, answer["frequency_hz"][1:], spectra[name][1:], what)
        figure.update_yaxes(title_text="N", row=row, col=1)
        figure.update_yaxes(title_text="N²/Hz", type="log", row=row, col=2)
    figure.update_xaxes(title_text="t*, beats", row=len(names), col=1)
    figure.update_xaxes(title_text="Hz", row=len(names), col=2)
    title = f"Forces of {answer['recording']}, coefficients: {answer['source']}"
    figure.update_layout(title=title, height=330 * len(names), template="plotly_white")
    try:
        path.write_text(figure.to_html(include_plotlyjs=True), encoding="utf-8")
    except OSError as error:
        raise WingfitError(f"cannot write {path}", error.strerror or str(error)) from error
    note(f"plots written to {path}; open it in a browser")


def _write_csv(path: Path, names: Sequence[str], columns: Sequence[Sequence[float]]) -> None:
    try:
        with path.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(names)
            writer.writerows(zip(*columns, strict=True))
    except OSError as error:
        raise WingfitError(f"cannot write {path}", error.strerror or str(error)) from error
    note(f"forces written to {path}")


def _fit(one: f.Agreement) -> list[str]:
    return [mn(one["rmse_n"]), number(one["rmse_percent"], 3), number(one["correlation"], 3)]


def _rms(one: f.Agreement | None) -> str:
    return "–" if one is None else f"{mn(one['rmse_n'])} ({number(one['rmse_percent'], 2)})"


def _has(agreements: Sequence[f.Agreement], source: str) -> bool:
    return any(one["source"] == source for one in agreements)


def _percent(value: float | None) -> str:
    return number(value, 2, "%")


def _extremes(answer: f.Prediction, name: str) -> list[str]:
    series = answer["lift_n"] if name == "lift" else answer["drag_n"]
    return [mn(min(series)), mn(max(series))]


def _mean(series: Sequence[float]) -> float:
    return sum(series) / len(series)
