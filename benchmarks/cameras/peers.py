"""The same pixels, triangulated by OpenCV's linear method on undistorted pixels."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.cameras.tracked import Tracked
from wingfit.cameras.opencv import opencv


def peers(tracked: Tracked) -> list[dict[str, Any]]:
    """Return the error (mm) of each peer on the pixels and with the cameras of ``tracked``, for two cameras."""
    cv2 = opencv()
    one, two = tracked.calibration.cameras[:2]
    pixels = tracked.found.pixels
    known = np.isfinite(pixels).all((1, 3)) & np.isfinite(tracked.found.positions).all(2)
    rays = [camera.rays(pixels[:, k][known]) for k, camera in enumerate((one, two))]
    matrices = [np.column_stack([camera.rotation, camera.translation]) for camera in (one, two)]
    homogeneous = cv2.triangulatePoints(*matrices, *(ray.T for ray in rays))
    points = (homogeneous[:3] / homogeneous[3]).T
    error = np.linalg.norm(points - tracked.truth[known], axis=1)
    own = np.linalg.norm(tracked.found.positions[known] - tracked.truth[known], axis=1)
    return [
        {
            "name": "OpenCV triangulatePoints",
            "error_mm": round(1e3 * float(np.sqrt(np.mean(error**2))), 4),
            "own_error_mm": round(1e3 * float(np.sqrt(np.mean(own**2))), 4),
        }
    ]
