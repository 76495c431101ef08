"""Whether commands exist and take the options that a page gives them, without running them."""

from __future__ import annotations

import re
import shlex
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import typer

from tests.docs.pages import ROOT
from wingfit.cli.main import app

# Programs of others that the documents call; what they are given is theirs to check.
OTHERS = {"cd", "chmod", "cp", "curl", "docker", "export", "git", "kubectl", "mkdir", "openssl", "pip", "ray", "sbatch"}
OTHERS |= {"scancel", "sed", "squeue", "srun", "ssh", "sudo", "systemctl", "tail", "umask"}


def mistake(command: str) -> str:
    """What is wrong with a command line of a page, or nothing."""
    words = shlex.split(command, comments=True)
    while words and re.fullmatch(r"[A-Z_]+=.*", words[0]):
        words.pop(0)
    match words:
        case ["wingfit", *rest]:
            return _wingfit(rest)
        case ["make", *targets]:
            makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
            missing = [
                t for t in targets if "=" not in t and not re.search(rf"^{re.escape(t)}:", makefile, re.MULTILINE)
            ]
            return f"the Makefile has no target {missing}" if missing else ""
        case ["python", "-m", module, *rest]:
            return _module(module, rest)
        case [program, *_] if program in OTHERS or program == ".":
            return ""
        case _:
            return f"{words[:1]} is not a known program"


def _wingfit(words: list[str]) -> str:
    command: Any = typer.main.get_command(app)  # of the click that typer brings, which has no types
    context = command.context_class(command, info_name="wingfit")
    while hasattr(command, "commands"):
        if not words or words[0].startswith("-"):
            return "" if words in ([], ["--help"], ["--version"]) else f"wingfit has no option {words[0]}"
        if words[0] not in command.commands:
            return f"{context.command_path} has no command {words[0]!r}"
        command, words = command.commands[words[0]], words[1:]
        context = command.context_class(command, parent=context, info_name=command.name)
    options = {name for parameter in command.params for name in (*parameter.opts, *parameter.secondary_opts)}
    unknown = [word for word in words if word.startswith("-") and word.split("=")[0] not in {*options, "--help"}]
    return f"{context.command_path} has no options {unknown}" if unknown else ""


def _module(module: str, words: list[str]) -> str:
    if find_spec(module.split(".")[0]) is None or (spec := find_spec(module)) is None or spec.origin is None:
        return f"there is no module {module}"
    path = Path(spec.origin)
    sources = path.parent.glob("*.py") if path.name == "__init__.py" else [path]
    text = "\n".join(source.read_text(encoding="utf-8") for source in sources)
    for shared in re.findall(r"^from (benchmarks\.\w+\.command) import", text, re.MULTILINE):
        text += Path(ROOT, *shared.split(".")).with_suffix(".py").read_text(encoding="utf-8")
    if module.startswith("benchmarks."):
        text += '"--json"'
    missing = [word for word in words if word.startswith("--") and f'"{word}"' not in text]
    return f"{module} has no options {missing}" if missing else ""
