"""A pendulum in MuJoCo as a rig for wingfit: it simulates the recordings of examples/pendulum. See docs/rigs.md.

MuJoCo computes the acceleration, and Run.integrate integrates it with its error control, so that all laws at the port
work, those with a memory too. Needs ``pip install mujoco``; run

    wingfit diagnose examples/pendulum --local --rig examples/mujoco_pendulum/rig.py
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import mujoco

from wingfit.rigs.load import load_rig

GRAVITY, MASS = 9.81, 1.0  # m/s^2, kg: the mass cancels in a free swing
MODEL = """
<mujoco>
  <option gravity="0 0 -9.81"><flag contact="disable"/></option>
  <worldbody>
    <body>
      <joint name="pivot" type="hinge" axis="0 1 0"/>
      <inertial pos="0 0 -1" mass="1" diaginertia="1e-9 1e-9 1e-9"/>
    </body>
  </worldbody>
</mujoco>
"""


@cache
def engine():
    """Return the model and its state, once for each process."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    return model, mujoco.MjData(model)


def simulate(genes, run):
    """Return the angle (rad) at run.times for one recording; ``genes`` has the values of all genes by name."""
    model, data = engine()
    length = GRAVITY / genes["gravity"]
    inertia = MASS * length**2
    model.body_ipos[1, 2] = -length
    model.dof_damping[0] = genes["damping"] * inertia
    mujoco.mj_setConst(model, data)  # what MuJoCo derives from the inertia

    def rate(_, state):
        data.qpos[0], data.qvel[0] = state
        data.qfrc_applied[0] = inertia * run.force("pivot", *state)
        mujoco.mj_forward(model, data)
        return data.qvel[0], data.qacc[0]

    angle, _ = run.integrate(rate, [genes["angle0"], genes["speed0"]])
    return {"angle": angle}


# Genes, channels and the port are those of the rig with equations of its own; only the simulation is another.
own = load_rig(str(Path(__file__).parents[1] / "pendulum" / "rig.py"))
rig = replace(own, simulate=simulate, description="pendulum in MuJoCo with viscous friction", reference="")
