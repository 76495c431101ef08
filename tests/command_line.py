"""Commands run in this process, as the command line runs them."""

from __future__ import annotations

from collections.abc import Callable

import typer
from typer.testing import CliRunner

from wingfit.client.client import WingfitError

Wingfit = Callable[..., tuple[int, str, str]]


def in_process(app: typer.Typer) -> Wingfit:
    """A function that runs ``app`` with words, and returns exit code, standard output, and errors."""

    def run(*words: object) -> tuple[int, str, str]:
        result = CliRunner().invoke(app, [str(word) for word in words])
        if isinstance(result.exception, WingfitError):
            return 1, result.stdout, str(result.exception)
        return result.exit_code, result.stdout, result.stderr

    return run
