"""The shapes that annotations of a diagnosis name are checked in tests."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from tests.diagnosis.pendulum_rig import PendulumRig, recorded
from wingfit.diagnosis.evidence.context import FitContext
from wingfit.diagnosis.evidence.nominal import fit_nominal
from wingfit.diagnosis.evidence.whitened_recordings import WhitenedData
from wingfit.workers.in_process import InProcessEvaluator


def test_a_wrong_shape_is_caught() -> None:
    rig, data = PendulumRig(), WhitenedData.of(recorded({}))
    fit = next(fit_nominal(FitContext(rig, data, InProcessEvaluator()), rig.model.searched, {}))
    with pytest.raises(TypeCheckError, match="jacobian"):
        replace(fit, jacobian=fit.jacobian.T)
    with pytest.raises(TypeCheckError, match="coefficients"):
        data.excess(np.array([fit.coefficients]))
