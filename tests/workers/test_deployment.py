"""What the files of the deployment promise: Ray is out of reach, versions are pinned, nothing local gets in."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from benchmarks.ray_nodes import REPOSITORY

# Head, object manager and node manager (by convention), client, dashboard, its agents, and the range of workers.
RAY_PORTS = {6379, 8076, 8077, 8265, 10001, 52365, *range(10002, 20000)}
RAY_SERVICES = ("ray-head", "ray-worker", "api")


@pytest.fixture(scope="module")
def compose() -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((REPOSITORY / "docker-compose.yml").read_text())
    return content


@pytest.fixture(scope="module")
def services(compose: dict[str, Any]) -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = compose["services"]
    return found


def test_only_the_api_is_published_and_only_on_loopback(services: dict[str, dict[str, Any]]) -> None:
    for name, service in services.items():
        assert "network_mode" not in service or service["network_mode"] == "none", name
        if name != "api":
            assert "ports" not in service, name
    (port,) = services["api"]["ports"]
    address, outer, inner = re.fullmatch(r"([\d.]+):\$\{WINGFIT_PORT:-(\d+)\}:(\d+)", port).groups()  # type: ignore[union-attr]
    assert address == "127.0.0.1"
    assert not {int(outer), int(inner)} & RAY_PORTS


def test_ray_lives_on_an_internal_network(compose: dict[str, Any], services: dict[str, dict[str, Any]]) -> None:
    assert compose["networks"]["cluster"]["internal"] is True
    assert services["ray-head"]["networks"] == services["ray-worker"]["networks"] == ["cluster"]
    assert sorted(services["api"]["networks"]) == ["cluster", "front"]


@pytest.mark.parametrize("name", RAY_SERVICES)
def test_every_member_shows_the_token_and_cannot_change_it(services: dict[str, dict[str, Any]], name: str) -> None:
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


@pytest.mark.parametrize("name", [*RAY_SERVICES, "ray-token"])
def test_no_container_has_more_rights_than_it_needs(services: dict[str, dict[str, Any]], name: str) -> None:
    service = services[name]
    assert service["cap_drop"] == ["ALL"]
    assert "no-new-privileges:true" in service["security_opt"]
    assert not {"privileged", "cap_add", "pid", "user"} & set(service)


def test_the_work_is_done_by_the_workers(services: dict[str, dict[str, Any]]) -> None:
    assert "--num-cpus=0" in services["api"]["command"]
    assert "--num-cpus=0" in services["ray-head"]["command"]
    assert "--include-dashboard=false" in services["ray-head"]["command"]
    assert services["api"]["environment"]["WINGFIT_RAY_ADDRESS"] == "ray-head:6379"
    assert "data:/data" in services["api"]["volumes"]


def test_the_image_does_not_run_as_root() -> None:
    lines = (REPOSITORY / "Dockerfile").read_text().splitlines()
    users = [line for line in lines if line.startswith("USER ")]
    assert users == ["USER wingfit"]
    assert lines.index("USER wingfit") < next(i for i, line in enumerate(lines) if line.startswith("CMD"))


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


def test_the_lock_names_versions_and_no_place_to_get_them_from() -> None:
    text = (REPOSITORY / "requirements.lock").read_text()
    assert pins()
    assert not re.search(r"://|--|\s@\s|index|find-links", text)


def test_the_lock_covers_everything_that_the_project_asks_for() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    wanted = project["dependencies"] + project["optional-dependencies"]["dev"]
    names = {re.split(r"[\[<>=;~! ]", line, maxsplit=1)[0].lower().replace("_", "-") for line in wanted}
    assert names - set(pins()) == set()
