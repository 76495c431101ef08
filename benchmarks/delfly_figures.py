"""Figures of docs/delfly.md: ``python -m benchmarks.delfly_figures [FOLDER]`` writes them as SVG."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
import numpy.typing as npt

from benchmarks.delfly import CUTOFF, FINER_CUTOFF, FINER_TRIAL, Fitted, fit
from calibration.evaluation import comparison
from calibration.force_result import ForceComparison
from calibration.global_model import at, fit_global
from records import LowPass
from sim.balance import TRIALS, Balance, delfly, record, true_beat
from sim.blade_element_wing import BladeElementWing
from sim.blades.terms import chosen
from sim.filtering import low_passed
from workers import make_evaluator

Array = npt.NDArray[np.float64]

FOLDER = Path(__file__).parent.parent / "docs" / "figures"
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 360.0, 250.0, 52.0, 8.0, 26.0, 40.0
COLOURS = ("#222222", "#0b6fb8", "#c4500b")
WIDTHS = (3.2, 1.4, 1.4)  # the first line shows on both sides of one that lies on it


@dataclass(frozen=True)
class Line:
    """A curve [n], or crosses where ``crosses``, with its name in the legend."""

    name: str
    x: Array
    y: Array
    crosses: bool = False


@dataclass(frozen=True)
class Panel:
    """One pair of axes; ``shaded`` is an interval of x."""

    title: str
    x: str
    y: str
    lines: tuple[Line, ...]
    shaded: tuple[float, float] | None = None
    logarithmic: bool = False


def svg(panels: Sequence[Panel]) -> str:
    """Panels side by side, with one legend below for all."""
    width, height = WIDTH * len(panels), HEIGHT + 22
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" '
        f'font-family="sans-serif" font-size="11"><rect width="100%" height="100%" fill="#ffffff"/>'
    ]
    parts += [f'<g transform="translate({k * WIDTH:g},0)">{_panel(panel)}</g>' for k, panel in enumerate(panels)]
    for k, line in enumerate(panels[0].lines):
        x = LEFT + 190 * k
        parts.append(f'<rect x="{x:g}" y="{HEIGHT + 5:g}" width="18" height="4" fill="{COLOURS[k]}"/>')
        parts.append(f'<text x="{x + 24:g}" y="{HEIGHT + 11:g}">{escape(line.name)}</text>')
    return "\n".join([*parts, "</svg>\n"])


def _panel(panel: Panel) -> str:
    x = np.concatenate([line.x for line in panel.lines])
    y = np.concatenate([_scaled(line.y, panel) for line in panel.lines])
    xs, ys = _ticks(x.min(), x.max()), _ticks(y.min(), y.max())
    parts = [f'<text x="{LEFT:g}" y="16" font-weight="bold">{escape(panel.title)}</text>']
    if panel.shaded:
        a, b = (_along(v, xs, LEFT, WIDTH - RIGHT) for v in panel.shaded)
        parts.append(
            f'<rect x="{a:.1f}" y="{TOP:g}" width="{b - a:.1f}" height="{HEIGHT - TOP - BOTTOM:g}" fill="#f0d9c8"/>'
        )
    for value in xs:
        at_x = _along(value, xs, LEFT, WIDTH - RIGHT)
        parts.append(f'<line x1="{at_x:.1f}" x2="{at_x:.1f}" y1="{TOP:g}" y2="{HEIGHT - BOTTOM:g}" stroke="#dddddd"/>')
        parts.append(f'<text x="{at_x:.1f}" y="{HEIGHT - BOTTOM + 14:g}" text-anchor="middle">{value:g}</text>')
    for value in ys:
        at_y = _along(value, ys, HEIGHT - BOTTOM, TOP)
        shown = f"1e{value:g}" if panel.logarithmic else f"{value:g}"
        parts.append(f'<line x1="{LEFT:g}" x2="{WIDTH - RIGHT:g}" y1="{at_y:.1f}" y2="{at_y:.1f}" stroke="#dddddd"/>')
        parts.append(f'<text x="{LEFT - 4:g}" y="{at_y + 4:.1f}" text-anchor="end">{shown}</text>')
    for colour, stroke, line in zip(COLOURS, WIDTHS, panel.lines, strict=False):
        at_x, at_y = _along(line.x, xs, LEFT, WIDTH - RIGHT), _along(_scaled(line.y, panel), ys, HEIGHT - BOTTOM, TOP)
        parts.append(_drawn(at_x, at_y, colour, stroke, crosses=line.crosses))
    parts.append(f'<text x="{WIDTH / 2:g}" y="{HEIGHT - 8:g}" text-anchor="middle">{escape(panel.x)}</text>')
    middle = (TOP + HEIGHT - BOTTOM) / 2
    parts.append(
        f'<text transform="translate(12,{middle:g}) rotate(-90)" text-anchor="middle">{escape(panel.y)}</text>'
    )
    return "".join(parts)


def _scaled(y: Array, panel: Panel) -> Array:
    return np.asarray(np.log10(y)) if panel.logarithmic else y


def _ticks(low: float, high: float) -> Array:
    """Round numbers that enclose [low, high]; the first and the last are the ends of the axis."""
    raw = (high - low) / 5
    size = 10.0 ** np.floor(np.log10(raw))
    step = next(m * size for m in (1, 2, 2.5, 5, 10) if m * size >= raw)
    return np.asarray(np.round(np.arange(np.floor(low / step), np.ceil(high / step) + 1) * step, 10))


def _along(value: Array | float, ticks: Array, start: float, end: float) -> Array:
    return np.asarray(start + (np.asarray(value) - ticks[0]) / (ticks[-1] - ticks[0]) * (end - start))


def _drawn(x: Array, y: Array, colour: str, stroke: float, *, crosses: bool) -> str:
    points = list(zip(x.tolist(), y.tolist(), strict=True))
    if crosses:
        path = "".join(f"M{a - 4:.1f} {b - 4:.1f}l8 8m0 -8l-8 8" for a, b in points)
    else:
        path = "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in points)
    return f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="{stroke:g}"/>'


def lift_panels(seed: int = 1) -> list[Panel]:
    """Lift of the source's test 4 over the beat at both cutoffs, and its spectrum: recorded, with and without fling."""
    evaluator, trial, vehicle = make_evaluator("in_process"), TRIALS[FINER_TRIAL], delfly()
    raw = record(true_beat(vehicle, trial), trial, Balance(), np.random.default_rng([seed, 3, FINER_TRIAL]))
    panels, lines = [], tuple[Line, ...]()
    for cutoff in (CUTOFF, FINER_CUTOFF):
        low = low_passed(raw, LowPass(cutoff))
        fitted = [
            fit(BladeElementWing(vehicle, chosen("proposed", left_out)), low, trial, evaluator)
            for left_out in ((), ("clap_and_peel",))
        ]
        found = [_compared(one) for one in fitted]
        lines = (
            Line("recorded (virtual balance)", found[0].phase, found[0].recorded["lift"]),
            Line("with clap-and-peel", found[0].phase, found[0].modelled["lift"]),
            Line("without", found[1].phase, found[1].modelled["lift"]),
        )
        panels.append(Panel(f"Test 4, low-pass {cutoff:g} Hz", "t*", "lift, N", lines, fitted[1].lacking))
    kept = (found[0].frequency > 0) & (found[0].frequency < 100)
    spectra = (found[0].recorded_spectrum, found[0].modelled_spectrum, found[1].modelled_spectrum)
    lines = tuple(
        Line(line.name, found[0].frequency[kept], np.maximum(spectrum["lift"][kept], 1e-9))
        for line, spectrum in zip(panels[0].lines, spectra, strict=True)
    )
    return [*panels, Panel("Spectrum, low-pass 67 Hz", "frequency, Hz", "N^2/Hz", lines, logarithmic=True)]


def _compared(one: Fitted) -> ForceComparison:
    forces = one.problem.model.observe(np.array([one.problem.base.values]), one.recording).channels[0]
    return comparison(one.recording, forces, "local")


def coefficient_panels(seed: int = 1) -> list[Panel]:
    """Local estimates and the global model over body pitch (the source's Fig. 14)."""
    evaluator, vehicle = make_evaluator("in_process"), delfly()
    fitted = [
        fit(
            BladeElementWing(vehicle),
            low_passed(
                record(true_beat(vehicle, trial), trial, Balance(), np.random.default_rng([seed, 3, k])),
                LowPass(CUTOFF),
            ),
            trial,
            evaluator,
        )
        for k, trial in enumerate(TRIALS)
    ]
    law = fit_global([one.local for one in fitted], [trial.condition for trial in TRIALS])
    pitch = np.degrees([trial.condition.angle_of_attack for trial in TRIALS])
    by_law = [at(law, trial.condition).values for trial in TRIALS]
    return [
        Panel(
            name,
            "body pitch, deg",
            name,
            (
                Line("Table 8 (the truth)", pitch, np.array([t.coefficients[name] for t in TRIALS]), True),
                Line("estimated", pitch, np.array([one.estimate.values[name] for one in fitted]), True),
                Line("global model (Eq. 23)", pitch, np.array([values[name] for values in by_law]), True),
            ),
        )
        for name in ("C_l", "C_r", "C_F")
    ]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.delfly_figures", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, panels in (("delfly-lift", lift_panels()), ("delfly-coefficients", coefficient_panels())):
        (folder / f"{name}.svg").write_text(svg(panels), encoding="utf-8")
        print(folder / f"{name}.svg")


if __name__ == "__main__":
    main()
