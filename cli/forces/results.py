"""Prints and writes results on forces: misfits, coefficients, agreement with recordings, forces over the beat."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING

from wingfit.cli.base.files import write_csv, write_text
from wingfit.cli.base.output import Columns, interval, number, records, remarks, say, table
from wingfit.cli.base.rounding import Unit, correlation, force_unit, rounded
from wingfit.client import force_answers as f
from wingfit.service.units import MN

if TYPE_CHECKING:
    from wingfit.report.charts import Chart

QUANTITIES = {"lift": "lift", "drag": "drag", "x": "X (forward)", "z": "Z (down)"}
PREFERENCE: tuple[f.Source, ...] = ("local", "joint", "global", "average", "nominal")


def force_result(answer: f.ForceResult) -> None:
    """Print the result of a run on forces: misfits, coefficients, agreement with each recording, global model."""
    uses = [("fitted", answer["before_mn"], answer["after_mn"])]
    if answer["held_out"]:
        uses.append(("held out", answer["held_out_before_mn"], answer["held_out_after_mn"]))
    newtons = [[None if value is None else value / MN for value in pair] for _, *pair in uses]
    unit = force_unit(value for pair in newtons for value in pair)
    rows = [[use, *map(unit.show, pair)] for (use, *_), pair in zip(uses, newtons, strict=True)]
    table(["RMS difference of the fitted axes", f">before {unit.name}", f">after {unit.name}"], rows)
    say("")
    _coefficients(answer["estimates"])
    say("")
    _agreements(answer)
    if answer["global_model"]:
        say("")
        _global(answer["global_model"])
    remarks(answer["remarks"])


def force_simulation(answer: f.ForceSimulation) -> None:
    """Print the agreement between modelled and recorded forces of a simulation with a given genome."""
    unit = force_unit(a[key] for a in answer["agreements"] for key in ("mean_recorded_n", "mean_modelled_n", "rmse_n"))
    columns: Columns[f.Agreement] = {
        f"recording {answer['recording']}: force": lambda one: QUANTITIES[one["quantity"]],
        f">mean recorded {unit.name}": lambda one: unit.show(one["mean_recorded_n"]),
        f">mean modelled {unit.name}": lambda one: unit.show(one["mean_modelled_n"]),
        f">RMS difference {unit.name}": lambda one: unit.show(one["rmse_n"]),
        ">% of range": lambda one: rounded(one["rmse_percent"]),
        ">correlation": lambda one: correlation(one["correlation"]),
    }
    records(answer["agreements"], columns)
    remarks(answer["remarks"])


def force_beats(answer: f.Forces) -> None:
    """Print the mean of recorded and of modelled forces over the beat, and their RMS difference."""
    say(f"recording {answer['recording']}, coefficients: {answer['source']}")
    means = {}
    for name, recorded in answer["recorded_n"].items():
        modelled = answer["modelled_n"][name]
        rms = (sum((m - r) ** 2 for m, r in zip(modelled, recorded, strict=True)) / len(recorded)) ** 0.5
        means[QUANTITIES[name]] = (fmean(recorded), fmean(modelled), rms)
    unit = force_unit(value for values in means.values() for value in values)
    heads = [f">{what} {unit.name}" for what in ("recorded", "modelled", "RMS difference")]
    table(["mean beat", *heads], [[name, *map(unit.show, values)] for name, values in means.items()])
    remarks(answer["remarks"])


def write_forces(answer: f.Forces, output: Path | None, plot: Path | None) -> None:
    """Write forces over the beat to the CSV file ``output``, and plots to the HTML file ``plot``; None: not written."""
    if output:
        columns = {"phase": answer["phase"]}
        for kind in ("recorded_n", "standard_deviation_n", "modelled_n"):
            columns |= {f"{kind[:-2]}_{name}_n": series for name, series in answer[kind].items()}
        write_csv(output, columns, zip(*columns.values(), strict=True), "forces")
    if plot:
        from wingfit.report.charts import chart_page  # drawn only where a plot was requested

        title = f"Forces of {answer['recording']}, coefficients: {answer['source']}"
        write_text(plot, chart_page(title, charts(answer)), "plots")


def charts(answer: f.Forces) -> list[Chart]:
    """Return two charts per force: the mean beat, with a band of one standard deviation between beats; the spectrum."""
    from wingfit.report.charts import Chart, Curve

    phase, frequency = answer["phase"], answer["frequency_hz"][1:]  # without 0 Hz: the mean was subtracted
    spectra = {"recorded": answer["recorded_spectrum_n2_hz"], "modelled": answer["modelled_spectrum_n2_hz"]}
    shown = []
    for name, recorded in answer["recorded_n"].items():
        curves = [Curve("recorded", phase, recorded), Curve("modelled", phase, answer["modelled_n"][name])]
        if spread := answer["standard_deviation_n"].get(name):
            edges = ([r + sign * s for r, s in zip(recorded, spread, strict=True)] for sign in (-1, 1))
            curves.insert(0, Curve("1 standard deviation between beats", phase, recorded, band=(*edges,)))
        shown.append(Chart(QUANTITIES[name], "t*, beats", "N", curves))
        powers = [Curve(what, frequency, found[name][1:]) for what, found in spectra.items() if name in found]
        shown.append(Chart(f"{QUANTITIES[name]}, spectrum", "Hz", "N²/Hz", powers, logarithmic=True))
    return shown


def _coefficients(estimates: Sequence[f.Estimate]) -> None:
    rows = [
        [
            estimate["name"],
            c["name"],
            c["value"],
            number(c["standard_error"], 2),
            interval(c["low_90"], c["high_90"], 4),
            estimate["converged"],
        ]
        for estimate in estimates
        for c in estimate["coefficients"]
    ]
    table(["estimate on", "coefficient", ">value", ">standard error", "90 % interval", "converged"], rows)
    remarks(f"{estimate['name']}: {remark}" for estimate in estimates for remark in estimate["remarks"])


def _agreements(answer: f.ForceResult) -> None:
    """Print two tables with a row per recording and a column per source of the model's coefficients.

    The first gives the RMS difference of each force, the second mean and correlation of the first force.
    """
    there = {one["source"] for one in answer["agreements"]}
    shown = [source for source in PREFERENCE if source in there]
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


def _mean_and_correlation(agreement: f.Agreement | None, unit: Unit) -> str:
    if agreement is None:
        return "–"
    return f"{unit.show(agreement['mean_modelled_n'])} ({correlation(agreement['correlation'])})"


def _global(law: f.GlobalModel) -> None:
    columns: Columns[f.GlobalGene] = {
        "global model": "name",
        ">constant": "constant",
        ">per Hz": "per_hz",
        ">per deg": "per_deg",
        ">largest error": lambda gene: _percent(gene["largest_error_percent"]),
        ">error when left out": lambda gene: _percent(gene["leave_one_out_error_percent"]),
    }
    records(law["genes"], columns)
    (slow, fast), (low, high) = law["frequency_range_hz"], law["pitch_range_deg"]
    say(f"fitted from {slow:g} to {fast:g} Hz and from {low:g} to {high:g} deg of body pitch")


def _rms(one: f.Agreement | None, unit: Unit) -> str:
    return "–" if one is None else f"{unit.show(one['rmse_n'])} ({rounded(one['rmse_percent'], 2)})"


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{rounded(value, 2)} %"
