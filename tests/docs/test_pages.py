"""Every code block of README.md and docs/ is run or checked, and prints what the page shows."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.docs.comparison import difference
from tests.docs.existing_commands import mistake
from tests.docs.pages import PAGES, ROOT, blocks, commands, inline_code, tokens
from tests.docs.session import Session
from tests.service.processes import free_port

jsonschema: Any = import_module("jsonschema")
RUNNING = [page for page in PAGES if any(block.language != "formula" and not block.reason for block in blocks(page))]
OWN = re.compile(r"(wingfit (?!dataset\b)[a-z]|make [a-z]|python -m (benchmarks|examples|wingfit|docs)\b)")
CHECKED = [block for page in PAGES for block in blocks(page) if block.reason]


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The server that the documents tell their readers to start."""
    folder, port = tmp_path_factory.mktemp("server"), free_port()
    command = [sys.executable, "-m", "wingfit.cli.main", "serve", "--data", "wingfit-data", "--port", str(port)]
    with (folder / "log").open("wb") as log:
        server = subprocess.Popen(command, cwd=folder, env=_environment(), stdout=log, stderr=log)
    try:
        deadline = time.monotonic() + 120
        while not _ready(f"http://127.0.0.1:{port}"):
            assert server.poll() is None, (folder / "log").read_text()
            assert time.monotonic() < deadline, (folder / "log").read_text()
            time.sleep(0.1)
        yield f"http://127.0.0.1:{port}"
    finally:
        server.terminate()
        server.wait(30)


def _environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": str(ROOT)}


def _ready(url: str) -> bool:
    try:
        return httpx.get(f"{url}/v1/ready").status_code == 200
    except httpx.TransportError:
        return False


def _free_names(url: str) -> None:
    """Rename the datasets of earlier pages: readers of one page have none, and the server numbers names in use."""
    for dataset in httpx.get(f"{url}/v1/datasets?limit=100").json()["items"]:
        name = {"name": f"of an earlier page, {dataset['id']}"}
        httpx.patch(f"{url}/v1/datasets/{dataset['id']}", json=name).raise_for_status()


@pytest.mark.parametrize("page", RUNNING)
def test_the_blocks_of_a_page_run_and_print_what_it_shows(page: str, url: str, tmp_path: Path) -> None:
    _free_names(url)
    session = Session(tmp_path, url)
    failures = []
    for block in blocks(page):
        if block.model:
            failures += _schema_errors(url, block.model, block.text)
        elif not block.reason:
            failures += session.run(block)
    assert not failures, "\n\n".join(failures)
    if session.skipped:
        pytest.skip(f"curl is not installed; all else ran but {session.skipped}")


def _schema_errors(url: str, name: str, text: str) -> list[str]:
    description: dict[str, Any] = httpx.get(f"{url}/openapi.json").json()
    schema = {"$ref": f"#/components/schemas/{name}", "components": description["components"]}
    return [
        f"{name}: {error.message}" for error in jsonschema.Draft202012Validator(schema).iter_errors(json.loads(text))
    ]


@pytest.mark.parametrize("block", CHECKED, ids=lambda block: block.place)
def test_the_commands_of_a_block_that_is_not_run_exist(block: Any) -> None:
    assert block.language in ("sh", "console", "python", "yaml", "toml", "text", "")
    named = [
        command for command, _ in commands(block) if block.language in ("sh", "console") or OWN.match(command.strip())
    ]
    mistakes = [f"{command}: {mistake(command)}" for command in named if mistake(command)]
    assert not mistakes, mistakes


@pytest.mark.parametrize("page", PAGES)
def test_the_commands_within_the_text_exist(page: str) -> None:
    named = [code for code in inline_code(page) if OWN.match(code) and not re.search(r"[|…]|\.\.\.|NAME\b", code)]
    mistakes = [f"{code}: {mistake(code)}" for code in named if mistake(code)]
    assert not mistakes, mistakes


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_files_and_headings_that_exist(page: str) -> None:
    children = [child for token in tokens(page) for child in token.children or ()]
    links = [str(child.attrs.get("href") or child.attrs.get("src") or "") for child in children]
    for link in links:
        target, _, anchor = link.partition("#")
        if not link or "://" in link or link.startswith("/"):
            continue
        path = (ROOT / page).parent / target if target else ROOT / page
        assert path.exists(), f"{page}: {link}"
        if anchor:
            assert anchor in _anchors(path.resolve().relative_to(ROOT).as_posix()), f"{page}: {link}"


def test_the_lists_of_folders_and_pages_are_complete() -> None:
    folders = {
        path.parent.name for path in ROOT.glob("*/*") if path.suffix in (".py", ".md", ".yml") or path.is_symlink()
    }
    folders -= {name for name in folders if name.startswith((".", "build"))}
    missing = [name for name in sorted(folders) if f"`{name}/`" not in _text("README.md")]
    assert not missing, f"README.md, Folders, does not list {missing}"
    listed = _text("docs/README.md")
    pages = [page.removeprefix("docs/") for page in PAGES if page.startswith("docs/") and "/effects/" not in page]
    missing = [page for page in pages if page != "README.md" and f"({page})" not in listed]
    assert not missing, f"docs/README.md does not list {missing}"


def _anchors(page: str) -> set[str]:
    """Anchors as code hosts make them of headings."""
    every = list(tokens(page))
    titles = [inline.content for token, inline in pairwise(every) if token.type == "heading_open"]
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def test_every_block_is_run_or_checked_for_a_reason() -> None:
    every = [block for page in PAGES for block in blocks(page)]
    fences = [line for page in PAGES for line in _text(page).splitlines() if line.lstrip().startswith("```")]
    assert len([block for block in every if block.language not in ("", "formula")]) == len(fences) / 2, (
        "a fence has no language"
    )
    command = re.compile(r"^\s*(\$ |wingfit |make |python |curl |docker |import )", re.MULTILINE)
    hidden = [block.place for block in every if block.language == "formula" and command.search(block.text)]
    assert not hidden, f"these blocks hold commands and need a fence with a language: {hidden}"
    too_short = [block.place for block in CHECKED if len(block.reason) < 15]
    assert not too_short, f"say why these blocks are not run: {too_short}"
    assert len(CHECKED) <= len(every) / 2, "most blocks must run"


def _text(page: str) -> str:
    return (ROOT / page).read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("best 2.75 mN", "best 2.76 mN", True),
        ("best 2.75 mN", "best 2.95 mN", False),
        ("best 2.75 mN", "best 2.75 mm", False),
        ("a   b\n...\nz", "a b\nc\nd\nz", True),
        ("a\n...\nz", "a\nc", False),
        ("wrote ... in 3 s", "wrote a file in 3 s", True),
        ("run_0123456789abcdef of 6e+06", "run_fedcba9876543210 of 6.01e+06", True),
    ],
)
def test_outputs_are_compared_with_a_tolerance(shown: str, printed: str, same: bool) -> None:
    assert (difference(shown, printed) == "") is same


@pytest.mark.parametrize(
    "command",
    [
        "wingfit runs sumbit ID",
        "wingfit diagnose x --locally",
        "make dmeo",
        "python -m benchmarks.calibraton",
        "wingfitt",
    ],
)
def test_a_command_that_does_not_exist_is_noticed(command: str) -> None:
    assert mistake(command)
