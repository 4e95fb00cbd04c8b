"""The keys of JSON files, from their schemas."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.resources import files
from typing import Any


def page() -> str:
    """Return the page: a table for each schema."""
    parts = [
        "# Keys of JSON files",
        "Generated from the schemas in `anglecam/io/schemas`. `[]` stands for each item of a list.",
    ]
    for path in sorted((files("anglecam.io") / "schemas").iterdir(), key=lambda path: path.name):
        schema = json.loads(path.read_text())
        rows = "\n".join(_rows(schema, schema, ""))
        parts.append(
            f"## {schema['title']}\n\n{schema['description']} Schema: [{path.name}](../schemas/{path.name}).\n\n"
            f"| key | meaning | unit |\n| --- | --- | --- |\n{rows}"
        )
    return "\n\n".join(parts) + "\n"


def _rows(schema: dict[str, Any], part: dict[str, Any], path: str) -> Iterator[str]:
    """Yield a row for each key below a part of a schema."""
    reference = part.get("$ref", "")
    if reference.startswith("#/$defs/"):
        part = schema["$defs"][reference.rpartition("/")[2]] | {"description": part.get("description")}
    inner = [(f"{path}.{key}".lstrip("."), value) for key, value in part.get("properties", {}).items()]
    if isinstance(part.get("additionalProperties"), dict):
        inner.append((f"{path}.NAME".lstrip("."), part["additionalProperties"]))
    for key, value in inner:
        described = value.get("description")
        other = value.get("$ref", "")
        if described:
            link = f" (see {other.partition('.schema')[0]})" if other.endswith(".json") else ""
            yield f"| `{key}` | {described.replace('|', chr(92) + '|')}{link} | {value.get('unit', '')} |"
        yield from _rows(schema, value, key)
    if isinstance(part.get("items"), dict):
        yield from _rows(schema, part["items"], f"{path}[]")
