"""Measurement fault: lens distortion that the calibration of the cameras has not removed."""

from __future__ import annotations

from wingfit.sim.effects.contract import Array, Parameter, Values, fault_of_tracks
from wingfit.sim.effects.ports.observation import Sampling
from wingfit.sim.effects.ports.stated_cameras import image, triangulated
from wingfit.sim.effects.ports.stereo import PLACES, Stereo


def distorted(u: Array, v: Array, values: Values) -> tuple[Array, Array]:
    """Return the image coordinates ``u``, ``v`` [B, n, M] after distortion by the lens (Brown 1971).

    u' = u (1 + k1 r^2 + k2 r^4) + 2 p1 u v + p2 (r^2 + 2 u^2), r^2 = u^2 + v^2; v' is the same with u and v, and p1 and
    p2, exchanged. Coordinates are in focal lengths from the principal point; ``values``: k1, k2, p1, p2 [B] by name.
    """
    k1, k2, p1, p2 = (values[name][:, None, None] for name in ("k1", "k2", "p1", "p2"))
    r2 = u * u + v * v
    radial = 1.0 + k1 * r2 + k2 * r2 * r2
    return (
        u * radial + 2.0 * p1 * u * v + p2 * (r2 + 2.0 * u * u),
        v * radial + 2.0 * p2 * u * v + p1 * (r2 + 2.0 * v * v),
    )


def _observe(sampling: Sampling, values: Values) -> None:
    if sampling.cameras:
        images = [distorted(*image(camera, sampling.beat), values) for camera in sampling.cameras]
        sampling.beat = triangulated(sampling.cameras, images, sampling.beat)
        return
    cameras = Stereo.of(values)
    inner, outer = (distorted(*cameras.image(sampling.beat, side), values) for side in (-1.0, 1.0))
    sampling.beat = cameras.points(inner, outer)


EFFECT = fault_of_tracks(
    name="lens_distortion",
    title="Lens distortion not removed",
    size=(
        Parameter("k1", "1", -0.25, 0.25, -0.1, "radial distortion of third order; negative for barrel distortion"),
        Parameter("k2", "1", -0.1, 0.1, 0.01, "radial distortion of fifth order"),
        Parameter("p1", "1", -0.02, 0.02, 0.001, "tangential distortion of a lens that is off its axis along the span"),
        Parameter(
            "p2", "1", -0.02, 0.02, 0.001, "tangential distortion of a lens that is off its axis along the chord"
        ),
    ),
    shape=PLACES,
    law="u' = u (1 + k1 r^2 + k2 r^4) + 2 p1 u v + p2 (r^2 + 2 u^2)\n"
    "v' = v (1 + k1 r^2 + k2 r^4) + 2 p2 u v + p1 (r^2 + 2 v^2)",
    source="Brown (1971), Close-range camera calibration, and Conrady (1919): the Brown-Conrady model. An action "
    "camera has a k1 of about -0.25, and a calibration at another field of view leaves part of it",
    signature="the errors grow with the third power of the distance from the middle of the image, at rest as in "
    "motion, and are alike in every condition",
    confused_with=("scale_error", "camera_rotation"),
    observe=_observe,
)
