"""Deployment files: Ray is unreachable from outside, versions are pinned, no local files enter the image."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.oracles.processes import REPOSITORY
from wingfit.workers.node_alive import TIMEOUT_SECONDS

# Head, object manager and node manager (by convention), client, dashboard, its agents, and the range of workers.
RAY_PORTS = {6379, 8076, 8077, 8265, 10001, 52365, *range(10002, 20000)}
RAY_SERVICES = ("ray-head", "ray-worker", "api")
SERVICES = (*RAY_SERVICES, "ray-token", "front")


@pytest.fixture(scope="module")
def compose() -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((REPOSITORY / "docker-compose.yml").read_text())
    return content


@pytest.fixture(scope="module")
def services(compose: dict[str, Any]) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = compose["services"]
    return found


def test_the_tests_know_all_services(services: dict[str, dict[str, Any]]) -> None:
    assert set(services) == set(SERVICES)


def test_only_the_front_is_published_and_only_on_loopback(services: dict[str, dict[str, Any]]) -> None:
    for name, service in services.items():
        assert "network_mode" not in service or service["network_mode"] == "none", name
        if name != "front":
            assert "ports" not in service, name
    (port,) = services["front"]["ports"]
    address, outer, inner = re.fullmatch(r"([\d.]+):\$\{WINGFIT_PORT:-(\d+)\}:(\d+)", port).groups()  # type: ignore[union-attr]
    assert address == "127.0.0.1"
    assert not {int(outer), int(inner)} & RAY_PORTS


def test_no_ray_node_is_on_the_published_network(compose: dict[str, Any], services: dict[str, dict[str, Any]]) -> None:
    """Ray listens on every interface: see ``test_ray_listens_on_every_interface_whatever_its_address``."""
    assert compose["networks"]["cluster"]["internal"] is True
    for name in RAY_SERVICES:
        assert services[name]["networks"] == ["cluster"], name
    assert sorted(services["front"]["networks"]) == ["cluster", "front"]
    assert not {"RAY_AUTH_TOKEN_PATH", "RAY_AUTH_TOKEN"} & set(services["front"].get("environment", {}))
    assert "volumes" not in services["front"]


def test_the_front_forwards_to_the_port_of_the_api_only(services: dict[str, dict[str, Any]]) -> None:
    assert services["front"]["command"] == ["python", "-m", "wingfit.service.operations.forward", "api:8321"]
    assert "WINGFIT_PORT=8321" in (REPOSITORY / "Dockerfile").read_text()
    assert services["front"]["depends_on"] == {"api": {"condition": "service_healthy"}}


@pytest.mark.parametrize("name", RAY_SERVICES)
def test_every_member_has_the_token_read_only(services: dict[str, dict[str, Any]], name: str) -> None:
    environment = services[name]["environment"]
    assert environment["RAY_AUTH_MODE"] == "token"
    assert environment["RAY_AUTH_TOKEN_PATH"].startswith("/run/ray-token/")
    assert "RAY_AUTH_TOKEN" not in environment
    assert "ray-token:/run/ray-token:ro" in services[name]["volumes"]
    assert environment["RAY_USAGE_STATS_ENABLED"] == "0"


def test_the_token_is_made_before_anyone_needs_it(services: dict[str, dict[str, Any]], tmp_path: Path) -> None:
    assert services["ray-head"]["depends_on"] == {"ray-token": {"condition": "service_completed_successfully"}}
    python, flag, script = services["ray-token"]["command"]
    assert (python, flag) == ("python", "-c")
    script = script.replace("/run/ray-token", str(tmp_path))
    subprocess.run(["python3", "-c", script], check=True)
    token = tmp_path / "token"
    first = token.read_text()
    assert re.fullmatch("[0-9a-f]{64}", first)
    assert token.stat().st_mode & 0o777 == 0o600
    subprocess.run(["python3", "-c", script], check=True)
    assert token.read_text() == first


@pytest.mark.parametrize("name", RAY_SERVICES)
def test_every_member_is_restarted_and_has_shared_memory_for_its_objects(
    services: dict[str, dict[str, Any]], name: str
) -> None:
    service = services[name]
    assert service["restart"] == "unless-stopped"
    objects = int(re.search(r"--object-store-memory=(\d+)", service["command"]).group(1))  # type: ignore[union-attr]
    assert int(service["shm_size"].removesuffix("m")) * 2**20 > objects


@pytest.mark.parametrize("name", SERVICES)
def test_no_container_has_more_rights_than_it_needs(services: dict[str, dict[str, Any]], name: str) -> None:
    service = services[name]
    assert service["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in service["security_opt"]
    assert not {"privileged", "cap_add", "pid", "user"} & set(service)


def number_of_bytes(text: str) -> int:
    number, unit = re.fullmatch(r"(\d+)([mg])", text).groups()  # type: ignore[union-attr]
    return int(number) * {"m": 2**20, "g": 2**30}[unit]


def default(value: object) -> str:
    """Compose's default if the variable is not set."""
    return re.sub(r"\$\{\w+:?-(\w+)\}", r"\1", str(value))


@pytest.mark.parametrize("name", SERVICES)
def test_every_file_system_is_read_only_but_memory_and_named_volumes(
    compose: dict[str, Any], services: dict[str, dict[str, Any]], name: str
) -> None:
    """``test_read_only.py`` runs the service in this way."""
    service = services[name]
    assert service["read_only"] is True
    (mount,) = service["tmpfs"]
    assert re.fullmatch(r"/tmp:mode=1777,size=\d+m", mount)  # noqa: S108
    writable = {volume.split(":")[0] for volume in service.get("volumes", []) if not volume.endswith(":ro")}
    assert writable == {"api": {"data"}, "ray-token": {"ray-token"}}.get(name, set())
    assert writable <= set(compose["volumes"])


def test_uploads_are_on_disk_and_rays_sockets_in_memory(services: dict[str, dict[str, Any]]) -> None:
    environment = services["api"]["environment"]
    assert (environment["TMPDIR"], environment["RAY_TMPDIR"]) == ("/data", "/tmp")  # noqa: S108


@pytest.mark.parametrize("name", SERVICES)
def test_memory_and_processes_of_every_container_are_limited(services: dict[str, dict[str, Any]], name: str) -> None:
    service = services[name]
    memory, processes = number_of_bytes(default(service["mem_limit"])), int(default(service["pids_limit"]))
    assert processes <= 4096
    if name in RAY_SERVICES:
        # What is in memory file systems counts as well.
        shared = number_of_bytes(service["shm_size"]) + number_of_bytes(service["tmpfs"][0].split("size=")[1])
        assert memory >= shared + 2**30
    else:
        assert memory <= 2**28


def test_the_limits_are_documented(services: dict[str, dict[str, Any]]) -> None:
    page = (REPOSITORY / "docs" / "deployment.md").read_text()
    text = (REPOSITORY / "docker-compose.yml").read_text()
    variables = dict(re.findall(r"\$\{(WINGFIT_\w+):-(\w+)\}", text))
    assert {"WINGFIT_HEAD_MEMORY", "WINGFIT_WORKER_MEMORY", "WINGFIT_API_MEMORY", "WINGFIT_PIDS"} <= set(variables)
    for name, value in variables.items():
        assert f"| `{name}` | `{value}` |" in page, name
    assert services


@pytest.mark.parametrize("name", SERVICES)
def test_logs_do_not_fill_the_disk(services: dict[str, dict[str, Any]], name: str) -> None:
    logging = services[name]["logging"]
    assert logging["driver"] == "json-file"
    assert number_of_bytes(logging["options"]["max-size"]) * int(logging["options"]["max-file"]) <= 2**26
    if name in RAY_SERVICES:
        environment = services[name]["environment"]
        kept = int(environment["RAY_ROTATION_MAX_BYTES"]) * (1 + int(environment["RAY_ROTATION_BACKUP_COUNT"]))
        room = number_of_bytes(services[name]["tmpfs"][0].split("size=")[1])
        assert 20 * kept < room, "Ray writes about a dozen log files, and two for each worker"


def test_every_long_lived_container_has_a_health_check(services: dict[str, dict[str, Any]]) -> None:
    image = (REPOSITORY / "Dockerfile").read_text()
    assert "http://127.0.0.1:8321/v1/health" in image.split("HEALTHCHECK", 1)[1]
    for name in ("api", "front"):
        assert "healthcheck" not in services[name], f"{name} has the image's, which asks port 8321"
    assert "('ray-head', 6379)" in services["ray-head"]["healthcheck"]["test"][-1]
    worker = services["ray-worker"]["healthcheck"]
    assert worker["test"] == ["CMD", "python", "-m", "wingfit.workers.node_alive", "ray-head:6379"]
    assert int(worker["interval"].removesuffix("s")) >= 30, "each takes half a second of processor time"
    assert int(worker["timeout"].removesuffix("s")) > 2 * TIMEOUT_SECONDS
    assert services["ray-token"]["healthcheck"] == {"disable": True}


@pytest.mark.parametrize("name", SERVICES)
def test_the_image_can_be_named_by_its_digest(services: dict[str, dict[str, Any]], name: str) -> None:
    assert services[name]["image"] == "${WINGFIT_IMAGE:-wingfit}"
    assert services[name]["build"] == "."


def test_threads_are_limited_by_the_evaluator_alone() -> None:
    assert "OMP_NUM_THREADS" not in (REPOSITORY / "docker-compose.yml").read_text()


def test_the_workers_do_the_computing(services: dict[str, dict[str, Any]]) -> None:
    assert "--num-cpus=0" in services["api"]["command"]
    assert "--num-cpus=0" in services["ray-head"]["command"]
    assert "--include-dashboard=false" in services["ray-head"]["command"]
    assert services["api"]["environment"]["WINGFIT_RAY_ADDRESS"] == "ray-head:6379"
    assert "data:/data" in services["api"]["volumes"]


def test_the_image_holds_every_part_of_the_package() -> None:
    """The folders at the top that wingfit/ links to, and wingfit/ itself; what is not copied is not sent either."""
    parts = {"wingfit", *(link.name for link in (REPOSITORY / "wingfit").iterdir() if link.is_symlink())}
    copied = re.findall(
        r"^COPY --chown=wingfit:wingfit (\w+) \1$", (REPOSITORY / "Dockerfile").read_text(), re.MULTILINE
    )
    sent = re.findall(r"^!(\w+)$", (REPOSITORY / ".dockerignore").read_text(), re.MULTILINE)
    assert "inference" in parts
    assert set(copied) == parts
    assert parts <= set(sent)


def test_the_image_does_not_run_as_root() -> None:
    lines = (REPOSITORY / "Dockerfile").read_text().splitlines()
    users = [line for line in lines if line.startswith("USER ")]
    assert users == ["USER wingfit"]
    assert lines.index("USER wingfit") < next(i for i, line in enumerate(lines) if line.startswith("CMD"))


PINNED = re.compile(r"^ARG PYTHON_IMAGE=python:3\.11-slim@sha256:[0-9a-f]{64}$", re.MULTILINE)
OTHER = "sha256:" + "5" * 64


def test_the_base_image_is_named_by_digest() -> None:
    text = (REPOSITORY / "Dockerfile").read_text()
    assert PINNED.search(text)
    assert re.findall(r"^FROM (.*)$", text, re.MULTILINE) == ["${PYTHON_IMAGE}"]


def make(target: str, folder: Path, answer: str = "") -> subprocess.CompletedProcess[str]:
    """``make target`` on a copy of the Dockerfile, with a ``docker`` that prints ``answer``."""
    for name in ("Makefile", "Dockerfile"):
        if not (folder / name).exists():
            shutil.copy(REPOSITORY / name, folder)
    docker = folder / "docker"
    docker.write_text(f'#!/bin/sh\necho "$@" >> "{folder}/calls"\n{answer or "exit 1"}\n')
    docker.chmod(0o755)
    environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"}
    environment = {name: value for name, value in environment.items() if not name.startswith("MAKE")}
    return subprocess.run(["make", target], cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_the_newest_base_image_is_pinned_by_one_command(tmp_path: Path) -> None:
    assert make("pin-image", tmp_path, f"echo {OTHER}").returncode == 0
    text = (tmp_path / "Dockerfile").read_text()
    assert f"ARG PYTHON_IMAGE=python:3.11-slim@{OTHER}\n" in text
    assert PINNED.sub("", text) == PINNED.sub("", (REPOSITORY / "Dockerfile").read_text())
    assert (tmp_path / "calls").read_text().startswith("buildx imagetools inspect python:3.11-slim ")
    assert make("check-image", tmp_path).returncode == 0


@pytest.mark.parametrize("answer", ["", "echo", "echo latest", "echo sha256:12"])
def test_nothing_is_pinned_without_a_digest(tmp_path: Path, answer: str) -> None:
    assert make("pin-image", tmp_path, answer).returncode != 0
    assert (tmp_path / "Dockerfile").read_text() == (REPOSITORY / "Dockerfile").read_text()


def test_a_base_image_without_a_digest_is_reported(tmp_path: Path) -> None:
    (tmp_path / "Dockerfile").write_text("ARG PYTHON_IMAGE=python:3.11-slim\nFROM ${PYTHON_IMAGE}\n")
    done = make("check-image", tmp_path)
    assert done.returncode != 0
    assert "make pin-image" in done.stderr


def test_what_the_image_copies_is_what_the_build_may_see() -> None:
    copied = re.findall(r"^COPY (?:--\S+ )?(.+) \S+$", (REPOSITORY / "Dockerfile").read_text(), re.MULTILINE)
    ignore = (REPOSITORY / ".dockerignore").read_text().splitlines()
    assert {name for line in copied for name in line.split()} == {n[1:] for n in ignore if n.startswith("!")}
    assert "*" in ignore


def pins() -> dict[str, str]:
    lines = (REPOSITORY / "requirements.lock").read_text().splitlines()
    found = {}
    for line in lines:
        if line and not line.startswith("#"):
            pin = re.fullmatch(r"([a-z0-9.-]+)(?:\[[a-z,-]+\])?==([^\s;@/]+)(?: ; .+)?", line)
            assert pin, f"not a bare pin: {line!r}"
            found[pin.group(1)] = pin.group(2)
    return found


def test_the_lock_file_has_versions_but_no_index() -> None:
    text = (REPOSITORY / "requirements.lock").read_text()
    assert pins()
    assert not re.search(r"://|--|\s@\s|index|find-links", text)


def test_the_lock_file_covers_all_requirements() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    wanted = project["dependencies"] + project["optional-dependencies"]["dev"]
    names = {re.split(r"[\[<>=;~! ]", line, maxsplit=1)[0].lower().replace("_", "-") for line in wanted}
    assert names - set(pins()) == set()
