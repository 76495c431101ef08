"""The plants that record the blind trials: own equations and integrator, with things in them that a model may miss.

A plant shares no code with the rigs or with wingfit. Each is integrated by the classical Runge-Kutta method with eight
steps for each sample. Laws that the diagnosis knows too have another form here: dry friction is a steep straight line
and not a hyperbolic tangent, radiation and friction act on the plant's own variables.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Rate = Callable[[float, Array], Array]
SUBSTEPS = 8


class Plant(NamedTuple):
    """A plant: what may be hidden, how large at most, and how it is recorded.

    Attributes:
        listed: largest size of each thing that the diagnosis knows too, by the name that it has there.
        unlisted: largest size of each thing that it does not know.
        nominal: centre of each parameter's range, by name.
        interval: s between samples.
        samples: of a recording.
        push: largest input.
        corner: time scale of the input, s.
        start: standard deviation of the initial state.
        run: (parameters, hidden sizes, input of time, initial state, sample times) -> channels [T, C].
    """

    listed: Mapping[str, float]
    unlisted: Mapping[str, float]
    nominal: Mapping[str, float]
    interval: float
    samples: int
    push: float
    corner: float
    start: tuple[float, ...]
    run: Callable[[Mapping[str, float], Mapping[str, float], Callable[[float], float], Array, Array], Array]


def integrated(rate: Rate, start: Array, times: Array) -> Array:
    """States [T, N] at ``times`` [T] by Runge-Kutta steps of fourth order."""
    found, state = [start], start.astype(float)
    for begin, end in pairwise(times):
        h = (end - begin) / SUBSTEPS
        for k in range(SUBSTEPS):
            t = begin + k * h
            a = rate(t, state)
            b = rate(t + h / 2, state + h / 2 * a)
            c = rate(t + h / 2, state + h / 2 * b)
            d = rate(t + h, state + h * c)
            state = state + h / 6 * (a + 2 * b + 2 * c + d)
        found.append(state)
    return np.array(found)


def _sign(rate: float, scale: float) -> float:
    return min(max(rate / scale, -1.0), 1.0)


def _motor(
    p: Mapping[str, float], hidden: Mapping[str, float], push: Callable[[float], float], start: Array, times: Array
) -> Array:
    h = {name: hidden.get(name, 0.0) for name in (*MOTOR.listed, *MOTOR.unlisted)}
    lag = h["low_pass.speed"] or 1.0

    def current(t: float, w: float, heat: float) -> float:
        return (push(t) - p["torque_constant"] * w) / (p["resistance"] * (1.0 + h["warm winding"] * heat))

    def rate(t: float, state: Array) -> Array:
        angle, w, heat, shown = state
        i = current(t, w, heat)
        torque = p["torque_constant"] * i - p["damping"] * w
        torque -= h["dry_friction.shaft"] * _sign(w, 0.8) + h["square_drag.shaft"] * abs(w) * w
        torque -= h["cogging"] * np.sin(3.0 * angle) + h["sticking"] * _sign(w, 0.8) * np.exp(-((w / 15.0) ** 2))
        return np.array([w, torque / p["inertia"], i * i, (w - shown) / lag])

    states = integrated(rate, np.array([0.0, start[0], 0.0, start[0]]), times)
    amperes = np.array([current(t, w, heat) for t, (_, w, heat, _) in zip(times, states, strict=True)])
    speed = states[:, 3] if h["low_pass.speed"] else states[:, 1]
    return np.stack([speed, amperes + h["offset.current"]], axis=1)


def _circuit(
    p: Mapping[str, float], hidden: Mapping[str, float], push: Callable[[float], float], start: Array, times: Array
) -> Array:
    h = {name: hidden.get(name, 0.0) for name in (*CIRCUIT.listed, *CIRCUIT.unlisted)}

    def rate(t: float, state: Array) -> Array:
        q, i, second, slope = state
        volts = push(t) - p["resistance"] * i - q / p["capacitance"] - h["cubic_stiffness.loop"] * q**3
        volts -= h["dry_friction.loop"] * _sign(i, 4e-4) + h["square_stiffness.loop"] * q * q
        volts -= h["second loop"] * 400.0 * (q - second)
        coil = p["inductance"] / (1.0 + (h["saturating coil"] * i) ** 2)
        return np.array([i, volts / coil, slope, 9e5 * (q - second) - 60.0 * slope])

    states = integrated(rate, np.array([start[0], 0.0, start[0], 0.0]), times)
    volts = states[:, 0] / p["capacitance"]
    limit = np.abs(volts).max() * (1.0 - h["saturation.voltage"])
    return np.clip(volts, -limit, limit)[:, None]


def _block(
    p: Mapping[str, float], hidden: Mapping[str, float], push: Callable[[float], float], start: Array, times: Array
) -> Array:
    h = {name: hidden.get(name, 0.0) for name in (*BLOCK.listed, *BLOCK.unlisted)}

    def rate(t: float, state: Array) -> Array:
        block, shell, sensor = state
        across = p["conductance"] * (block - shell)
        kelvin = 293.15 + shell
        lost = p["loss"] * shell + h["radiation"] * 5.670374e-8 * 0.02 * (kelvin**4 - 293.15**4)
        lost += h["free_convection"] * np.sign(shell) * abs(shell) ** 1.25
        heat = (push(t) + h["offset.heater"]) * (1.0 - h["fading heater"] * block / 100.0)
        capacity = p["capacity"] * (1.0 + h["melting"] * np.exp(-(((block - 45.0) / 6.0) ** 2)))
        lag = h["low_pass.block"] or 1.0
        return np.array([(heat - across) / capacity, (across - lost) / p["shell_capacity"], (block - sensor) / lag])

    states = integrated(rate, np.array([start[0], start[1], start[0]]), times)
    block = states[:, 2] if h["low_pass.block"] else states[:, 0]
    return np.stack([block, states[:, 1]], axis=1)


def _two_masses(
    p: Mapping[str, float], hidden: Mapping[str, float], push: Callable[[float], float], start: Array, times: Array
) -> Array:
    h = {name: hidden.get(name, 0.0) for name in (*TWO_MASSES.listed, *TWO_MASSES.unlisted)}

    def rate(t: float, state: Array) -> Array:
        x1, x2, v1, v2 = state
        s, v = x2 - x1, v2 - v1
        gap = h["play.joint"]
        stiffness = p["stiffness"] * (1.0 + h["softening with time"] * t / times[-1])
        pull = stiffness * (max(s - gap, 0.0) + min(s + gap, 0.0)) + p["damping"] * v
        pull += h["dry_friction.joint"] * _sign(v, 4e-3) + h["cubic_stiffness.joint"] * s**3
        wall = h["wall"] * max(x1 - 0.05, 0.0) ** 1.5
        return np.array([v1, v2, push(t) - 20.0 * x1 - p["drag"] * v1 + pull - wall, -pull / 0.5])

    states = integrated(rate, np.array([start[0], start[1], 0.0, 0.0]), times)
    first, second = states[:, 0], states[:, 1]
    return np.stack([first + h["crosstalk.first.second"] * second, second], axis=1)


MOTOR = Plant(
    {"dry_friction.shaft": 0.012, "square_drag.shaft": 1.2e-6, "low_pass.speed": 0.03, "offset.current": 0.3},
    {"cogging": 0.02, "warm winding": 0.08, "sticking": 0.03},
    {"torque_constant": 0.05, "resistance": 2.0, "inertia": 1e-4, "damping": 1e-4},
    0.01, 250, 6.0, 0.35, (5.0,), _motor,
)  # fmt: skip
CIRCUIT = Plant(
    {"cubic_stiffness.loop": 4e12, "dry_friction.loop": 0.7, "square_stiffness.loop": 4e8, "saturation.voltage": 0.3},
    {"saturating coil": 25.0, "second loop": 60.0},
    {"inductance": 0.1, "resistance": 20.0, "capacitance": 1e-5},
    1e-4, 300, 5.0, 3e-3, (2e-5,), _circuit,
)  # fmt: skip
BLOCK = Plant(
    {"radiation": 0.9, "free_convection": 0.12, "low_pass.block": 25.0, "offset.heater": 4.0},
    {"melting": 1.5, "fading heater": 0.5},
    {"capacity": 200.0, "shell_capacity": 60.0, "conductance": 1.0, "loss": 0.4},
    4.0, 240, 40.0, 180.0, (8.0, 4.0), _block,
)  # fmt: skip
TWO_MASSES = Plant(
    {"play.joint": 0.008, "dry_friction.joint": 0.8, "cubic_stiffness.joint": 4e5, "crosstalk.first.second": 0.1},
    {"softening with time": -0.4, "wall": 400.0},
    {"stiffness": 300.0, "damping": 0.8, "drag": 0.8},
    0.015, 280, 4.0, 0.25, (0.03, 0.03), _two_masses,
)  # fmt: skip
PLANTS = {"motor": MOTOR, "circuit": CIRCUIT, "block": BLOCK, "two masses": TWO_MASSES}
