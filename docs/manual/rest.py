"""Writes the reference of the REST API from the description that the server gives of itself (OpenAPI)."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

from wingfit.service.app import create_app
from wingfit.service.settings import Settings

Json = dict[str, Any]
_HEAD = """# REST API: every call

Generated from the description that a running server gives at `/openapi.json`. [REST API](../docs/api.md) explains the
calls in the order in which one uses them. Every call may also answer an error as problem details (RFC 9457)."""
_TAGLESS = "other"
_DEEP = 3  # levels of a schema that a cell of a table spells out


def page() -> str:
    """Return the page in Markdown: every call by subject, then every schema that a call takes."""
    description = create_app(Settings(data=Path("unused"))).openapi()
    by_tag: dict[str, list[str]] = defaultdict(list)
    for path, methods in sorted(description["paths"].items()):
        for method, call in methods.items():
            by_tag[(call.get("tags") or [_TAGLESS])[0]].append(_call(f"{method.upper()} {path}", call))
    parts = [_HEAD]
    for tag, calls in sorted(by_tag.items()):
        parts += [f"## {tag.capitalize()}", *calls]
    parts += ["## Schemas", *(_schema(*one) for one in sorted(description["components"]["schemas"].items()))]
    return "\n\n".join(parts) + "\n"


def _call(title: str, call: Json) -> str:
    parts = [f"### `{title}`", f"{_text(call.get('description') or call.get('summary', ''))}"]
    rows = [
        f"| `{one['name']}` | {one['in']} | {_type(one['schema'])} | "
        f"{_text(one.get('description', ''))}{_limits(one['schema'], required=one.get('required', False))} |"
        for one in call.get("parameters", [])
    ]
    if rows:
        parts.append("\n".join(["| parameter | in | type | meaning |", "|---|---|---|---|", *rows]))
    body = call.get("requestBody", {}).get("content", {})
    if body:
        parts.append("Takes " + ", or ".join(f"{_type(one['schema'])} as `{kind}`" for kind, one in body.items()) + ".")
    answers = [_answer(status, one) for status, one in call["responses"].items() if status[0] in "23"]
    return "\n\n".join([*parts, "Answers " + "; ".join(answers) + "."])


def _answer(status: str, response: Json) -> str:
    kinds = [
        f"{_type(one['schema'])} as `{kind}`" if one.get("schema") else f"`{kind}`"
        for kind, one in response.get("content", {}).items()
    ]
    return f"{status}" + (": " + ", or ".join(kinds) if kinds else "")


def _schema(name: str, schema: Json) -> str:
    parts = [f"### {name}", _text(schema.get("description", ""))]
    needed = schema.get("required", [])
    rows = [
        f"| `{field}` | {_type(one)} | {_text(one.get('description', ''))}{_limits(one, required=field in needed)} |"
        for field, one in schema.get("properties", {}).items()
    ]
    if rows:
        parts.append("\n".join(["| field | type | meaning |", "|---|---|---|", *rows]))
    else:
        parts.append(f"Is {_type(schema)}.")
    return "\n\n".join(part for part in parts if part)


def _type(schema: Json, depth: int = 0) -> str:
    """Return the type of ``schema`` in Markdown, with links to the schemas that it names."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    for key in ("anyOf", "oneOf", "allOf"):
        if key in schema:
            return " or ".join(dict.fromkeys(_type(one, depth) for one in schema[key]))
    if "enum" in schema:
        return " or ".join(f"`{value}`" for value in schema["enum"])
    if "const" in schema:
        return f"`{schema['const']}`"
    kind = str(schema.get("type", "any"))
    if kind == "array" and "items" in schema and depth < _DEEP:
        return f"array of {_type(schema['items'], depth + 1)}"
    if kind == "object" and isinstance(schema.get("additionalProperties"), dict) and depth < _DEEP:
        return f"object of {_type(schema['additionalProperties'], depth + 1)}"
    return kind


def _limits(schema: Json, *, required: bool) -> str:
    names = {"minimum": "from", "maximum": "to", "minItems": "at least", "maxItems": "at most"}
    found = [f"{words} {schema[key]:g}" for key, words in names.items() if key in schema]
    found += ["required"] if required else []
    default = schema.get("default")
    found += [f"default `{default}`"] if default not in (None, [], {}, "") else []
    return f" ({', '.join(found)})" if found else ""


def _text(words: str) -> str:
    """Return ``words`` for a cell of a table or a paragraph: on one line, no sign read as Markdown."""
    flat = " ".join(words.split())
    for sign in "\\*_<[|":
        flat = flat.replace(sign, f"\\{sign}")
    return flat
