"""A pendulum in Exudyn as a rig for wingfit: it simulates the recordings of examples/pendulum. See docs/rigs.md.

Exudyn integrates its model itself, by Runge-Kutta steps of 2 ms; the laws at the port act on the joint. So laws with a
memory cannot be simulated. Needs ``pip install exudyn``; run

    wingfit diagnose examples/pendulum --local --rig examples/exudyn_pendulum/rig.py
"""

from dataclasses import replace
from pathlib import Path

import exudyn
import numpy as np
from exudyn import itemInterface as items  # noqa: N813

from wingfit.rigs.load import load_rig

GRAVITY, MASS, STEP = 9.81, 1.0, 0.002  # m/s^2, kg, s; the mass cancels in a free swing


def simulate(genes, run):
    """Return the angle (rad) at run.times for one recording; ``genes`` has the values of all genes by name."""
    length = GRAVITY / genes["gravity"]
    inertia = MASS * length**2

    def torque(_system, _time, _item, angle, speed):
        return inertia * np.array([run.force("pivot", angle[0], speed[0]) - genes["damping"] * speed[0]])

    container = exudyn.SystemContainer()
    system = container.AddSystem()
    start = {"initialCoordinates": [genes["angle0"]], "initialCoordinates_t": [genes["speed0"]]}
    node = system.AddNode(items.NodeGenericODE2(referenceCoordinates=[0.0], numberOfODE2Coordinates=1, **start))
    system.AddObject(
        items.ObjectKinematicTree(
            nodeNumber=node,
            gravity=[0.0, -GRAVITY, 0.0],
            jointTypes=[exudyn.JointType.RevoluteZ],
            linkParents=[-1],
            jointTransformations=exudyn.Matrix3DList([np.eye(3)]),
            jointOffsets=exudyn.Vector3DList([[0.0, 0.0, 0.0]]),
            linkInertiasCOM=exudyn.Matrix3DList([np.zeros((3, 3))]),
            linkCOMs=exudyn.Vector3DList([[0.0, -length, 0.0]]),
            linkMasses=[MASS],
            forceUserFunction=torque,
        )
    )
    kind = exudyn.OutputVariableType.Coordinates
    sensor = system.AddSensor(items.SensorNode(nodeNumber=node, outputVariableType=kind, storeInternal=True))
    system.Assemble()
    settings = exudyn.SimulationSettings()
    duration = float(run.times[-1] - run.times[0])
    settings.timeIntegration.endTime = duration
    settings.timeIntegration.numberOfSteps = int(np.ceil(duration / STEP))
    settings.timeIntegration.verboseMode = 0
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = duration / settings.timeIntegration.numberOfSteps
    system.SolveDynamic(settings, solverType=exudyn.DynamicSolverType.RK44)
    times, angles = np.asarray(system.GetSensorStoredData(sensor)).T
    return {"angle": np.interp(run.times - run.times[0], times, angles)}


# Genes, channels and the port are those of the rig with equations of its own; only the simulation is another.
own = load_rig(str(Path(__file__).parents[1] / "pendulum" / "rig.py"))
rig = replace(own, simulate=simulate, description="pendulum in Exudyn with viscous friction", reference="")
