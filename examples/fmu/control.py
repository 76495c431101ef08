"""Hold the lift of a calibrated vehicle, exported as an FMU, by its flap frequency: FMPy and an integral controller.

``python examples/fmu/control.py delfly.fmu --lift-n 0.13``
"""

from __future__ import annotations

import argparse
import json
import shutil
import zipfile

import fmpy
from fmpy.fmi3 import FMU3Slave

GAIN = 15.0  # Hz per newton and beat: a third of an error of the lift is corrected within a beat
STEPS = 60  # communication steps per beat, at the highest frequency
GUST_AT = 0.5  # part of the time after which the airspeed changes


def controlled(path: str, lift: float, seconds: float, gust: float) -> list[tuple[float, float, float]]:
    """Return time (s), flap frequency (Hz) and mean lift (N) of every beat, while the controller holds ``lift`` (N).

    The airspeed becomes ``gust`` (m/s) at half of the time.
    """
    low, high = fitted_range(path, "flap_frequency")
    description, folder = fmpy.read_model_description(path), fmpy.extract(path)
    reference = {one.name: one.valueReference for one in description.modelVariables}
    fmu = FMU3Slave(
        guid=description.guid, unzipDirectory=folder, modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="vehicle",
    )  # fmt: skip
    fmu.instantiate()
    frequency = 0.5 * (low + high)
    fmu.setFloat64([reference["flap_frequency"]], [frequency])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    beats, time, dt, mean, before = [], 0.0, 1.0 / (high * STEPS), 0.0, 0.0
    for step in range(int(seconds / dt)):
        if step == int(GUST_AT * seconds / dt):
            fmu.setFloat64([reference["airspeed"]], [gust])
        fmu.doStep(time, dt)
        time = (step + 1) * dt
        now, phase = fmu.getFloat64([reference["lift"], reference["beat_phase"]])
        if phase < before:  # a beat has ended within the step
            mean += now * (1.0 - before)
            beats.append((time, frequency, mean))
            frequency = min(max(frequency + GAIN * (lift - mean), low), high)
            fmu.setFloat64([reference["flap_frequency"]], [frequency])
            mean, before = 0.0, 0.0
        mean, before = mean + now * (phase - before), phase
    fmu.terminate()
    fmu.freeInstance()
    shutil.rmtree(folder)
    return beats


def fitted_range(path: str, name: str) -> tuple[float, float]:
    """Return the range of an input in which the model was fitted; the FMU refuses other values."""
    with zipfile.ZipFile(path) as archive:
        ranges = json.loads(archive.read("resources/model.json"))["ranges"]
    found = next(one for one in ranges if one["name"] == name)
    return float(found["low"]), float(found["high"])


def main() -> None:
    """Print what the controller does, every tenth beat."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("fmu", help="a vehicle that wingfit exported")
    parser.add_argument("--lift-n", type=float, default=0.13, help="lift to hold, N (0.13)")
    parser.add_argument("--seconds", type=float, default=4.0, help="time to simulate, s (4)")
    parser.add_argument("--gust", type=float, default=0.5, help="airspeed in the second half, m/s (0.5)")
    given = parser.parse_args()
    beats = controlled(given.fmu, given.lift_n, given.seconds, given.gust)
    print("time s  frequency Hz  lift N")
    for time, frequency, lift in beats[::10]:
        print(f"{time:6.2f}  {frequency:12.2f}  {lift:6.4f}")


if __name__ == "__main__":
    main()
