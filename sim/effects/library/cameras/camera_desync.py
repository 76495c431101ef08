"""Measurement fault: one camera of the pair takes its images later than the other."""

from __future__ import annotations

import numpy as np

from wingfit.sim.effects.contract import Parameter, Values, fault_of_tracks
from wingfit.sim.effects.ports.observation import Sampling
from wingfit.sim.effects.ports.stated_cameras import image, triangulated
from wingfit.sim.effects.ports.stereo import PLACES, Stereo


def _observe(sampling: Sampling, values: Values) -> None:
    delay = np.exp(2j * np.pi * sampling.harmonics * values["delay"][:, None])
    if sampling.cameras:
        near = sampling.beat
        images = [image(camera, near) for camera in sampling.cameras[:-1]]
        sampling.filtered(delay)
        images.append(image(sampling.cameras[-1], sampling.beat))
        sampling.beat = triangulated(sampling.cameras, images, near)
        return
    cameras = Stereo.of(values)
    inner = cameras.image(sampling.beat, -1.0)
    sampling.filtered(delay)
    outer = cameras.image(sampling.beat, 1.0)
    sampling.beat = cameras.points(inner, outer)


EFFECT = fault_of_tracks(
    name="camera_desync",
    title="Cameras out of step",
    size=(Parameter("delay", "s", -0.01, 0.01, 0.002, "time by which the outer camera is later than the inner one"),),
    shape=PLACES,
    law="inner image at t, outer image at t + delay:     H - Z' = B / (v_inner - v_outer + B / H)",
    source="Hartley and Zisserman (2004), Multiple View Geometry, ch. 12: triangulation; Bradley et al. (2009), "
    "Synchronization and rolling shutter compensation for consumer video camera arrays: images of different instants",
    signature="markers appear too near to the cameras or too far from them, in proportion to their speed along the "
    "line between the cameras, and this error changes sign with the stroke and grows with the flap frequency",
    confused_with=("rolling_shutter", "clock_offset", "tracker_lag"),
    observe=_observe,
)
