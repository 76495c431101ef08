"""The run-time type checker of tests. It checks the shape of an array where ``Float[Array, "T C"]`` names one."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any, TypeVar

from beartype import BeartypeConf, beartype

F = TypeVar("F", bound=Callable[..., Any])

_NAMES_A_SHAPE = re.compile(r"\b(?:Bool|Complex|Float|Int)\[")
# An int is admitted where a float is declared, as in mypy.
_check = beartype(conf=BeartypeConf(is_pep484_tower=True))


def checked(function: F) -> F:
    """``function`` with its arguments and result checked at every call, if one of its annotations names a shape."""
    annotations = " ".join(str(annotation) for annotation in function.__annotations__.values())
    return _check(function) if _NAMES_A_SHAPE.search(annotations) else function
