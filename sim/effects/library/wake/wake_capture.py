"""Effect: after each reversal the wing meets the air that its previous stroke set in motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, effect_of_air
from wingfit.sim.effects.ports.vehicle import VehicleScene, deferred
from wingfit.sim.effects.ports.wing import WingScene
from wingfit.sim.kernels import LANES
from wingfit.sim.kernels.arrays import CHORD_X, MEAN_CHORD, NORMAL_X, SPEED, STREAM_C, STREAM_N
from wingfit.sim.kernels.lanes.vector import greatest, least, load, load1, store
from wingfit.sim.kernels.laws import BEFORE, strip_port
from wingfit.sim.vehicle.states import overtake

_RECENT = 1 / 64  # of a beat, over which the velocity of a strip is taken
_STILL = 1e-12  # m^2/s^2, keeps the part of the wake that goes along defined where the wing rests
_SCALE = 0.1  # motion of the wing over the motion of the air that causes it


def _meet_wake(scene: VehicleScene, values: Values) -> None:
    """Let the air at a vehicle's wings move at share (w - k u) along the flapping direction.

    u = r zeta' is the velocity of the wing (flap angle zeta) and w that of its wake (m/s), which follows the wing with
    delay: w' = V / (chords c) (u - w), with the speed V of the flow and the chord c; share and chords are the effect's
    parameters. k, in 0 to 1, makes k u the part of w that lies between 0 and u: air that the wing has just set in
    motion is no gust for it. The air is thus at rest at a start from rest (Birch and Dickinson 2003) and in steady
    motion, moves at share (w - u) while the wing slows down, and at share w after the reversal. The memory decays with
    the chords travelled, so that it lasts through the reversal, where the wing hardly moves.
    """
    flow, r = scene.flow, scene.length[:, None, None] * scene.stations.r
    own = np.broadcast_to(scene.angles.flap[:, 1, :, None] * r, flow.speed.shape).copy()
    air = scene.follow(1.0 / (values["chords"][:, None] * scene.chords), own)
    overtake(own, values["share"], air)
    scene.wings.gust(flow, air)


def _law(frame: Any, moment: int) -> None:
    """Move the air of a wing's strips as :func:`_meet_wake` does, in the plane of y and z.

    The four states of a strip are y and z of the wake's velocity w, then y and z of the strip's delayed velocity u,
    which follows its velocity within _RECENT beats: the velocity itself is not known before the flow is computed. k is
    w.u / u^2, limited to 0..1. ``frame`` and ``moment``: see :mod:`wingfit.sim.kernels.laws`.
    """
    port = strip_port(frame)
    for s in range(port.places):
        if moment == BEFORE:
            share = load(port.parameters, 0, s)
            wy, wz = load(port.state, 0, s), load(port.state, 1, s)
            uy, uz = load(port.state, 2, s), load(port.state, 3, s)
            k = least(greatest((wy * uy + wz * uz) / (uy * uy + uz * uz + _STILL), 0.0), 1.0)
            store(port.induced, s, 1, load(port.induced, s, 1) + share * (wy - k * uy))
            store(port.induced, s, 2, load(port.induced, s, 2) + share * (wz - k * uz))
            continue
        along, across = -load(port.flow, s, STREAM_C), -load(port.flow, s, STREAM_N)
        for i in range(3):
            air = load1(port.wind, i) + load(port.induced, s, i)
            along += air * load(port.flow, s, CHORD_X + i)
            across += air * load(port.flow, s, NORMAL_X + i)
        fading = load(port.flow, s, SPEED) * (1.0 / port.geometry[s, MEAN_CHORD]) / load(port.parameters, 1, s)
        recent = load(port.parameters, 2, s)
        for i in range(2):
            u = along * load(port.flow, s, CHORD_X + 1 + i) + across * load(port.flow, s, NORMAL_X + 1 + i)
            store(port.rate, i, s, fading * (u - load(port.state, i, s)))
            store(port.decay, i, s, fading)
            store(port.rate, 2 + i, s, recent * (u - load(port.state, 2 + i, s)))
            store(port.decay, 2 + i, s, recent)


def _wing(scene: WingScene, values: Values) -> None:
    recent = np.full(LANES, scene.condition.flap_frequency / _RECENT)
    seconds = [_SCALE / scene.angular_rate] * 4
    scene.add_strip_law(_law, [values["share"], values["chords"], recent], states=seconds, before=True)


EFFECT = effect_of_air(
    name="wake_capture",
    title="Wake capture",
    size=(
        Parameter("share", "1", 0.0, 0.5, 0.2, "velocity of the air in the wake over the earlier velocity of the wing"),
    ),
    shape=(
        Parameter("chords", "1", 0.5, 10.0, 2.0, "distance in which the wake decays, in chords travelled", scale="log"),
    ),
    memory="the velocity of the wake at each station of a vehicle's wing or strip of a flexible wing; for each strip "
    "also its own last velocity",
    law="w' = (V / (chords c)) (u - w)\nvelocity of the air = share (w - k u),     k = w.u / u^2, limited to 0..1",
    source="Dickinson, Lehmann and Sane (1999), Sane and Dickinson (2002): force at stroke reversal that quasi-steady "
    "terms do not explain; Birch and Dickinson (2003): no wake in the first stroke from rest. The model with one "
    "decaying state is the simplest one and was chosen here",
    signature="soon after each reversal the wing is pushed in the direction of its previous stroke, and this push "
    "decays within the stroke and is absent in a first stroke from rest",
    confused_with=("circulation_lag", "clap_and_peel", "drive_harmonics"),
    wing=_wing,
    vehicle=deferred("wake", _meet_wake),
)
