"""Models of other engines in the user's own function: MuJoCo and Exudyn, against closed forms and Run.integrate."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.rigs.doors.oscillator import CHANNELS, NOMINAL, dataset, largest_difference, oscillate, rig, run
from wingfit.diagnosis.rig_check import check_rig
from wingfit.records import Channel, Gene, Series, SeriesDataset
from wingfit.records.array_types import Array
from wingfit.rigs.ports import Port
from wingfit.rigs.rig import Rig
from wingfit.rigs.rig_model import RigModel
from wingfit.rigs.run import Run

needs_mujoco = pytest.mark.skipif(importlib.util.find_spec("mujoco") is None, reason="pip install mujoco")
needs_exudyn = pytest.mark.skipif(importlib.util.find_spec("exudyn") is None, reason="pip install 'wingfit[peers]'")

PENDULUM = """
<mujoco>
  <option timestep="0.001" integrator="RK4" gravity="0 0 -9.81"><flag contact="disable"/></option>
  <worldbody>
    <body>
      <joint name="hinge" type="hinge" axis="0 1 0" damping="0.01"/>
      <inertial pos="0 0 -0.4" mass="0.5" diaginertia="1e-4 1e-4 1e-4"/>
    </body>
  </worldbody>
</mujoco>
"""
STEP = 0.001  # s, of the engines
INERTIA = 0.5 * 0.4**2 + 1e-4  # kg m^2, about the hinge
GENES = (Gene("damping", "N*m*s/rad", 0.01, 0.001, 0.05, "log", "damping of the hinge"),)
START = Gene("start", "rad", 0.4, -1.0, 1.0, "linear", "initial angle")
HINGE = Port("hinge", "rad", "N*m", 1.0, 5.0, 0.5)
TIMES = np.linspace(0.0, 2.0, 101)


def swing(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """Angle (rad) of the pendulum in MuJoCo, with the laws at its hinge as an applied torque."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(PENDULUM)
    model.dof_damping[0] = genes["damping"]
    data = mujoco.MjData(model)
    data.qpos[0] = genes["start"]
    angle = np.empty(len(run.times))
    for k, time in enumerate(run.times):
        while data.time < time - run.times[0] - 0.5 * STEP:
            data.qfrc_applied[0] = run.force("hinge", float(data.qpos[0]), float(data.qvel[0]))
            mujoco.mj_step(model, data)
        angle[k] = data.qpos[0]
    return {"angle": angle}


def integrated(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """The same pendulum as a differential equation."""

    def rate(_: float, state: Array) -> list[float]:
        angle, speed = state
        torque = -0.5 * 9.81 * 0.4 * np.sin(angle) - genes["damping"] * speed + run.force("hinge", angle, speed)
        return [speed, torque / INERTIA]

    return {"angle": run.integrate(rate, [genes["start"], 0.0])[0]}


def pendulum(simulate: Any) -> tuple[Rig, SeriesDataset]:
    """The rig with ``simulate``, and a recording of it."""
    angle = Channel("angle", "rad", 1e-3)
    truth = integrated({"damping": 0.012, "start": 0.5}, Run("first", TIMES, {}, {}, TIMES))["angle"]
    one = Series("first", TIMES, (angle,), truth[:, None])
    made = Rig("pendulum", GENES, {"angle": "rad"}, simulate, (), (START,), ports=(HINGE,))
    return made, SeriesDataset("swings", "pendulum", (one,), (angle,))


@needs_mujoco
@pytest.mark.parametrize("law", ["", "viscous.hinge", "cubic_stiffness.hinge"])
def test_a_mujoco_model_gives_what_the_equation_gives(law: str) -> None:
    seen = []
    for simulate in (swing, integrated):
        made, data = pendulum(simulate)
        model = RigModel(made, data.recordings, (law,) if law else ())
        genome = [0.02, 0.6] + ([0.05] if law else [])
        found = model.observe(genome, data.recordings[0])
        assert found.reasons == (None,)
        seen.append(found.channels[0, :, 0])
    # MuJoCo integrates its own forces with fourth order, but holds an applied torque over a step.
    assert np.abs(seen[0] - seen[1]).max() < (1e-3 if law else 1e-7)


@needs_mujoco
def test_a_mujoco_model_keeps_the_contract_but_for_laws_with_a_memory() -> None:
    made, data = pendulum(swing)
    outcomes = {one.name: (one.outcome, one.words) for one in check_rig(made, data)}
    assert {outcome for outcome, _ in outcomes.values()} == {"pass"}, outcomes
    model = RigModel(made, data.recordings, ("hysteresis.hinge",))
    found = model.observe([0.02, 0.6, 0.1, 0.1], data.recordings[0])
    assert found.reasons[0] is not None
    assert "hysteresis.hinge has a memory: call force within Run.integrate" in found.reasons[0]


def vibrate(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """Position (m) and speed (m/s) of the oscillator in Exudyn, by the implicit trapezoidal rule."""
    import exudyn
    from exudyn import itemInterface as items  # noqa: N813

    system = exudyn.SystemContainer()
    bodies = system.AddSystem()
    node = bodies.AddNode(items.Node1D(referenceCoordinates=[0.0], initialCoordinates=[genes["start"]]))
    bodies.AddObject(items.Mass1D(nodeNumber=node, mass=run.setting("mass")))
    ground = bodies.AddNode(items.NodePointGround())
    moving = bodies.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=0))
    fixed = bodies.AddMarker(items.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    spring = items.CoordinateSpringDamper(
        markerNumbers=[fixed, moving], stiffness=genes["stiffness"], damping=genes["damping"]
    )
    bodies.AddObject(spring)
    begin = float(run.times[0])

    def force(_: Any, t: float, load: float) -> float:  # noqa: ARG001
        return float(run.input("force", begin + t))

    bodies.AddLoad(items.LoadCoordinate(markerNumber=moving, load=1.0, loadUserFunction=force))
    sensors = [
        bodies.AddSensor(items.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True))
        for kind in (exudyn.OutputVariableType.Coordinates, exudyn.OutputVariableType.Coordinates_t)
    ]
    bodies.Assemble()
    settings = exudyn.SimulationSettings()
    duration = float(run.times[-1] - run.times[0])
    settings.timeIntegration.endTime = duration
    settings.timeIntegration.numberOfSteps = round(duration / STEP)
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = STEP
    settings.timeIntegration.generalizedAlpha.spectralRadius = 1.0
    bodies.SolveDynamic(settings)
    stored = [np.asarray(bodies.GetSensorStoredData(sensor)) for sensor in sensors]
    position, speed = (np.interp(run.times - begin, one[:, 0], one[:, 1]) for one in stored)
    return {"position": position, "speed": speed}


@needs_exudyn
def test_an_exudyn_model_gives_the_closed_form() -> None:
    assert largest_difference(vibrate) < 2e-4
    free = replace(run(), inputs={"force": np.zeros(101)})
    found, exact = vibrate(NOMINAL, free), oscillate(NOMINAL, free)
    assert all(np.allclose(found[name], exact[name], rtol=0.0, atol=2e-4) for name in CHANNELS)


@needs_exudyn
def test_an_exudyn_model_keeps_the_contract_of_a_rig() -> None:
    outcomes = {one.name: (one.outcome, one.words) for one in check_rig(rig(vibrate), dataset())}
    assert {outcome for outcome, _ in outcomes.values()} == {"pass"}, outcomes
