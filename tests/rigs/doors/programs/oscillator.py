"""A program of someone else: reads requests, integrates the oscillator with fourth order, and answers.

Arguments: a way to misbehave, or "well"; "lines" answers each line, else there is one request.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from typing import Any

PARTS = 20  # steps between two times


def simulated(request: dict[str, Any]) -> dict[str, list[float]]:
    """Position (m) and speed (m/s) at the times of the request."""
    genes, times, force, mass = (
        request["genes"],
        request["times"],
        request["inputs"]["force"],
        request["settings"]["mass"],
    )
    assert request["input_times"] == times

    def rate(x: float, v: float, u: float) -> tuple[float, float]:
        return v, (u - genes["damping"] * v - genes["stiffness"] * x) / mass

    x, v = genes["start"], 0.0
    positions, speeds = [x], [v]
    for k in range(len(times) - 1):
        h = (times[k + 1] - times[k]) / PARTS
        slope = (force[k + 1] - force[k]) / PARTS
        for j in range(PARTS):
            u = force[k] + slope * j
            a = rate(x, v, u)
            b = rate(x + h / 2 * a[0], v + h / 2 * a[1], u + slope / 2)
            c = rate(x + h / 2 * b[0], v + h / 2 * b[1], u + slope / 2)
            d = rate(x + h * c[0], v + h * c[1], u + slope)
            x += h / 6 * (a[0] + 2 * b[0] + 2 * c[0] + d[0])
            v += h / 6 * (a[1] + 2 * b[1] + 2 * c[1] + d[1])
        positions.append(x)
        speeds.append(v)
    return {"position": positions, "speed": speeds}


def answer(way: str, request: dict[str, Any]) -> str:  # noqa: C901  a way to misbehave for each case
    """The line that answers ``request``; it misbehaves where the stiffness is above 30 N/m."""
    channels = simulated(request)
    found: dict[str, Any] = {"id": request["id"], "channels": channels}
    if request["genes"]["stiffness"] <= 30.0:
        return json.dumps(found)
    match way:
        case "exit":
            print("first line\nthe spring breaks", file=sys.stderr)
            sys.exit(3)
        case "quit":
            sys.exit(0)
        case "signal":
            os.abort()
        case "hang":
            print("waiting for a child", file=sys.stderr, flush=True)
            subprocess.run(["sleep", "100"], check=False)
        case "slow":
            time.sleep(0.5)
        case "error":
            found = {"id": request["id"], "error": "the spring is too stiff"}
        case "nan":
            channels["speed"][7] = float("nan")
        case "null":
            channels["speed"][7] = None  # type: ignore[call-overload]
        case "shape":
            channels["speed"].pop()
        case "nested":
            channels["speed"] = [channels["speed"]]  # type: ignore[list-item]
        case "text":
            channels["speed"][0] = "fast"  # type: ignore[call-overload]
        case "channel":
            channels["velocity"] = channels.pop("speed")
        case "list":
            return json.dumps(list(channels.values()))
        case "banner":
            return "Welcome to the simulator\n" + json.dumps(found)
        case "id":
            found["id"] -= 1
        case "twice":
            return json.dumps(found) + "\n" + json.dumps(found)
        case "chatty":
            sys.stderr.write("step\n" * 200_000)
    return json.dumps(found)


def main() -> None:
    """Answer one request, or one for each line."""
    way, *lines = sys.argv[1:]
    if not lines:
        print(answer(way, json.load(sys.stdin)))
        return
    for line in sys.stdin:
        print(answer(way, json.loads(line)), flush=True)


if __name__ == "__main__":
    main()
