"""Draw how a flash of a strobe is seen and read: ``python -m docs.generate.camera_figures`` writes it as PNG.

A rendered film of 49 markers: the two half-lit frames of one flash, and both merged, with what is detected.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from benchmarks.cameras.render import write
from benchmarks.cameras.renderer.presets import thesis_strobe
from wingfit.cameras.markers.chequer import detect_chequers
from wingfit.cameras.opencv import opencv
from wingfit.cameras.video.source import Film, Frames
from wingfit.cameras.video.strobe import Background, Flash, background, flashes
from wingfit.records.array_types import Array

FIGURE = Path(__file__).parents[2] / "docs" / "figures" / "strobe.png"
FLASHES, MARGIN, GAP = 12, 30, 6
BRIGHTER = 1.6
FOUND = (80, 220, 80)  # blue, green, red


def main() -> None:
    """Render a film, and write the figure of its most evenly divided flash."""
    cv2 = opencv()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        write(thesis_strobe(scale=0.6, flashes=FLASHES), folder)
        frames = Film(folder / "wing-left.avi").opened()
        dark = background(frames)
        best = max(flashes(frames, dark), key=lambda flash: np.isfinite(flash.mark.between).all())
        halves = _halves(frames, best)
    panels = [_grey(image - dark.image) for image in (*halves, best.image + dark.image)]
    for x, y in detect_chequers(best.image, 0.0, max(best.noise, 1.0)).pixels:
        cv2.circle(panels[2], (round(float(x)), round(float(y))), 9, FOUND, 1, cv2.LINE_AA)
    rows, columns = _lit(best, dark)
    shown = [panel[rows, columns] for panel in panels]
    space = np.full((shown[0].shape[0], GAP, 3), 255, np.uint8)
    cv2.imwrite(str(FIGURE), np.concatenate([shown[0], space, shown[1], space, shown[2]], axis=1))
    print(FIGURE)


def _halves(frames: Frames, flash: Flash) -> list[Array]:
    """Return the two frames that show ``flash``."""
    found = []
    for number, frame in frames.read():
        if number in (flash.mark.frame, flash.mark.frame + 1) and frame is not None:
            found.append(frame.astype(float))
        if number > flash.mark.frame:
            break
    return found


def _grey(image: Array) -> Array:
    return np.repeat(np.clip(BRIGHTER * image, 0, 255).astype(np.uint8)[:, :, None], 3, axis=2)


def _lit(flash: Flash, dark: Background) -> tuple[slice, slice]:
    """Return the rows and columns with light, and a margin."""
    bright = flash.image > 20 * dark.noise + 20
    edges = [np.flatnonzero(bright.any(axis)) for axis in (1, 0)]
    rows, columns = (slice(max(int(one[0]) - MARGIN, 0), int(one[-1]) + MARGIN) for one in edges)
    return rows, columns


if __name__ == "__main__":
    main()
