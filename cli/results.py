"""Prints the result of a run: misfits and genes, for a vehicle misfits and coefficients."""

from __future__ import annotations

from typing import Any

from wingfit.cli.base.output import Columns, interval, mm, number, records, remarks, say, table
from wingfit.cli.forces.results import force_result
from wingfit.client import answers as a
from wingfit.client.series_answers import SeriesResult

SIGNIFICANT = 2.0  # standard errors from which a value differs from zero; the web page uses the same (parts/tables.js)


def print_result(answer: Any) -> None:
    """Print the result of a run on tracks, forces or series."""
    if answer["kind"] == "forces":
        force_result(answer)
        return
    if answer["kind"] == "series":
        series_result(answer)
        return
    misfits(answer)
    say("")
    print_genes(answer["genes"])


def print_genes(items: list[a.GeneInfo]) -> None:
    """Print a table of genes: nominal and best value, bounds, standard error, and whether the gene is identifiable."""
    columns: Columns[a.GeneInfo] = {
        "gene": "name",
        ">nominal": "nominal",
        ">best": "best",
        "unit": "unit",
        "bounds": lambda gene: interval(gene["lower"], gene["upper"]),
        ">standard error": _error,
        "identifiable": identifiable,
    }
    records(items, columns)


def misfits(answer: a.Result) -> None:
    """Print the mean distance (mm) between simulated and recorded markers before and after the calibration."""
    rows = [[one["name"], _use(one), mm(one["before_mm"]), mm(one["after_mm"])] for one in answer["recordings"]]
    rows.append(["all fitted", "", mm(answer["before_mm"]), mm(answer["after_mm"])])
    if answer["held_out_after_mm"] is not None:
        rows.append(["all held out", "", mm(answer["held_out_before_mm"]), mm(answer["held_out_after_mm"])])
    table(["mean distance per marker", "use", ">before mm", ">after mm"], rows)
    if answer["noise_mm"] is not None:
        say(f"expected from tracking noise alone: {mm(answer['noise_mm'])} mm")
    remarks(answer["remarks"])


def series_result(answer: SeriesResult) -> None:
    """Print the misfit of each channel of a rig of the user's own, in its unit, and the genes."""
    rows = []
    for one in answer["recordings"]:
        use = "held out" if one["held_out"] else "fitted" if one["fitted"] else "not fitted"
        for channel in one["channels"]:
            misfits = [number(value) for value in (channel["before"], channel["after"], channel["noise"])]
            unit = "" if channel["unit"] == "1" else channel["unit"]
            rows.append([one["name"], use, channel["name"], *misfits, unit])
    table(["recording", "use", "channel", ">RMS before", ">after", ">noise", "unit"], rows)
    times = "times the noise" if answer["relative_to"] == "noise" else "of the range"
    say(f"all fitted: {number(answer['before'], 3)} before, {number(answer['after'], 3)} after, {times}")
    if answer["held_out_after"] is not None:
        before, after = number(answer["held_out_before"], 3), number(answer["held_out_after"], 3)
        say(f"all held out: {before} before, {after} after, {times}")
    remarks(answer["remarks"])
    say("")
    print_genes(answer["genes"])


def identifiable(gene: a.GeneInfo) -> str:
    """Return in words whether the recordings determine the value of ``gene``."""
    if not gene["searched"]:
        return "not estimated"
    error = gene.get("standard_error")
    if gene["nominal"] == 0 and error is not None and abs(gene["best"]) < SIGNIFICANT * error:
        return "not different from zero"
    return {True: "yes", False: "no", None: "not known yet"}[gene["identifiable"]]


def _error(gene: a.GeneInfo) -> str:
    """Return the standard error as text: in percent or, if the nominal value is zero, in the gene's unit."""
    absolute, relative = gene.get("standard_error"), gene["standard_error_percent"]
    if gene["nominal"] == 0 and absolute is not None:
        return f"± {number(absolute, 2)} {gene['unit'] if gene['unit'] != '1' else ''}".strip()
    return "–" if relative is None else f"± {number(relative, 2)} %"


def _use(recording: a.RecordingResult) -> str:
    if recording["held_out"]:
        return "held out"
    return "not fitted" if recording["stage"] is None else "fitted"
