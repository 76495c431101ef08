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
    """``function`` with those arguments, and that result, checked at every call whose annotations name a shape.

    mypy checks all others. At run time they may be stand-ins of a test, or of a protocol that cannot be checked.
    """
    every = function.__annotations__
    function.__annotations__ = {name: one for name, one in every.items() if _NAMES_A_SHAPE.search(str(one))}
    found = _check(function) if function.__annotations__ else function
    function.__annotations__ = found.__annotations__ = every
    return found
