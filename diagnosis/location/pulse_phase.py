"""Estimate the instant of a missing force: that of the pulse that best explains the residual, the nominal genes free.

The residual of a fit is not the missing force: genes have absorbed a part, and a low-pass has spread the rest over the
beat. So a short pulse is placed at every instant of the beat, with an independent size in every channel of every
recording; the force acts where the pulse explains most, after the part that the genes can explain is projected out of
both. A matched filter (Turin, IRE Transactions on Information Theory 6, 311, 1960) would low-pass the pulse as well; it
would equally fit the ringing of the filter, and its error is twice as large. The significance of the pulse is tested
with a low-passed one.
"""

from __future__ import annotations

import numpy as np
import scipy

from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import Fit
from wingfit.diagnosis.evidence.intervals import standard_errors
from wingfit.diagnosis.evidence.screen import Nuisance
from wingfit.diagnosis.finding import Interval
from wingfit.diagnosis.subject import beat_subject
from wingfit.inference.score_test import explained
from wingfit.records.array_types import Array, Mask
from wingfit.sim.filtering import gain, sampling_rate

INSTANTS = 144
WIDTH = 0.015  # of a beat, standard deviation
MIN_EXPLAINED = 0.1  # of the residual: a pulse that explains less has no instant
FALSE_ALARM_PROBABILITY = 0.01  # that noise alone explains as much at any instant


def locate_pulse(context: FitContext, fit: Fit) -> Interval | None:
    """Return the instant (beats) of the pulse that explains most of the residual of ``fit``; None if not significant.

    The interval contains the instants at which the pulse would explain nearly as much, given the model error.
    """
    data, nuisance = context.data, Nuisance(context.data, fit)
    residual, whitened = nuisance.residual, data.whiten(fit.coefficients)
    phase = np.arange(INSTANTS) / INSTANTS
    gains = np.array([explained(nuisance.project_out(_pulses(context, at)), residual) for at in phase])
    best = int(np.argmax(gains))
    low_passed_pulse = _pulses(context, phase[best], low_passed=True)
    decrease = explained(nuisance.project_out(low_passed_pulse), residual)
    by_noise = float(scipy.stats.chi2.isf(FALSE_ALARM_PROBABILITY / INSTANTS, len(low_passed_pulse)))
    if decrease < max(MIN_EXPLAINED * float(residual @ residual), by_noise):
        return None
    beyond = max(float(whitened @ whitened) - decrease - len(whitened), 0.0)
    near = gains[best] - gains < standard_errors() ** 2 * (1.0 + beyond / data.effective_samples)
    distance = (phase - phase[best] + 0.5) % 1.0 - 0.5
    low, high = (_extent(near, distance, sign) for sign in (-1, 1))
    return Interval(float(phase[best]), float(phase[best] - low), float(phase[best] + high))


def _extent(near: Mask, distance: Array, sign: int) -> float:
    """Return how far (beats) the instants ``near`` [N] extend to one side without a gap, plus half an instant.

    ``distance`` [N] (beats) from the best instant; ``sign``: 1 for the later side, -1 for the earlier.
    """
    order = np.argsort(np.where(sign * distance >= 0, sign * distance, np.inf))[: INSTANTS // 2]
    ends = np.flatnonzero(~near[order])
    return float(sign * distance[order[(ends[0] if len(ends) else len(order)) - 1]]) + 0.5 / INSTANTS


def _pulses(context: FitContext, at: float, *, low_passed: bool = False) -> Array:
    """Return the coefficients [channels, D] of a pulse at phase ``at`` (beats), a row for each recorded channel.

    Each pulse is in one channel of one recording only; it is sharp, or ``low_passed`` like the recording.
    """
    data, rows = context.data, []
    for recording, beat_fit, part in zip(data.beat_recordings, data.beat_fits, data.recording_slices, strict=True):
        order = np.arange(1, int(beat_fit.order[~beat_fit.trend].max()) + 1)
        psi = beat_subject(context.subject).beat_start_phase(recording) + 2 * np.pi * at
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
    return data.without_errors(np.array(rows))
