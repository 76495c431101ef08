"""Results that follow from the printed Tables 3-5 and 8 and Eq. 23 of Armanini et al. (2016) alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import linprog

from wingfit.calibration.forces.global_model import fit_global
from wingfit.calibration.forces.result import GlobalModel, LocalEstimate
from wingfit.sim.vehicle.blade_element_wing import BladeElementWing
from wingfit.sim.vehicle.lift_drag import lift_drag
from wingfit.sim.vehicle.motion import angles_of, flap_series
from wingfit.sim.virtual_rigs.balance import TRIALS, delfly, true_beat


def tables_law() -> GlobalModel:
    """Fit Eq. 23, coefficients affine in flap frequency and body pitch, to Table 8 by unweighted least squares."""
    local = [
        LocalEstimate(t.name, (t.name,), t.coefficients, dict.fromkeys(t.coefficients, 0.0), (), (), 0.0, True, ())
        for t in TRIALS
    ]
    return fit_global(local, [trial.condition for trial in TRIALS], weighted=False)


def closest_law_percent(name: str) -> float:
    """Return the smallest maximum relative error (per cent) of an affine law for one coefficient of Table 8.

    ``name``: of the coefficient. The law is affine in flap frequency and body pitch (minimax fit).
    """
    values = np.array([trial.coefficients[name] for trial in TRIALS])
    design = (
        np.array([[1.0, t.condition.flap_frequency, t.condition.angle_of_attack] for t in TRIALS]) / values[:, None]
    )
    one = np.ones((len(values), 1))
    found = linprog(
        [0, 0, 0, 1],
        A_ub=np.block([[design, -one], [-design, -one]]),
        b_ub=np.concatenate([one[:, 0], -one[:, 0]]),
        bounds=[(None, None)] * 3 + [(0, None)],
    )
    return 100 * float(found.x[3])


def lift_by_root_pitch() -> dict[str, list[float]]:
    """Return the mean lift (N) in each test of Table 8 with its coefficients, for two root pitch angles.

    The keys "0" and "90_deg" are the two root pitch angles: the paper can be read either way.
    """
    found = {}
    for name, root in (("0", 0.0), ("90_deg", np.pi / 2)):
        vehicle = delfly()
        turned = replace(vehicle, motion=replace(vehicle.motion, root_pitch=root))
        beats = [(trial, true_beat(turned, trial).mean(axis=0)) for trial in TRIALS]
        found[name] = [float(lift_drag(force, t.condition.angle_of_attack)[0]) for t, force in beats]
    return found


def fling_ends(model: BladeElementWing) -> list[float]:
    """Return the earliest and latest time, as fractions of the beat, at which fling circulation ends in a test."""
    motion, n = model.vehicle.motion, 4000
    flap, rates = flap_series(motion.flap, {}, 1, n), [trial.condition.flap_frequency for trial in TRIALS]
    peels = [angles_of(flap, motion, {}, rate, n, claps=True, peel_width=0.0).peel[0] for rate in rates]
    ends = [float(np.flatnonzero(peel)[-1]) / len(peel) for peel in peels]
    return [min(ends), max(ends)]
