"""When in the beat a force acts that a model lacks: a pulse that does so, the nominal genes free.

The misfit that is left by a fit is not the force that lacks: genes have taken up what they can, and a low-pass has
spread the rest. So a short pulse is put at every instant of the beat, with a size of its own in every channel of every
recording; where it takes most away, with what the genes can do taken out of both, it acts. A matched filter (Turin, IRE
Transactions on Information Theory 6, 311, 1960) would put the pulse through the low-pass as well; that would as soon
fit what swings back, and errs by twice as much. How much a pulse there explains is told by one that went through it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.evidence.intervals import standard_errors
from wingfit.diagnosis.evidence.screen import Nuisance
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.finding import Interval
from wingfit.diagnosis.subject import Subject
from wingfit.inference.score_test import explained
from wingfit.sim.filtering import gain, sampling_rate

Array = npt.NDArray[np.float64]

INSTANTS = 144
WIDTH = 0.015  # of a beat, standard deviation
MIN_EXPLAINED = 0.1  # of the misfit: a pulse that takes less tells no instant
FALSE_ALARM_PROBABILITY = 0.01  # that noise alone makes one take as much at any of them


def locate_pulse(subject: Subject, data: WhitenedData, fit: Fit) -> Interval | None:
    """Instant (beats) of the pulse that takes most of what ``fit`` leaves; None where none takes much.

    Its interval holds the instants at which it would take nearly as much, a misfit counting as a model's error.
    """
    nuisance = Nuisance(data, fit)
    left, white = nuisance.residual, fit.coefficients / data.scale
    phase = np.arange(INSTANTS) / INSTANTS
    gains = np.array([explained(nuisance.project_out(_pulses(subject, data, at)), left) for at in phase])
    best = int(np.argmax(gains))
    there = _pulses(subject, data, phase[best], low_passed=True)
    decrease, by_noise = (
        explained(nuisance.project_out(there), left),
        float(chi2.isf(FALSE_ALARM_PROBABILITY / INSTANTS, len(there))),
    )
    if decrease < max(MIN_EXPLAINED * float(left @ left), by_noise):
        return None
    beyond = max(float(white @ white) - decrease - len(white), 0.0)
    near = gains[best] - gains < standard_errors() ** 2 * (1.0 + beyond / data.effective_samples)
    apart = (phase - phase[best] + 0.5) % 1.0 - 0.5
    low, high = (_extent(near, apart, sign) for sign in (-1, 1))
    return Interval(float(phase[best]), float(phase[best] - low), float(phase[best] + high))


def _extent(near: npt.NDArray[np.bool_], apart: Array, sign: int) -> float:
    """How far the instants that are ``near`` reach to one side without a gap, and half an instant beyond."""
    order = np.argsort(np.where(sign * apart >= 0, sign * apart, np.inf))[: INSTANTS // 2]
    ends = np.flatnonzero(~near[order])
    return float(sign * apart[order[(ends[0] if len(ends) else len(order)) - 1]]) + 0.5 / INSTANTS


def _pulses(subject: Subject, data: WhitenedData, at: float, *, low_passed: bool = False) -> Array:
    """[channels, D]: a pulse ``at`` an instant (beats) in every channel of every recording, by itself.

    Sharp, or ``passed`` through the low-pass of the recording.
    """
    rows = []
    for recording, beat_fit, part in zip(data.recordings, data.beat_fits, data.recording_slices, strict=True):
        order = np.arange(1, int(beat_fit.order[~beat_fit.trend].max()) + 1)
        psi = subject.beat_start_phase(recording) + 2 * np.pi * at
        size = 2 * np.exp(-0.5 * (2 * np.pi * WIDTH * order) ** 2)
        if low_passed and recording.low_pass is not None:
            frequency = order * recording.condition.flap_frequency
            size = size * gain(recording.low_pass, sampling_rate(recording), frequency)
        own = np.zeros(len(beat_fit.order))
        own[: 2 * len(order) + 1] = np.concatenate([[1.0], size * np.cos(order * psi), size * np.sin(order * psi)])
        for channel in range(int(beat_fit.used.sum())):
            row = np.zeros(len(data.scale))
            row[part][channel * len(own) : (channel + 1) * len(own)] = own
            rows.append(row)
    return np.array(rows)
