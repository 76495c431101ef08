"""The subset of YAML that the dataset format uses: plain data with the line of every key, numbers as decimals.

Anchors, aliases, tags, several documents and repeated keys are refused; ``yes``, ``12:30``, dates are text, as in
YAML 1.2. The data are built from parser events, so that no object is constructed from a tag.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

import yaml

from wingfit.records.errors import DatasetError, check_most, decode, fail
from wingfit.records.limits import MAX_DEPTH, MAX_DESCRIPTION_BYTES, MAX_ITEMS, MIB
from wingfit.records.units import number_text

Path = tuple[str | int, ...]
NUMBER = re.compile(r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]{1,6})?")
MAX_NUMBER_LENGTH = 400
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_WORDS: dict[str, object] = {"true": True, "false": False, "null": None, "~": None, "": None}


@dataclass(frozen=True)
class Document:
    """A parsed YAML ``file``: plain ``data``; ``places`` has line and column (from 1) of every key and item."""

    file: str
    data: Any
    places: dict[Path, tuple[int, int]] = field(default_factory=dict)

    def where(self, path: Path) -> str:
        """Return file, line, column and dotted key of ``path`` as text; a missing key has its parent's position."""
        known = path
        while known and known not in self.places:
            known = known[:-1]
        line = f", line {self.places[known][0]}, column {self.places[known][1]}" if known in self.places else ""
        key = dotted(path)
        return f"{self.file}{line}: {key}" if key else f"{self.file}{line}"

    def names(self, *path: str) -> list[str]:
        """Return the value of ``name`` of each mapping in the list at ``path``; the data need not have been checked."""
        data = self.data
        for key in path:
            data = data.get(key) if isinstance(data, dict) else None
        entries = data if isinstance(data, list) else []
        return [str(entry.get("name")) for entry in entries if isinstance(entry, dict)]


def dotted(path: Path) -> str:
    """Write a path as text: ``("wing", "stations", 2, "chord_m")`` gives ``wing.stations[2].chord_m``."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")


def read_yaml(raw: bytes, file: str) -> Document:
    """Parse the contents ``raw`` of ``file``; DatasetError if it is not the plain YAML that the format uses."""
    check_most(file, "is", len(raw) / MIB, MAX_DESCRIPTION_BYTES / MIB, "MiB", "put samples in CSV")
    text = decode(raw, file)
    try:
        return _Builder(file, yaml.parse(text, Loader=_LOADER)).document()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{file}, line {mark.line + 1}, column {mark.column + 1}" if mark else file
        message = f"not valid YAML: {error.problem or error.context}; check indentation, colons and quotes"
        raise fail(place, None, message) from None
    except yaml.YAMLError as error:
        summary = " ".join(str(error).split())
        raise fail(file, None, f"not valid YAML: {summary}; remove control characters") from None


def write_yaml(data: object) -> str:
    """Write ``data`` (mappings, lists, text, numbers) as YAML that :func:`read_yaml` reads back unchanged."""
    return str(yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=118, default_flow_style=None))


class _Builder:
    """Builds plain data from the events of the YAML parser, and stores where each key and item stands."""

    def __init__(self, file: str, events: Iterator[Any]) -> None:
        self.file = file
        self.events = self._counted(
            e for e in events if not isinstance(e, (yaml.StreamStartEvent, yaml.DocumentStartEvent))
        )
        self.places: dict[Path, tuple[int, int]] = {}

    def document(self) -> Document:
        first = next(self.events)
        if isinstance(first, yaml.StreamEndEvent):
            raise fail(self.file, None, "the file is empty; see docs/formats.md for an example")
        self.places[()] = _place(first)
        data = self._value(first, ())
        next(self.events)
        extra = next(self.events)
        if not isinstance(extra, yaml.StreamEndEvent):
            raise self._error(extra, "a second YAML document starts here; keep one, without '---' lines")
        return Document(self.file, data, self.places)

    def _counted(self, events: Iterator[Any]) -> Iterator[Any]:
        """Yield the events; DatasetError for more than MAX_ITEMS: the data need far more memory than their text."""
        for number, event in enumerate(events):
            if number > MAX_ITEMS:
                raise self._error(event, f"more than {MAX_ITEMS} keys, items and values; put samples in CSV")
            yield event

    def _error(self, event: Any, message: str, value: object = None) -> DatasetError:
        line, column = _place(event)
        return fail(f"{self.file}, line {line}, column {column}", value, message)

    def _value(self, event: Any, path: Path) -> object:
        if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
            name = event.anchor
            raise self._error(event, f"anchors and aliases (&{name}, *{name}) are not read; write the values out", name)
        if event.tag is not None:
            raise self._error(event, f"tag {event.tag!r} is not read; write the plain value", event.tag)
        if len(path) > MAX_DEPTH:
            raise self._error(event, f"nested deeper than {MAX_DEPTH} levels; see docs/formats.md for the layout")
        if isinstance(event, yaml.MappingStartEvent):
            return self._mapping(path)
        if isinstance(event, yaml.SequenceStartEvent):
            return self._sequence(path)
        return self._scalar(event)

    def _mapping(self, path: Path) -> dict[str, object]:
        result: dict[str, object] = {}
        while not isinstance(event := next(self.events), yaml.MappingEndEvent):
            if not isinstance(event, yaml.ScalarEvent):
                raise self._error(event, "a key must be a plain name")
            key = event.value
            if key in result:
                first = self.places[(*path, key)][0]
                raise self._error(event, f"key {key!r} is repeated here, after line {first}; keep one", key)
            self.places[(*path, key)] = _place(event)
            result[key] = self._value(next(self.events), (*path, key))
        return result

    def _sequence(self, path: Path) -> list[object]:
        result: list[object] = []
        while not isinstance(event := next(self.events), yaml.SequenceEndEvent):
            item = (*path, len(result))
            self.places[item] = _place(event)
            result.append(self._value(event, item))
        return result

    def _scalar(self, event: Any) -> object:
        text = event.value
        if event.style not in (None, ""):
            return text
        if text in _WORDS:
            return _WORDS[text]
        if NUMBER.fullmatch(text):
            if len(text) > MAX_NUMBER_LENGTH:
                message = f"a number of {len(text)} digits; at most {MAX_NUMBER_LENGTH} characters: round it"
                raise self._error(event, message, text)
            return Decimal(text)
        return text


def _place(event: Any) -> tuple[int, int]:
    return event.start_mark.line + 1, event.start_mark.column + 1


class _Dumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:  # noqa: ARG002
        return True


def _represent_number(dumper: yaml.SafeDumper, value: Decimal) -> yaml.ScalarNode:
    text = number_text(value)
    tag = dumper.resolve(yaml.ScalarNode, text, (True, False))  # type: ignore[no-untyped-call]
    return yaml.ScalarNode(tag, text)


# Text such as "1e5" must be quoted: it is a number to this reader, but not in YAML 1.1.
_Dumper.add_implicit_resolver("tag:yaml.org,2002:float", re.compile(f"^(?:{NUMBER.pattern})$"), list("-+.0123456789"))
_Dumper.add_representer(Decimal, _represent_number)
