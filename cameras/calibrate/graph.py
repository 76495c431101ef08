"""Poses of cameras from relative poses of pairs: a spanning tree of the pairs that share most views."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from wingfit.records.array_types import Array, Float
from wingfit.records.errors import fail


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid motion: a point x (m) goes to ``rotation`` @ x + ``translation``. Arrays of motions have more axes."""

    rotation: Float[Array, "... 3 3"]
    translation: Float[Array, "... 3"]

    def after(self, first: Pose) -> Pose:
        """Return the motion that does ``first``, then this one."""
        moved = np.einsum("...ij,...j->...i", self.rotation, first.translation) + self.translation
        return Pose(self.rotation @ first.rotation, moved)

    @property
    def inverse(self) -> Pose:
        """Return the motion back."""
        back = np.swapaxes(self.rotation, -1, -2)
        return Pose(back, -np.einsum("...ij,...j->...i", back, self.translation))

    def at(self, index: int | tuple[int, ...]) -> Pose:
        """Return the motion, or motions, at ``index`` of an array of them."""
        return Pose(self.rotation[index], self.translation[index])


UNMOVED = Pose(np.eye(3), np.zeros(3))


@dataclass(frozen=True, eq=False)
class Link:
    """A pair of cameras: the ``pose`` from the axes of the first to those of the second, and the views they share."""

    pose: Pose
    shared: int


def camera_poses(names: Sequence[str], links: Mapping[tuple[int, int], Link], remedy: str) -> list[Pose]:
    """Return the pose of each camera, from the axes of the first camera to its own.

    DatasetError names the cameras that no chain of ``links`` joins to the first; ``remedy`` is the end of its message.
    """
    poses: dict[int, Pose] = {0: UNMOVED}
    while len(poses) < len(names):
        open_links = [(link.shared, i, j, link) for (i, j), link in links.items() if (i in poses) != (j in poses)]
        if not open_links:
            raise _apart(names, poses, remedy)
        _, i, j, link = max(open_links, key=lambda one: one[:3])
        if i in poses:
            poses[j] = link.pose.after(poses[i])
        else:
            poses[i] = link.pose.inverse.after(poses[j])
    return [poses[i] for i in range(len(names))]


def _apart(names: Sequence[str], joined: Mapping[int, Pose], remedy: str) -> Exception:
    inside = ", ".join(names[i] for i in sorted(joined))
    outside = ", ".join(name for i, name in enumerate(names) if i not in joined)
    message = (
        f"too few views are shared by the cameras {outside} and the cameras {inside}, also through others; {remedy}"
    )
    return fail("calibration, cameras", outside, message)
