"""The rigs as their users would write them: nominal simulations, ports, and suspects of their own."""

from __future__ import annotations

from collections.abc import Mapping

from wingfit import Gene, Port, Rig, Run, Suspect
from wingfit.records.array_types import Array

AMBIENT = 293.15  # K
STEFAN_BOLTZMANN = 5.670374e-8  # W/(m^2 K^4)
AREA = 0.02  # m^2, of the heated block


def _motor(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """A motor on a voltage: torque constant k, resistance R, inertia J, viscous damping b."""
    k, r = genes["torque_constant"], genes["resistance"]

    def rate(t: float, state: Array) -> tuple[float, float]:
        angle, speed = state
        current = (float(run.input("voltage", t)) - k * speed) / r
        torque = k * current - genes["damping"] * speed + run.force("shaft", angle, speed)
        return speed, torque / genes["inertia"]

    _, speed = run.integrate(rate, [0.0, genes["speed0"]], steps=2)
    return {"speed": speed, "current": (run.input("voltage", run.times) - k * speed) / r}


def _circuit(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """A coil, a resistor and a capacitor in series on a voltage; the voltage of the capacitor is recorded."""

    def rate(t: float, state: Array) -> tuple[float, float]:
        charge, current = state
        voltage = float(run.input("source", t)) - genes["resistance"] * current - charge / genes["capacitance"]
        return current, (voltage + run.force("loop", charge, current)) / genes["inductance"]

    charge, _ = run.integrate(rate, [genes["charge0"], 0.0], steps=2)
    return {"voltage": charge / genes["capacitance"]}


def _block(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """A heated block and its shell, which loses heat to the air; both temperatures above that of the air, K."""

    def rate(t: float, state: Array) -> tuple[float, float]:
        block, shell = state
        across = genes["conductance"] * (block - shell)
        lost = genes["loss"] * shell
        hot = AMBIENT + max(shell, -AMBIENT)
        lost += genes["radiation.emissivity"] * STEFAN_BOLTZMANN * AREA * (hot**4 - AMBIENT**4)
        lost += genes["free_convection.size"] * max(shell, 0.0) ** 1.25
        heat = float(run.input("heater", t))
        return (heat - across) / genes["capacity"], (across - lost) / genes["shell_capacity"]

    block, shell = run.integrate(rate, [genes["block0"], genes["shell0"]], steps=1)
    return {"block": block, "shell": shell}


def _two_masses(genes: Mapping[str, float], run: Run) -> dict[str, Array]:
    """Two masses of 1 kg and 0.5 kg joined by a spring; the first is pushed, and held by a weak spring of 20 N/m."""

    def rate(t: float, state: Array) -> tuple[float, float, float, float]:
        first, second, v1, v2 = state
        stretch, stretching = second - first, v2 - v1
        pull = genes["stiffness"] * stretch + genes["damping"] * stretching - run.force("joint", stretch, stretching)
        outer = float(run.input("push", t)) - 20.0 * first - genes["drag"] * v1
        return v1, v2, outer + pull, -pull / 0.5

    found = run.integrate(rate, [genes["first0"], genes["second0"], 0.0, 0.0], steps=2)
    return {"first": found[0], "second": found[1]}


RADIATION = Suspect(
    "radiation",
    "thermal radiation of the shell",
    genes=(Gene("radiation.emissivity", "1", 0.0, -0.2, 1.5),),
    source="Stefan 1879; Boltzmann 1884",
)
FREE_CONVECTION = Suspect(
    "free_convection",
    "free convection of the shell",
    genes=(Gene("free_convection.size", "W/K^1.25", 0.0, -0.1, 0.3),),
    source="Churchill and Chu 1975",
)

RIGS = {
    "motor": Rig(
        name="motor",
        genes=(
            Gene("torque_constant", "N m/A", 0.05, 0.02, 0.12, "log"),
            Gene("resistance", "ohm", 2.0, 0.7, 6.0, "log"),
            Gene("inertia", "kg m^2", 1e-4, 3e-5, 3e-4, "log"),
            Gene("damping", "N m s", 1e-4, 1e-5, 1e-3, "log"),
        ),
        recording_genes=(Gene("speed0", "rad/s", 0.0, -30.0, 30.0),),
        channels={"speed": "rad/s", "current": "A"},
        inputs={"voltage": "V"},
        ports=(Port("shaft", "rad", "N m", coordinate=200.0, rate=150.0, force=0.06),),
        simulate=_motor,
    ),
    "circuit": Rig(
        name="circuit",
        genes=(
            Gene("inductance", "H", 0.1, 0.03, 0.3, "log"),
            Gene("resistance", "ohm", 20.0, 4.0, 100.0, "log"),
            Gene("capacitance", "F", 1e-5, 3e-6, 3e-5, "log"),
        ),
        recording_genes=(Gene("charge0", "C", 0.0, -1e-4, 1e-4),),
        channels={"voltage": "V"},
        inputs={"source": "V"},
        ports=(Port("loop", "C", "V", coordinate=1e-4, rate=0.06, force=8.0),),
        simulate=_circuit,
    ),
    "block": Rig(
        name="block",
        genes=(
            Gene("capacity", "J/K", 200.0, 60.0, 600.0, "log"),
            Gene("shell_capacity", "J/K", 60.0, 20.0, 200.0, "log"),
            Gene("conductance", "W/K", 1.0, 0.3, 3.0, "log"),
            Gene("loss", "W/K", 0.4, 0.1, 1.2, "log"),
        ),
        recording_genes=(Gene("block0", "K", 0.0, -20.0, 120.0), Gene("shell0", "K", 0.0, -20.0, 120.0)),
        channels={"block": "K", "shell": "K"},
        inputs={"heater": "W"},
        suspects=(RADIATION, FREE_CONVECTION),
        simulate=_block,
    ),
    "two masses": Rig(
        name="two masses",
        genes=(
            Gene("stiffness", "N/m", 300.0, 100.0, 900.0, "log"),
            Gene("damping", "N s/m", 0.8, 0.1, 5.0, "log"),
            Gene("drag", "N s/m", 0.8, 0.1, 5.0, "log"),
        ),
        recording_genes=(Gene("first0", "m", 0.0, -0.2, 0.2), Gene("second0", "m", 0.0, -0.2, 0.2)),
        channels={"first": "m", "second": "m"},
        inputs={"push": "N"},
        ports=(Port("joint", "m", "N", coordinate=0.03, rate=0.6, force=10.0, stiffness="stiffness"),),
        simulate=_two_masses,
    ),
}
