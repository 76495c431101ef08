"""Type of what a user is asked about a file of a tracking system."""

from __future__ import annotations

from typing_extensions import TypedDict


class ImportQuestion(TypedDict):
    """An option that the file does not state, and that must be given.

    ``option``: name of the form field; ``message``: why it is needed; ``choices``: the values it may have, none for any
    number or text; ``hint``: a fact that helps to choose.
    """

    option: str
    message: str
    choices: list[str]
    hint: str
