"""``python -m benchmarks.screenshots``: takes screenshots of the web page for the README from a running server.

Data of the Robird example (a wing with a displaced axis and a wrong linkage) are simulated, uploaded, calibrated twice
and diagnosed, and the page is opened in Chromium. Takes a few minutes. With ``--every FOLDER``, the forces of the
DelFly and the series of the pendulum are calibrated and diagnosed too, markers are tracked in a small film, and every
page is saved to the folder, in light and dark colours, as on a desktop and on a phone. Takes another few minutes.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.cameras.small_film import places, write_small_film
from benchmarks.common import machine
from benchmarks.common.files import EXAMPLES, REPOSITORY
from benchmarks.common.server_process import Server
from benchmarks.proof import robird
from benchmarks.proof.story import saved
from wingfit import declaration, drive
from wingfit.cli.base.output import progress
from wingfit.client.client import Client
from wingfit.rigs.load import load_rig

if TYPE_CHECKING:
    from playwright.sync_api import Browser

OUT = REPOSITORY / "docs" / "figures"
NAMES = ("chromium", "chromium-browser", "google-chrome")
WIDTH, HEIGHT = 1280, 1200
PHONE_WIDTH, PHONE_HEIGHT = 390, 780
DRAWN_SECONDS = 60.0
SETTLED_MS = 1500  # the 3-D figure needs a moment to draw
# Pages that need no id: address after the #, and id of what is filled or drawn last.
LISTS = {
    "page-home": ("", "newest-runs"),
    "page-runs": ("runs", "listing-table"),
    "page-diagnoses": ("diagnoses", "listing-table"),
    "page-datasets": ("datasets", "listing-table"),
    "page-effects": ("effects", "effects-list"),
    "page-import": ("import", "import-page"),
    "page-films": ("films", "films-page"),
}


def main() -> None:
    """Simulate the data, run the jobs, take the screenshots; the last line of output is one JSON object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.screenshots", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line (always printed)")
    parser.add_argument("--out", type=Path, default=OUT, help="folder for the screenshots")
    parser.add_argument("--every", type=Path, help="folder for screenshots of every page")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        folder = Path(scratch)
        dataset = saved(robird.campaign(options.seed).dataset, folder)
        server = Server(folder, "processes")
        server.start()
        try:
            pages = worked(f"http://127.0.0.1:{server.port}", dataset)
            files = photographed(f"http://127.0.0.1:{server.port}", pages, options.out)
            if options.every:
                every = pages | others(f"http://127.0.0.1:{server.port}") | LISTS
                files += photographed_everywhere(f"http://127.0.0.1:{server.port}", every, options.every)
        finally:
            server.stop()
    figures = {"files": files, "seconds": round(time.monotonic() - began, 1)}
    print(json.dumps(figures | {"processor": machine.cpu(), "commit": machine.commit()}))


def worked(url: str, dataset: Path) -> dict[str, tuple[str, str]]:
    """Upload ``dataset`` (a file) to the server at ``url``, run two calibrations and a diagnosis, and return the pages.

    They are (address after the #, id of the figure that is drawn last), by name of the screenshot.
    """
    with Client(url) as client:
        its = client.upload_dataset(dataset)["id"]
        runs = [
            client.submit_run(its, name=name, division="11", population=30, max_generations=40, seed=1, **more)["id"]
            for name, more in (
                ("as described", {}),
                ("with the drive's effects", {"effects": ["hinge_offset", "drive_harmonics"]}),
            )
        ]
        for number, run in enumerate(runs):
            with progress(f"calibration {number + 1} of {len(runs)}") as tell:
                client.wait(run, on_progress=lambda now: tell(now["progress"], now["eta_seconds"], now["stage"] or ""))
        diagnosis = client.submit_diagnosis(its, name="Missing physics", division="11")["id"]
        with progress("diagnosis") as tell:
            client.wait_for_diagnosis(
                diagnosis, on_progress=lambda now: tell(now["progress"], now["eta_seconds"], now["stage"] or "")
            )
    return {
        "page-run": (f"run={runs[1]}", "beat"),
        "page-diagnosis": (f"diagnosis={diagnosis}", "report"),
        "page-compare": (f"compare={','.join(runs)}", "compare-plot"),
        "page-dataset": (f"dataset={its}", "conditions"),
    }


def others(url: str) -> dict[str, tuple[str, str]]:
    """Run and diagnose the examples of forces and of series on the server at ``url``, and return their pages.

    They have the form of those of :func:`worked`. This process simulates the series.
    """
    rig = load_rig(str(EXAMPLES / "pendulum" / "rig.py"))
    with Client(url) as client:
        forces, series = (client.upload_dataset(EXAMPLES / name)["id"] for name in ("delfly", "pendulum"))
        run = client.submit_run(forces, seed=1)["id"]
        diagnosis = client.submit_diagnosis(forces, without=["clap_and_peel"], suspects=["clap_and_peel"])["id"]
        declared = declaration(rig)
        driven_run = client.submit_run(series, rig=declared, seed=1)["id"]
        drive(client, driven_run, rig)
        suspects = ["dry_friction.pivot", "viscous.pivot"]
        driven = client.submit_diagnosis(series, rig=declared, suspects=suspects)["id"]
        drive(client, driven, rig)
        client.wait(run)
        client.wait_for_diagnosis(diagnosis)
        film, tracking = tracked(client)
    return {
        "page-forces-dataset": (f"dataset={forces}", "data-motion"),
        "page-forces-run": (f"run={run}", "beat-0"),
        "page-forces-diagnosis": (f"diagnosis={diagnosis}", "report"),
        "page-series-dataset": (f"dataset={series}", "panels"),
        "page-series-run": (f"run={driven_run}", "curve-plot"),
        "page-series-diagnosis": (f"diagnosis={driven}", "report"),
        "page-film": (f"film={film}", "film-files"),
        "page-tracking": (f"tracking={tracking}", "found-plot"),
    }


def tracked(client: Client) -> tuple[str, str]:
    """Upload a small film, track its markers, and return the ids of the film and of the tracking."""
    with tempfile.TemporaryDirectory(prefix="wf-") as scratch:
        files = write_small_film(Path(scratch))
        film = client.create_film("plate from two sides", [name for name in files if name != "cameras"])["id"]
        for name, path in files.items():
            client.upload_film_file(film, name, path)
    tracking = client.submit_tracking(film, kind="dot", light="continuous", places=places())["id"]
    client.wait_for_tracking(tracking)
    return film, tracking


def photographed_everywhere(url: str, pages: dict[str, tuple[str, str]], out: Path) -> list[str]:
    """Save ``pages`` to the folder ``out`` in both schemes and sizes, each as a whole; return their file names."""
    out.mkdir(parents=True, exist_ok=True)
    sizes = {"desktop": (WIDTH, HEIGHT), "phone": (PHONE_WIDTH, PHONE_HEIGHT)}
    with _browser() as browser:
        return [
            _shot(browser, url, page, out / f"{name}-{scheme}-{kind}.png", scheme=scheme, size=size, whole=True)
            for name, page in pages.items()
            for scheme in ("light", "dark")
            for kind, size in sizes.items()
        ]


@contextmanager
def _browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright  # needed here alone

    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        sys.exit("chromium is not installed; install it, e.g. apt-get install chromium")
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        yield browser
        browser.close()


def photographed(url: str, pages: dict[str, tuple[str, str]], out: Path) -> list[str]:
    """Save screenshots of ``pages`` (of :func:`worked`) to the folder ``out``; return their file names.

    Each page is in light colours, the diagnosis also in dark ones and on a phone.
    """
    out.mkdir(parents=True, exist_ok=True)
    with _browser() as browser:
        files = [_shot(browser, url, page, out / f"{name}.png") for name, page in pages.items()]
        diagnosis = pages["page-diagnosis"]
        files.append(_shot(browser, url, diagnosis, out / "page-diagnosis-dark.png", scheme="dark"))
        size = (PHONE_WIDTH, PHONE_HEIGHT)
        files.append(_shot(browser, url, diagnosis, out / "page-phone.png", scheme="dark", size=size))
    return files


def _shot(
    browser: Browser,
    url: str,
    page: tuple[str, str],
    path: Path,
    *,
    scheme: str = "light",
    size: tuple[int, int] = (WIDTH, HEIGHT),
    whole: bool = False,
) -> str:
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)  # type: ignore[arg-type]
    tab = context.new_page()
    address, figure = page
    tab.goto(f"{url}/#{address}" if address else url)
    deadline = time.monotonic() + DRAWN_SECONDS
    # Polled from here: waiting inside the page needs eval, which its content security policy forbids.
    node = f"document.getElementById('{figure}')"
    drawn = f"[{node}].some((one) => one?.data?.length || one?.shadowRoot?.querySelector('svg')"
    drawn += " || one?.querySelector('li, td, summary, button, .main-svg'))"
    while not tab.evaluate(drawn):
        if time.monotonic() > deadline:
            raise RuntimeError(f"{figure} was not drawn within {DRAWN_SECONDS:g} s on #{address}")
        tab.wait_for_timeout(100)
    tab.wait_for_timeout(SETTLED_MS)
    tab.screenshot(path=path, full_page=whole)
    context.close()
    return path.name


if __name__ == "__main__":
    main()
