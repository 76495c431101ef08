"""``python -m benchmarks.screenshots``: takes screenshots of the web page for the README from a running server.

Data of the Robird example (a wing with a displaced axis and a wrong linkage) are simulated, uploaded, calibrated twice
and diagnosed, and the page is opened in Chromium. Takes a few minutes.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.common import machine
from benchmarks.common.files import REPOSITORY
from benchmarks.common.server_process import Server
from benchmarks.proof import robird
from benchmarks.proof.story import saved
from wingfit.cli.base.output import progress
from wingfit.client.client import Client

if TYPE_CHECKING:
    from playwright.sync_api import Browser

OUT = REPOSITORY / "docs" / "figures"
NAMES = ("chromium", "chromium-browser", "google-chrome")
WIDTH, HEIGHT = 1280, 1200
PHONE_WIDTH, PHONE_HEIGHT = 390, 780
DRAWN_SECONDS = 60.0


def main() -> None:
    """Simulate the data, run the jobs, take the screenshots; the last line of output is one JSON object."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.screenshots", description=__doc__)
    parser.add_argument("--json", action="store_true", help="one JSON object as the last line (always printed)")
    parser.add_argument("--out", type=Path, default=OUT, help="folder for the screenshots")
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


def photographed(url: str, pages: dict[str, tuple[str, str]], out: Path) -> list[str]:
    """Save screenshots of ``pages`` (of :func:`worked`) to the folder ``out``; return their file names.

    Each page is in light colours, the diagnosis also in dark ones and on a phone.
    """
    from playwright.sync_api import sync_playwright  # needed here alone

    path = next((found for name in NAMES if (found := shutil.which(name))), None)
    if path is None:
        sys.exit("chromium is not installed; install it, e.g. apt-get install chromium")
    out.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as started:
        browser = started.chromium.launch(executable_path=path, args=["--no-sandbox", "--disable-gpu"])
        files = [_shot(browser, url, page, out / f"{name}.png") for name, page in pages.items()]
        diagnosis = pages["page-diagnosis"]
        files.append(_shot(browser, url, diagnosis, out / "page-diagnosis-dark.png", scheme="dark"))
        size = (PHONE_WIDTH, PHONE_HEIGHT)
        files.append(_shot(browser, url, diagnosis, out / "page-phone.png", scheme="dark", size=size))
        browser.close()
    return files


def _shot(
    browser: Browser,
    url: str,
    page: tuple[str, str],
    path: Path,
    *,
    scheme: str = "light",
    size: tuple[int, int] = (WIDTH, HEIGHT),
) -> str:
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)  # type: ignore[arg-type]
    tab = context.new_page()
    address, figure = page
    tab.goto(f"{url}/#{address}")
    deadline = time.monotonic() + DRAWN_SECONDS
    # Polled from here: waiting inside the page needs eval, which its content security policy forbids.
    node = f"document.getElementById('{figure}')"
    drawn = f"[{node}].some((one) => one?.data?.length || one?.shadowRoot?.querySelector('svg'))"
    while not tab.evaluate(drawn):
        if time.monotonic() > deadline:
            raise RuntimeError(f"{figure} was not drawn within {DRAWN_SECONDS:g} s on #{address}")
        tab.wait_for_timeout(100)
    tab.wait_for_timeout(1500)  # the 3-D figure needs a moment to draw
    tab.screenshot(path=path)
    context.close()
    return path.name


if __name__ == "__main__":
    main()
