"""A Ray node and a server on it where only /tmp can be written: run by ``test_read_only.py`` in a mount namespace."""

from __future__ import annotations

import json
import os
import secrets
import subprocess
import sys
import time
from pathlib import Path

from tests.oracles.processes import EXAMPLES, REPOSITORY, Server, environment, free_port
from wingfit.client.client import Client

FOLDER = Path("/tmp/run")  # noqa: S108  a file system of its own
SPEC = {
    "division": "4", "mode": "joint", "recordings": ["vac-0010mbar-lag0-2.0hz"],
    "population": 8, "max_generations": 1, "stall": 1, "seed": 1,
}  # fmt: skip


def main() -> None:
    """Print what happened as one line of JSON."""
    began = time.time()
    FOLDER.mkdir()
    token = FOLDER / "token"
    token.touch(mode=0o600)
    token.write_text(secrets.token_hex(32))
    address = f"127.0.0.1:{free_port()}"
    _start_ray(token, address)
    server = Server(FOLDER, "ray", token, address)
    server.start()
    try:
        with Client(f"http://127.0.0.1:{server.port}") as client:
            dataset = client.upload_dataset(EXAMPLES / "robird")
            run = client.wait(client.submit_run(dataset["id"], **SPEC)["id"])
    finally:
        server.stop()
    shipped = {path.relative_to(path.parents[2]) for path in (REPOSITORY / "sim").rglob("*.nbc")}
    cached = Path(os.environ["HOME"], ".cache", "wingfit").rglob("*.nbc")
    code = [path for path in cached if path.relative_to(path.parents[2]) in shipped]
    # A copy keeps the time of what was copied.
    again = [path.name for path in code if path.stat().st_mtime > began]
    print(json.dumps({**run, "refused": _refused(), "kernels": len(code), "compiled_again": again}))


def _start_ray(token: Path, address: str) -> None:
    command = [
        str(Path(sys.executable).with_name("ray")), "start", "--head", "--node-ip-address=127.0.0.1", "--num-cpus=1",
        f"--port={address.split(':')[1]}", "--include-dashboard=false", "--object-store-memory=80000000",
        "--disable-usage-stats",
    ]  # fmt: skip
    with (FOLDER / "ray.log").open("w") as log:
        subprocess.run(command, check=True, env=environment(token), stdin=subprocess.DEVNULL, stdout=log, stderr=log)


def _refused() -> list[str]:
    """Usually writable folders that are read-only here."""
    refused = []
    for folder in (REPOSITORY, REPOSITORY / "sim" / "kernels" / "__pycache__", Path("/var/tmp"), Path("/etc")):  # noqa: S108
        try:
            (folder / "trial").touch()
        except OSError:
            refused.append(folder.name)
    return refused


if __name__ == "__main__":
    main()
