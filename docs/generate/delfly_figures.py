"""Figures of docs/delfly.md: ``python -m docs.generate.delfly_figures [FOLDER]`` writes them as SVG."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.common.svg import Line, Panel, svg
from benchmarks.delfly import CUTOFF, FINER_CUTOFF, FINER_TRIAL, Fitted, fit
from wingfit.calibration.forces.agreement import comparison
from wingfit.calibration.forces.global_model import at, fit_global
from wingfit.calibration.forces.result import ForceComparison
from wingfit.records import LowPass
from wingfit.sim.filtering import low_passed
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.terms import chosen
from wingfit.sim.virtual_rigs.balance import TRIALS, Balance, delfly, record, true_beat
from wingfit.workers import make_evaluator

FOLDER = Path(__file__).parents[2] / "docs" / "figures"


def lift_panels(seed: int = 1) -> list[Panel]:
    """Return panels of lift in test 4 of Armanini et al. (2016): over the beat at both cutoffs, and its spectrum.

    Curves: recorded on the simulated balance, modelled with clap-and-peel, and without. ``seed``: of the noise.
    """
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
            Line("virtual balance", found[0].phase, found[0].recorded["lift"]),
            Line("with clap-and-peel", found[0].phase, found[0].modelled["lift"]),
            Line("without", found[1].phase, found[1].modelled["lift"]),
        )
        panels.append(Panel(f"Test 4, low-pass {cutoff:g} Hz", "t*", "lift, N", lines, fitted[1].misfit_range))
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
    """Return a panel per coefficient over body pitch: true values, local estimates and the global model.

    As Fig. 14 of Armanini et al. (2016). ``seed``: of the noise.
    """
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
    """Parse the command line, and write the figures."""
    parser = argparse.ArgumentParser(prog="python -m docs.generate.delfly_figures", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, panels in (("delfly-lift", lift_panels()), ("delfly-coefficients", coefficient_panels())):
        (folder / f"{name}.svg").write_text(svg(panels), encoding="utf-8")
        print(folder / f"{name}.svg")


if __name__ == "__main__":
    main()
