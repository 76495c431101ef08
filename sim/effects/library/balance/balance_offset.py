"""The balance does not show zero where there is no force."""

from __future__ import annotations

from wingfit.sim.effects.contract import Effect, Parameter, Values
from wingfit.sim.effects.ports.observation import Sampling
from wingfit.sim.effects.ports.weights import along_axes


def _observe(sampling: Sampling, values: Values) -> None:
    sampling.added += along_axes(sampling, values["x"], values["z"])[:, None]


EFFECT = Effect(
    name="balance_offset",
    title="Balance zero offset",
    family="measurement",
    port="observation",
    size=tuple(
        Parameter(
            axis, "1", -0.3, 0.3, 0.02, f"force along {axis} that is shown without load, in weights of the vehicle"
        )
        for axis in "xz"
    ),
    source="zero shift of a balance, F' = F + F_0 (AIAA R-091A 2020, Calibration and use of internal strain-gage "
    "balances)",
    signature="a constant force, alike in every condition and at every phase",
    confused_with=("balance_drift", "balance_tilt"),
    observe=_observe,
    observed=("forces",),
)
