"""Renders a film of a flapping wing whose truth is known: ``python -m benchmarks.cameras.render PRESET FOLDER``.

The folder then holds, for each camera CAM (``left``, ``right``, ...):

- ``wing-CAM.avi``: the film of the wing; its frames are counted from 0, as in the truth. ``--suffix`` selects .avi
  (MJPG) or .mp4 (MPEG-4), which lose most of the noise in the dark, .mkv (FFV1) without loss, or .png: a folder
  ``wing-CAM`` of images.
- ``wand-CAM.avi``: a wand with two balls, waved, in continuous light.
- ``boards-CAM/00.png``, ...: the chessboard at rest. Images of the same number show the same pose.
- ``cameras.json``: a list of the true cameras: size, matrix, distortion (k1, k2, p1, p2, k3), rotation and translation
  (camera = R world + t, m), rate, start, clock_error, exposure and row_time (s): row r of frame f is exposed from start
  + f / (rate (1 + clock_error)) + r row_time, for ``exposure``. ``wand.json`` has those of the film of the wand.
- ``truth.npz`` and ``wand.npz``: see :class:`benchmarks.cameras.renderer.truth.Truth`.
- ``boards.npz``: ``points`` [P, 3], the inner corners in the board's frame (m); ``centres`` [N, 3] and ``axes``
  [N, 3, 3], the poses (world = points @ axes + centre); ``corners`` [C, N, P, 2], their pixels; ``inner``, ``side``.
- ``scene.json``: names and sizes of the markers, frequencies of beat and strobe (Hz), length of the wand (m), the seed.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.cameras.renderer.boards import board_image
from benchmarks.cameras.renderer.film import Film
from benchmarks.cameras.renderer.film_camera import FilmCamera
from benchmarks.cameras.renderer.presets import BEAT, PRESETS, Experiment, with_rod
from benchmarks.cameras.renderer.scene import Scene
from benchmarks.cameras.renderer.sensor import Image
from benchmarks.cameras.renderer.simulated import simulated_scene
from benchmarks.cameras.renderer.truth import truth_of
from benchmarks.cameras.renderer.wings import Flapping, analytic_scene
from benchmarks.cameras.write import CODECS, write_image, write_video
from benchmarks.common.progress import show_count
from wingfit.records import Condition

SUFFIXES = (*CODECS, ".png")
PRESSURE, LAG = 1e4, 0.05  # Pa and rad, of the simulated wing


def main(words: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.cameras.render", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("preset", choices=sorted(PRESETS))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--flashes", type=int, help="number of flashes of the strobe")
    parser.add_argument("--beats", type=float, help="number of beats filmed in continuous light")
    parser.add_argument("--wing", choices=("analytic", "simulated"), default="analytic", help="which wing is filmed")
    parser.add_argument(
        "--gene",
        action="append",
        type=_gene,
        default=[],
        metavar="NAME=VALUE",
        help="of the simulated wing: hinge_offset.y=0.02",
    )
    parser.add_argument("--rod", action="store_true", help="a rod hides some of the markers")
    parser.add_argument("--wand", type=float, default=6.0, help="duration of the film of the wand, s")
    parser.add_argument("--scale", type=float, default=1.0, help="width of the images relative to the cameras' own")
    parser.add_argument("--suffix", choices=SUFFIXES, default=".avi", help="kind of video")
    parser.add_argument("--seed", type=int, default=1, help="the same seed gives the same films")
    chosen = parser.parse_args(words)
    given = {"flashes": chosen.flashes, "beats": chosen.beats}
    if chosen.flashes is not None and chosen.preset != "thesis_strobe":
        parser.error(f"--flashes is for thesis_strobe; {chosen.preset} has no strobe, use --beats")
    if chosen.beats is not None and chosen.preset == "thesis_strobe":
        parser.error("--beats is for continuous light; thesis_strobe needs --flashes")
    if chosen.gene and chosen.wing != "simulated":
        parser.error("--gene is for --wing simulated")
    options = {name: value for name, value in given.items() if value is not None}
    scene = _scene(chosen.wing, dict(chosen.gene))
    made = PRESETS[chosen.preset](
        scale=chosen.scale, seed=chosen.seed, scene=with_rod(scene) if chosen.rod else scene, **options
    )
    made = replace(made, wand=replace(made.wand, until=chosen.wand))
    write(made, chosen.folder, chosen.suffix)


def _gene(text: str) -> tuple[str, float]:
    """Name and value of a gene; argparse reports a ValueError."""
    name, _, value = text.partition("=")
    return name, float(value)


def _scene(wing: str, genes: dict[str, float]) -> Scene:
    """The scene of the analytic or the simulated wing; both flap as often as the presets assume."""
    if wing == "analytic":
        return analytic_scene(Flapping(BEAT))
    air = Condition(BEAT, LAG, PRESSURE, 293.15)
    return simulated_scene(air, genes)


def write(made: Experiment, folder: Path, suffix: str = ".avi") -> None:
    """Render the experiment into ``folder``, which is created; the layout is described above."""
    folder.mkdir(parents=True, exist_ok=True)
    _write_text(folder / "scene.json", _described(made))
    for film, cameras, truth in ((made.film, "cameras", "truth"), (made.wand, "wand", "wand")):
        _write_text(folder / f"{cameras}.json", [camera.as_json() for camera in film.cameras])
        began = time.monotonic()

        def tell(done: int, total: int, name: str = f"truth of {film.name}", began: float = began) -> None:
            if done % 20 == 0 or done == total:
                show_count(name, done, total, began)

        truth_of(film, tell).save(folder / f"{truth}.npz")
    _write_boards(made, folder)
    for film in (made.wand, made.film):
        for camera in film.cameras:
            _write_film(film, camera, folder, suffix)


def _described(made: Experiment) -> dict[str, object]:
    film, strobe = made.film, made.film.light.strobe
    ends = made.wand.scene.poses(np.zeros(1)).positions[0]
    return {
        "markers": list(film.scene.names),
        "kind": film.scene.kind,
        "sizes": film.scene.sizes.tolist(),
        "beat_hz": BEAT,
        "strobe_hz": strobe.frequency if strobe else None,
        "flash_s": strobe.duration if strobe else None,
        "wand_m": float(np.linalg.norm(ends[1] - ends[0])),
        "seed": film.seed,
    }


def _write_boards(made: Experiment, folder: Path) -> None:
    """Write the images of the board and the truth about them."""
    points = made.board.points()
    cameras, began = made.film.cameras, time.monotonic()
    corners = np.stack([[camera.project(pose.world(points)) for pose in made.poses] for camera in cameras])
    np.savez_compressed(
        folder / "boards.npz",
        points=points,
        centres=np.stack([pose.centre for pose in made.poses]),
        axes=np.stack([pose.axes for pose in made.poses]),
        corners=corners,
        inner=np.array(made.board.inner),
        side=made.board.side,
    )
    for c, camera in enumerate(cameras):
        place = folder / f"boards-{camera.name}"
        place.mkdir(exist_ok=True)
        for n, pose in enumerate(made.poses):
            write_image(place / f"{n:02d}.png", board_image(camera, made.board, pose, (made.film.seed, 5, c, n)))
            done = c * len(made.poses) + n + 1
            show_count("boards", done, len(cameras) * len(made.poses), began)


def _write_film(film: Film, camera: FilmCamera, folder: Path, suffix: str) -> None:
    """Write one camera's film as a video or a folder of images."""
    name = f"{film.name}-{camera.name}"
    images = _shown(film, camera, name)
    if suffix != ".png":
        write_video(folder / f"{name}{suffix}", images, camera.size, camera.rate)
        return
    (folder / name).mkdir(exist_ok=True)
    for frame, image in enumerate(images):
        write_image(folder / name / f"{frame:05d}.png", image)


def _shown(film: Film, camera: FilmCamera, name: str) -> Iterator[Image]:
    """Iterate over the frames and show the progress."""
    total, began = film.frames(camera), time.monotonic()
    for done, image in enumerate(film.images(camera), 1):
        yield image
        if done % 20 == 0 or done == total:
            show_count(name, done, total, began)


def _write_text(path: Path, value: object) -> None:
    path.write_text(json.dumps(value, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
