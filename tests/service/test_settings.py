"""Settings of a server: every value is read as it is written, or the server refuses to start."""

from __future__ import annotations

import os
import re
import socket
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from wingfit.cli.main import app as commands
from wingfit.service.server import ServeError, serve
from wingfit.service.settings import Settings, SettingsError
from wingfit.workers.jobs import MOST_STARTS

ROOT = Path(__file__).parents[2]
SPELLINGS = [("1 true yes y on TRUE Yes Y oN", True), ("0 false no n off FALSE No N oFF", False)]


@pytest.mark.parametrize(
    ("text", "expected"), [(text, expected) for texts, expected in SPELLINGS for text in texts.split()]
)
@pytest.mark.parametrize(
    ("name", "field"), [("WINGFIT_REQUIRE_KEYS", "require_keys"), ("WINGFIT_ALLOW_REMOTE", "allow_remote")]
)
def test_yes_and_no_have_several_spellings(name: str, field: str, text: str, *, expected: bool) -> None:
    assert getattr(Settings.from_env({name: text}), field) is expected
    assert getattr(Settings.from_env({name: f" {text} "}), field) is expected


@pytest.mark.parametrize("name", ["WINGFIT_REQUIRE_KEYS", "WINGFIT_ALLOW_REMOTE"])
def test_neither_yes_nor_no_is_refused(name: str) -> None:
    for text in ("ja", "2", "enable", "-", "yess", "none"):
        with pytest.raises(SettingsError) as refused:
            Settings.from_env({name: text})
        for part in (name, repr(text), "1, true, yes, y, on (yes)", "0, false, no, n, off (no)"):
            assert part in str(refused.value)
    for text in ("", "  "):
        assert Settings.from_env({name: text}) == Settings.from_env({})


def test_a_variable_that_nothing_reads_is_refused_with_the_nearest_name() -> None:
    for name, nearest in (("WINGFIT_REQUIRE_KEY", "WINGFIT_REQUIRE_KEYS"), ("WINGFIT_KEEPDAYS", "WINGFIT_KEEP_DAYS")):
        with pytest.raises(SettingsError, match=f"{name} .did you mean '{nearest}'"):
            Settings.from_env({name: "1"})
    with pytest.raises(SettingsError, match=r"WINGFIT_A.*WINGFIT_B"):
        Settings.from_env({"WINGFIT_A": "1", "WINGFIT_B": "1"})
    assert Settings.from_env({"WINGFITTING": "1", "wingfit_port": "1", "WINGFIT_REQUIRE_KEY": ""}) == Settings.from_env(
        {}
    )


def test_every_variable_of_the_project_is_known() -> None:
    """Whatever the sources name may be in the environment of a server."""
    files = [path for path in ROOT.iterdir() if path.suffix in (".yml", ".md") or path.name == "Dockerfile"]
    for folder in ("service", "workers", "cli", "client", "benchmarks", "docs"):
        files += [path for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".md")]
    files += [path for path in (ROOT / "deploy").rglob("*") if path.is_file()]
    text = "\n".join(path.read_text() for path in files)
    names = set(re.findall(r"\bWINGFIT_[A-Z_]*[A-Z]\b", text))
    assert {"WINGFIT_URL", "WINGFIT_KEEP_DAYS", "WINGFIT_CPUS_PER_WORKER", "WINGFIT_TEST_NODE"} <= names
    for name in sorted(names):
        try:
            Settings.from_env({name: "1"})
        except SettingsError as error:
            assert "no setting of wingfit" not in str(error), name  # noqa: PT017  other refusals are fine


def test_variables_that_kubernetes_sets_are_accepted() -> None:
    links = {
        "WINGFIT_SERVICE_HOST": "10.0.0.1",
        "WINGFIT_SERVICE_PORT": "8321",
        "WINGFIT_SERVICE_PORT_HTTP": "8321",
        "WINGFIT_PORT_8321_TCP": "tcp://10.0.0.1:8321",
        "WINGFIT_PORT_8321_TCP_ADDR": "10.0.0.1",
        "WINGFIT_API_SERVICE_HOST": "10.0.0.2",
        "WINGFIT_API_PORT": "tcp://10.0.0.2:80",
    }
    assert Settings.from_env(links | {"WINGFIT_PORT": "99"}).port == 99
    with pytest.raises(SettingsError, match="enableServiceLinks"):
        Settings.from_env({"WINGFIT_PORT": "tcp://10.0.0.1:8321"})
    with pytest.raises(SettingsError, match="no setting"):
        Settings.from_env({"WINGFIT_API_PORT": "80"})


def test_a_server_refuses_and_a_client_does_not(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    started = subprocess.run(
        [sys.executable, "-m", "wingfit.service.server"],
        env=os.environ | {"WINGFIT_REQUIRE_KEY": "1", "WINGFIT_DATA": str(tmp_path / "data")},
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert started.returncode != 0
    assert "did you mean 'WINGFIT_REQUIRE_KEYS'?" in started.stderr
    assert not (tmp_path / "data").exists()
    monkeypatch.setenv("WINGFIT_REQUIRE_KEY", "1")
    refused = CliRunner().invoke(commands, ["serve", "--data", str(tmp_path / "data")])
    assert refused.exit_code == 2
    assert CliRunner().invoke(commands, ["effects", "--help"]).exit_code == 0
    away = CliRunner().invoke(commands, ["runs", "list", "--url", "http://127.0.0.1:9"])
    assert "no wingfit server answers" in str(away.exception)


def test_jobs_are_given_up_after_as_many_starts_as_their_state_machine_says() -> None:
    assert Settings.max_starts == MOST_STARTS
    assert Settings.from_env({"WINGFIT_MAX_STARTS": "7"}).max_starts == 7
    with pytest.raises(SettingsError, match=r"WINGFIT_MAX_STARTS is 0; it must lie in \[1, 1000000\]"):
        Settings.from_env({"WINGFIT_MAX_STARTS": "0"})


@pytest.mark.parametrize("text", ["\uff18\uff10", "8_0", "0x50", "8.0", "1e3", "9" * 5000, "\u0668"], ids=ascii)
def test_numbers_are_written_in_ascii_digits(text: str) -> None:
    with pytest.raises(SettingsError, match="must be a whole number, for example WINGFIT_PORT=8321"):
        Settings.from_env({"WINGFIT_PORT": text})


@pytest.mark.parametrize(
    "text",
    ["http://wings.lab", "wings.lab:80", "*.lab", "*", "[::1]", "wings lab", "a/b", "-", "\uff41.lab"],
    ids=ascii,
)
def test_impossible_host_names_are_refused(text: str) -> None:
    with pytest.raises(SettingsError, match="which no request can match"):
        Settings.from_env({"WINGFIT_ALLOWED_HOSTS": f"wings.lab,{text}"})


def test_host_names_and_addresses_are_allowed() -> None:
    names = Settings.from_env(
        {"WINGFIT_ALLOWED_HOSTS": "Wings.lab, 10.0.0.7,fe80::1, my_rig,xn--flgel-kva.de"}
    ).allowed_hosts
    assert names[3:] == ("wings.lab", "10.0.0.7", "fe80::1", "my_rig", "xn--flgel-kva.de")


def test_a_wrong_address_blames_the_host_setting(tmp_path: Path) -> None:
    for host in ("192.0.2.1", "no-such-host.invalid"):
        with pytest.raises(ServeError, match=f"cannot listen on {host}.*set WINGFIT_HOST to an address"):
            serve(Settings(data=tmp_path, host=host))
    with closing(socket.create_server(("127.0.0.1", 0))) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ServeError, match="set WINGFIT_PORT to a free port"):
            serve(Settings(data=tmp_path, port=port))
