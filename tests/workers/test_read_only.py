"""The read-only mounts of docker-compose.yml, in a mount namespace instead of a container."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.oracles.processes import REPOSITORY

# The repository is put aside, because it may lie below /tmp, and comes back where it was.
SCRIPT = """
set -e
mount --make-rprivate /
mount --rbind "$1" /mnt
mount -t tmpfs -o "noexec,nosuid,nodev,$2" tmpfs /tmp
mkdir -p "$1"
mount --rbind /mnt "$1"
mount -o remount,bind,ro "$1"
mount -o remount,bind,ro /
cd "$1"
shift 2
exec "$@"
"""
RUN = [sys.executable, "-m", "tests.workers.read_only_run"]
NAMESPACES = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc"]


def can_mount() -> bool:
    if not shutil.which("unshare") or not Path("/mnt").is_dir():
        return False
    return subprocess.run([*NAMESPACES, "true"], capture_output=True, check=False).returncode == 0


def image_environment() -> dict[str, str]:
    """The image's variables for the places of written files."""
    text = (REPOSITORY / "Dockerfile").read_text()
    found = dict(re.findall(r"\b(HOME|TMPDIR|XDG_CACHE_HOME|NUMBA_CACHE_DIR)=(\S+)", text))
    return {name: value for name, value in os.environ.items() if name not in found} | found


@pytest.mark.skipif(not can_mount(), reason="needs the right to mount file systems (root, and unshare of util-linux)")
@pytest.mark.skipif(
    not Path(sys.prefix).is_relative_to(REPOSITORY), reason="needs the environment in .venv, by make install"
)
def test_node_and_server_write_to_tmp_only_and_have_their_kernels() -> None:
    api = yaml.safe_load((REPOSITORY / "docker-compose.yml").read_text())["services"]["api"]
    (mount,) = api["tmpfs"]
    place, _, options = mount.partition(":")
    assert place == "/tmp"  # noqa: S108
    done = subprocess.run(
        [*NAMESPACES, "sh", "-c", SCRIPT, "sh", str(REPOSITORY), options, *RUN],
        capture_output=True, text=True, check=False, timeout=300.0, env=image_environment(), cwd="/",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    report = json.loads(done.stdout.splitlines()[-1])
    assert report["refused"] == [REPOSITORY.name, "__pycache__", "tmp", "etc"]
    assert (report["state"], report["error"]) == ("SUCCEEDED", None)
    assert report["kernels"] > 10
    assert report["compiled_again"] == []
