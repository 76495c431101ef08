"""A complete calibration over HTTP: ``python -m examples.demo`` (or ``make demo``).

Starts a server on a free port with a temporary data folder, uploads the example campaign and calibrates the 11-body
wing. Only after that it reads the true genome, and prints the error of the calibration.
"""

from __future__ import annotations

import argparse
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any, NoReturn, cast

from wingfit.cli.base.output import mm, note, number, progress, say, table
from wingfit.cli.results import identifiable, misfits
from wingfit.client import answers as a
from wingfit.client.client import Client, ServerAwayError, WingfitError

EXAMPLE = Path(__file__).parent / "robird"
SPEC: dict[str, Any] = {"division": "11", "mode": "staged", "seed": 1, "name": "demo"}
SERVER = ["wingfit.service.server"]
START_S = 120.0
STOP_S = 15.0
GOAL_OVER_FLOOR = 1.3
GOAL_PERCENT = 15.0
INTERRUPTED = 130


def main(words: list[str] | None = None) -> int:
    """Run the demo with the options ``words``, by default those of the process; return the exit code, 0 on success."""
    parser = argparse.ArgumentParser(prog="python -m examples.demo", description=__doc__)
    parser.add_argument("--keep", action="store_true", help="keep the server running until Ctrl-C")
    options = parser.parse_args(words)
    signal.signal(signal.SIGTERM, _terminate)
    try:
        with (
            TemporaryDirectory(prefix="wingfit-demo-") as data,
            server(Path(data)) as url,
            Client(url) as client,
        ):
            calibrate(client)
            if options.keep:
                keep(url)
    except KeyboardInterrupt:
        note("\nstopped; the server of the demo has stopped too")
        return INTERRUPTED
    except (WingfitError, OSError) as error:
        note(f"the demo failed: {error}")
        return 1
    say("")
    say("The server of the demo has stopped. To run one: wingfit serve --data wingfit-data")
    say("then open http://127.0.0.1:8321, or: wingfit datasets upload examples/robird")
    return 0


@contextmanager
def server(data: Path) -> Iterator[str]:
    """Context manager: run a server with the folder ``data``, give its URL when it is ready, and stop it at the end."""
    url, port = _free_address()
    log = data / "server.log"
    chosen = {"WINGFIT_DATA": str(data / "data"), "WINGFIT_PORT": str(port), "WINGFIT_EVALUATOR": "ray"}
    inherited = {key: value for key, value in os.environ.items() if not key.startswith("WINGFIT_")}
    with log.open("wb") as stream:
        # A session of its own: Ctrl-C reaches this process only, which then ends the whole group in order.
        child = subprocess.Popen(  # noqa: S603  # our own module
            [sys.executable, "-m", *SERVER],
            stdin=subprocess.DEVNULL,
            stdout=stream,
            stderr=subprocess.STDOUT,
            env=inherited | chosen,
            start_new_session=True,
        )
    try:
        _await_start(url, child, log)
        yield url
    finally:
        _stop(child)


def calibrate(client: Client) -> None:
    """Upload the example, calibrate it, and print the estimated genes and the misfits."""
    started = time.monotonic()
    dataset = client.upload_dataset(EXAMPLE)
    held_out = sum(recording["held_out"] for recording in dataset["recordings"])
    say(f"uploaded '{dataset['name']}': {len(dataset['recordings'])} recordings, {held_out} of them held out")
    run = client.submit_run(dataset["id"], **SPEC)
    say(f"page: {client.base_url}/#run={run['id']}")
    with progress("calibrating") as report:
        run = client.wait(run["id"], lambda now: report(now["progress"], now["eta_seconds"], _state(now)))
    if run["state"] != "SUCCEEDED":
        raise WingfitError(f"the run is {run['state']}", run["error"] or "the server gave no reason")
    say(f"calibrated in {time.monotonic() - started:.0f} s with {run['evaluations']} evaluations")
    result = cast(a.Result, client.result(run["id"]))
    say("")
    _print_genes(result["genes"])
    say("")
    misfits(result)
    _print_floor(result)


def keep(url: str) -> NoReturn:
    """Keep the server running until Ctrl-C."""
    say(f"the server runs at {url} until Ctrl-C")
    while True:
        time.sleep(3600)


def true_values(path: Path) -> dict[str, float]:
    """Return the true genes of the recordings, by name, from the file at ``path``.

    As in the results, genes that are shares of one quantity are normalised to sum to 1.
    """
    from wingfit.sim.virtual_rigs.campaign import read_truth  # imported late, because it compiles kernels

    return read_truth(path).normalised()


def _print_genes(genes: list[a.GeneInfo]) -> None:
    """Print a table of nominal, estimated and true value of each gene."""
    truth = true_values(EXAMPLE.with_suffix(".truth.json"))
    off = {gene["name"]: 100 * (gene["best"] / truth[gene["name"]] - 1) for gene in genes}
    rows = [
        [
            gene["name"],
            number(gene["nominal"]),
            number(gene["best"]),
            number(truth[gene["name"]]),
            gene["unit"],
            identifiable(gene),
            f"{off[gene['name']]:+.1f} %" if gene["identifiable"] else "–",
        ]
        for gene in genes
    ]
    table(["gene", ">nominal", ">best", ">truth", "unit", "identifiable", ">error"], rows)
    known = [abs(off[gene["name"]]) for gene in genes if gene["identifiable"]]
    close = sum(value <= GOAL_PERCENT for value in known)
    say(f"of {len(known)} identifiable genes, {close} are within {GOAL_PERCENT:g} % of the truth")


def _print_floor(result: a.Result) -> None:
    held_out, floor = result["held_out_after_mm"], result["noise_mm"]
    if held_out is None or not floor:
        return
    goal = "within" if held_out <= GOAL_OVER_FLOOR * floor else "not within"
    say(
        f"held out: {mm(held_out)} mm, {held_out / floor:.2f} times the noise floor, "
        f"{goal} the goal of {GOAL_OVER_FLOOR} times"
    )


def _state(run: a.Run) -> str:
    stage = run["stage"] or run["state"].lower()
    return f"{stage}, generation {run['generations']}, best {mm(run['best_mm'])} mm"


def _free_address() -> tuple[str, int]:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return f"http://127.0.0.1:{port}", port


def _await_start(url: str, child: subprocess.Popen[bytes], log: Path) -> None:
    deadline = time.monotonic() + START_S
    with Client(url, retries=0, timeout_s=5.0) as client, progress("starting the server") as report:
        while child.poll() is None and time.monotonic() < deadline:
            report(None)
            try:
                if client.health()["status"] == "ok":
                    report(1.0)
                    return
            except ServerAwayError:
                pass
            time.sleep(0.2)
    tail = log.read_text(encoding="utf-8", errors="replace").strip().splitlines()[-8:]
    why = "it ended" if child.poll() is not None else f"it was not ready after {START_S:.0f} s"
    raise WingfitError("the server did not start", "\n".join([f"{why}. The end of its log:", *tail]))


def _stop(child: subprocess.Popen[bytes]) -> None:
    """Stop the server, and kill the processes of its group that still run."""
    # A second Ctrl-C must not interrupt this; it takes a limited time.
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        child.terminate()
        try:
            child.wait(STOP_S)
        except subprocess.TimeoutExpired:
            note("the server does not stop; killing it")
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()
    finally:
        signal.signal(signal.SIGINT, previous)


def _terminate(_signal: int, _frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
