"""What separates two explanations under a condition: not what a rival's genes would make up for."""

from __future__ import annotations

import numpy as np

from tests.diagnosis.pendulum_rig import Pendulum, PendulumRig, at, recorded
from wingfit.calibration.estimates.linearised import free_genes, unit_at
from wingfit.calibration.problem import Problem, base_genome
from wingfit.diagnosis.evidence.fit import Fit, thoroughly
from wingfit.diagnosis.evidence.whitened_recordings import Stack
from wingfit.diagnosis.verdict.next_experiment import unlike
from wingfit.workers.in_process import InProcessEvaluator

RIG, EVALUATOR = PendulumRig(), InProcessEvaluator()
TRUTH = {"stiffness": 0.2, "damping": 4e-3, "inertia": 1e-3}


def fitted(stack: Stack) -> Fit:
    """The pendulum fitted from TRUTH; ``gain`` free as well, which is no gene of what is compared with."""
    model = Pendulum(("gain",))
    asked = Problem(model, stack.recordings, model.searched, base_genome(model, TRUTH), stack.axes)
    genes = free_genes(asked)
    *_, found = thoroughly(
        RIG, stack, asked, EVALUATOR, unit_at(genes, np.array([asked.base[g.name] for g in genes])), 15
    )
    return found


def apart(frequencies: tuple[float, ...], then: float, **lacking: float) -> tuple[float, float]:
    """Of what is ``lacking`` at ``then`` (Hz): what a pendulum with a gain cannot make up for, and as it was fitted."""
    truth = {**TRUTH, **lacking}
    stack = Stack.of(recorded(truth, noise=2e-4, frequencies=frequencies))
    rival = fitted(stack)
    model = Pendulum(("cubic",)) if lacking else Pendulum()
    genome = np.array([truth[gene.name] for gene in model.genes])
    shell = RIG.shown(model, genome, at(then))
    assert shell is not None
    adapted, plain = (unlike(RIG, stack, genome, shell, rival, EVALUATOR, adapts=adapts) for adapts in (True, False))
    assert adapted is not None
    assert plain is not None
    return adapted, plain


def test_a_rival_meets_a_new_recording_with_other_genes() -> None:
    """At one frequency stiffness and inertia make up for each other, so that another frequency is foretold wrongly."""
    adapted, plain = apart((1.2,), 2.7)
    assert plain > 5.0
    assert adapted < 0.2 * plain


def test_genes_that_are_told_do_not_adapt() -> None:
    """About resonance a spring that hardens is foretold by no gene that the other frequencies have fixed."""
    adapted, plain = apart((1.2, 1.7, 2.0, 2.7, 3.4), 2.3, **{"cubic.k3": 0.3})
    assert plain > 5.0
    assert 0.5 * plain < adapted <= plain
