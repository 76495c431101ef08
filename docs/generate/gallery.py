"""Make the findings of docs/gallery: ``python -m docs.generate.gallery [NAME ...]``, all of them without names.

Every finding comes from a whole diagnosis of a dataset of ``examples/``, or of recordings that a plant of the
benchmarks simulates, which shares no code with what diagnoses them. For each the command writes the finding
(NAME.json), its report (NAME.html) and a figure (NAME.svg), then the list in docs/gallery.md. ``--render``
diagnoses nothing: it writes reports, figures and list again from the findings. The command takes a few minutes on
two cores.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import wingfit
from benchmarks.common.svg import Line, Panel, svg
from benchmarks.concealed.benches.wing import WingBench
from benchmarks.concealed.plant.law import Concealed
from benchmarks.concealed.trials import EQUAL
from benchmarks.proof import robird
from docs.generate.effect_pages import ROOT, filled
from examples.pendulum.rig import rig as pendulum_rig
from wingfit.calibration.spec import CalibrationSpec
from wingfit.cli.base.output import progress
from wingfit.diagnosis import DiagnosisSpec
from wingfit.diagnosis.finding import Finding, Overlay, Verdict
from wingfit.records import AnyDataset
from wingfit.report import finding_from_json, finding_json, html
from wingfit.report.number_format import percent, scale_for
from wingfit.report.page import headline
from wingfit.rigs.rig import Rig

FOLDER = ROOT / "docs" / "gallery"
PAGE = FOLDER.parent / "gallery.md"
MOST_SAMPLES = 400  # of each recorded curve in a report of the gallery
DIGITS = 6  # significant digits of every number in a stored finding
WORKERS = 2


@dataclass(frozen=True)
class Entry:
    """One finding of the gallery.

    ``title`` and ``words`` (what was recorded, and what is true) describe it; ``verdict``: that the diagnosis gives;
    ``data`` returns the dataset; ``spec``: of the diagnosis; ``rig``: simulation of a dataset of series.
    """

    title: str
    words: str
    verdict: Verdict
    data: Callable[[], AnyDataset]
    spec: DiagnosisSpec
    rig: Rig | None = None


def _example(name: str) -> Callable[[], AnyDataset]:
    return lambda: wingfit.load_dataset(ROOT / "examples" / name)


def _filmed(name: str, hidden: Concealed) -> Callable[[], AnyDataset]:
    """Return what films the wing of the study docs/proof.md, divided into four bodies, with the effects ``hidden``."""
    return lambda: robird.filmed(name, WingBench(EQUAL), 1, hidden).dataset


def _wing(division: str) -> DiagnosisSpec:
    return DiagnosisSpec(CalibrationSpec(division=division))


ENTRIES = {
    "wing-named": Entry(
        "A wing: the hinge is displaced",
        "Markers on the wing of a robotic bird, filmed in a vacuum chamber and in a wind tunnel. In truth, the axis of "
        "the hinge is displaced by 12 mm, and the wing accelerates a mass of air with it (added mass). The diagnosis "
        "names both, and nothing else.",
        "named",
        _filmed("displaced", {"hinge_offset": {"strength": 0.012, "direction": -0.8}, "added_mass": {"strength": 1.0}}),
        _wing("4"),
    ),
    "wing-adequate": Entry(
        "A wing: nothing is missing",
        "The same wing, as it is described: only its stiffness, its damping and the coefficients of the air are "
        "unknown. The refitted model predicts the held-out recordings to the noise, and the diagnosis names nothing.",
        "adequate",
        _filmed("as-described", {}),
        _wing("4"),
    ),
    "forces-named": Entry(
        "A vehicle on a balance: clap and peel",
        "The dataset `examples/delfly`: forces of a vehicle of four wings. The model does not contain the air between "
        "two wings that clap together and peel apart; the diagnosis names it, and where in the beat it acts.",
        "named",
        _example("delfly"),
        DiagnosisSpec(CalibrationSpec(without=("clap_and_peel",))),
    ),
    "wing-fault": Entry(
        "A wing: the cameras are at fault",
        "The physics of the model is complete, but the calibration of the cameras has a wrong scale: all lengths are "
        "2 % too large. The diagnosis names this fault of the measurement, and no physics.",
        "measurement fault",
        _filmed("rescaled", {"scale_error": {"strength": 0.02}}),
        _wing("4"),
    ),
    "wing-unnamed": Entry(
        "A wing: the cause is not in the library",
        "At 70 % of the span and half of the chord, the wing touches an elastic obstacle above it, which no effect of "
        "the library describes. The diagnosis says that physics is missing, where and when, and that it has no name.",
        "unnamed",
        _filmed("obstacle", {"stop": {"strength": 60.0, "span": 0.7, "chord": 0.5, "stroke": 0.85}}),
        _wing("4"),
    ),
    "pendulum-named": Entry(
        "A rig of your own: dry friction",
        "The dataset and rig of `examples/pendulum`, a file of 30 lines. The model has viscous damping only; in truth, "
        "the pivot also has dry friction, which the diagnosis names and measures.",
        "named",
        _example("pendulum"),
        DiagnosisSpec(),
        pendulum_rig,
    ),
}


def diagnosed(name: str) -> Finding:
    """Diagnose the entry ``name``; RuntimeError if the verdict is not the one that its text describes."""
    entry = ENTRIES[name]
    with progress(f"{name}: diagnosing") as show:
        found = wingfit.diagnose(
            entry.data(),
            entry.spec,
            rig=entry.rig,
            workers=1 if entry.rig else WORKERS,
            on_progress=lambda fraction, stage: show(fraction, None, stage),
        )
    if found.verdict != entry.verdict:
        raise RuntimeError(f"{name}: the verdict is {found.verdict!r}; the gallery describes {entry.verdict!r}")
    return compact(found)


def compact(finding: Finding) -> Finding:
    """Return ``finding`` without its duration, with thinner recorded curves and rounded numbers: a tenth of the size.

    Only curves are thinned; every number of the verdict stays as it is, but for rounding to DIGITS digits.
    """
    thin = replace(finding, seconds=0.0, overlays=tuple(_thinned(one) for one in finding.overlays))
    return finding_from_json(_rounded(finding_json(thin)))


def _thinned(overlay: Overlay) -> Overlay:
    step = -(-len(overlay.recorded) // MOST_SAMPLES)
    curves = ("phase", "times", "recorded", "before", "after")
    return replace(overlay, **{name: getattr(overlay, name)[::step] for name in curves})


def _rounded(value: Any) -> Any:
    if isinstance(value, float):
        return value if value == 0.0 else round(value, DIGITS - 1 - math.floor(math.log10(abs(value))))
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return [_rounded(item) for item in value] if isinstance(value, list) else value


def stored(name: str) -> Finding:
    """Return the finding of docs/gallery called ``name``."""
    return finding_from_json(json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8")))


def figure(finding: Finding) -> str:
    """Draw, as SVG, the curve on which model and recording differ most, and the difference, before and after."""
    overlay = max(finding.overlays, key=lambda one: _distance(one.before, one.recorded))
    x = np.array(overlay.times or overlay.phase)
    order = np.argsort(x, kind="stable")
    recorded, before, after = (np.array(one)[order] for one in (overlay.recorded, overlay.before, overlay.after))
    models = {"nominal model": before}
    if finding.added_effects:
        models["with the named effects" if finding.named else "with the closest effect"] = after
    label, unit = "time, s" if overlay.times else "part of the beat", overlay.unit or finding.unit
    whole = scale_for([float(np.abs(recorded).max())], unit)
    rest = scale_for([float(np.abs(recorded - before).max())], unit)
    curves = [Line("recorded", x[order], whole.factor * recorded)]
    curves += [Line(name, x[order], whole.factor * values) for name, values in models.items()]
    residuals = [Line("zero", x[order], np.zeros_like(recorded))]
    residuals += [Line(name, x[order], rest.factor * (recorded - values)) for name, values in models.items()]
    return svg(
        [
            Panel(overlay.recording, label, f"{overlay.channel}, {whole.unit}", tuple(curves)),
            Panel("recorded - simulated", label, f"{overlay.channel}, {rest.unit}", tuple(residuals)),
        ]
    )


def _distance(one: Iterable[float], other: Iterable[float]) -> float:
    return float(np.sqrt(np.mean((np.array(list(one)) - np.array(list(other))) ** 2)))


def gallery() -> str:
    """Return the list of all findings: title, figure, headline of the report, and what is true."""
    parts = []
    for name, entry in ENTRIES.items():
        finding = stored(name)
        where = f" Where: {finding.where.words}." if finding.where else ""
        share = percent(finding.probabilities.get(finding.verdict, 0.0))
        parts += [
            f"### {entry.title}",
            "",
            f"[![{entry.title}: recorded and simulated](gallery/{name}.svg)](gallery/{name}.html)",
            "",
            entry.words,
            "",
            f"**{headline(finding)}.** Verdict: *{finding.verdict}* ({share}).{where}",
            "",
            f"[Open the report](gallery/{name}.html), or [its numbers](gallery/{name}.json).",
            "",
        ]
    return "\n".join(parts).rstrip()


def rendered(name: str) -> dict[Path, str]:
    """Return the files that follow from the finding ``name``, by path: its report and its figure."""
    finding = stored(name)
    return {FOLDER / f"{name}.html": html(finding), FOLDER / f"{name}.svg": figure(finding)}


def main() -> None:
    """Diagnose the entries that the command line names, and write their files and the list."""
    parser = argparse.ArgumentParser(prog="python -m docs.generate.gallery", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(ENTRIES))
    parser.add_argument("--render", action="store_true", help="diagnose nothing; write from the stored findings")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in ENTRIES]
    if unknown:
        sys.exit(f"no finding is called {unknown[0]!r}; there are {', '.join(ENTRIES)}")
    names = options.names or list(ENTRIES)
    if not options.render:
        FOLDER.mkdir(exist_ok=True)
        for name in names:
            text = json.dumps(finding_json(diagnosed(name)), ensure_ascii=False, separators=(",", ":"))
            (FOLDER / f"{name}.json").write_text(text + "\n", encoding="utf-8")
    for name in names:
        for path, text in rendered(name).items():
            path.write_text(text, encoding="utf-8")
            print(path)
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), {"gallery": gallery()}), encoding="utf-8")


if __name__ == "__main__":
    main()
