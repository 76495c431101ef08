"""The separation of two hypotheses under a condition: only the part that a rival's genes cannot compensate."""

from __future__ import annotations

import numpy as np

from tests.diagnosis.pendulum_rig import Pendulum, PendulumRig, at, recorded
from wingfit.calibration.estimates.linearised import free_genes, unit_at
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.fit import Fit, gauss_newton_fit
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.diagnosis.verdict.next_experiment import separation
from wingfit.workers.in_process import InProcessEvaluator

RIG, EVALUATOR = PendulumRig(), InProcessEvaluator()
TRUTH = {"stiffness": 0.2, "damping": 4e-3, "inertia": 1e-3}


def fitted_pendulum(data: WhitenedData) -> Fit:
    """The pendulum with a free ``gain`` fitted from TRUTH; the first hypothesis has no gain."""
    model = Pendulum(("gain",))
    problem = Problem(model, data.recordings, model.searched, base_genome(model, TRUTH), data.axes)
    genes = free_genes(problem)
    start = unit_at(genes, np.array([problem.base[gene.name] for gene in genes]))
    *_, found = gauss_newton_fit(FitContext(RIG, data, EVALUATOR), problem, start, 15)
    return found


def apart(frequencies: tuple[float, ...], then: float, **missing: float) -> tuple[float, float]:
    """Separation at ``then`` (Hz) of a pendulum with a gain, with adapted and with fixed genes, from the truth."""
    truth = {**TRUTH, **missing}
    data = WhitenedData.of(recorded(truth, noise=2e-4, frequencies=frequencies))
    rival = fitted_pendulum(data)
    model = Pendulum(("cubic",)) if missing else Pendulum()
    genome = np.array([truth[gene.name] for gene in model.genes])
    recording = RIG.simulated_recording(model, genome, at(then))
    assert recording is not None
    context = FitContext(RIG, data, EVALUATOR)
    adapted, plain = (separation(context, genome, recording, rival, adapt=adapt) for adapt in (True, False))
    assert adapted is not None
    assert plain is not None
    return adapted, plain


def test_a_rival_adapts_its_genes_to_a_new_recording() -> None:
    """At one frequency stiffness and inertia compensate each other, so another frequency is predicted wrongly."""
    adapted, plain = apart((1.2,), 2.7)
    assert plain > 5.0
    assert adapted < 0.2 * plain


def test_identified_genes_do_not_adapt() -> None:
    """Near resonance no gene fixed by the other frequencies imitates a hardening spring."""
    adapted, plain = apart((1.2, 1.7, 2.0, 2.7, 3.4), 2.3, **{"cubic.k3": 0.3})
    assert plain > 5.0
    assert 0.5 * plain < adapted <= plain
