"""Structured output: JSON schemas to ask with, strict types to read answers with."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from typing import Any, Literal, TypeVar

import msgspec

from keyexpr_schema.ids import Id

MAX_ENUMERATED = 100
"""Names of one kind that are listed in a schema; with more, any id fits, and the reader checks."""
MAX_STARTS = 50
"""Places in an answer where a JSON object is looked for."""

T = TypeVar("T")


class StructuredAnswer(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of what a model may say: a field that is not asked for is an error."""


def enumerated(names: Collection[str]) -> Any:
    """The type of one of these names, for a schema."""
    return Literal[tuple(names)] if 0 < len(names) <= MAX_ENUMERATED else Id


def schema_of(kind: type) -> dict[str, Any]:
    """The JSON schema of a type in the dialect that structured outputs take everywhere.

    No references, no defaults, every field required, no other field allowed.
    """
    schema = msgspec.json.schema(kind)
    return dict(_plain(schema, schema.get("$defs", {})))


def _plain(node: Any, types: Mapping[str, Any]) -> Any:
    if isinstance(node, list):
        return [_plain(item, types) for item in node]
    if not isinstance(node, dict):
        return node
    if "$ref" in node:
        return _plain(types[node["$ref"].removeprefix("#/$defs/")], types)
    plain = {
        key: {name: _plain(value, types) for name, value in inner.items()}
        if key == "properties"
        else _plain(inner, types)
        for key, inner in node.items()
        if key not in ("$defs", "title", "description", "default", "discriminator")
    }
    if all(isinstance(value, str) for value in plain.get("enum", [None])):
        plain["type"] = "string"
    if "properties" in plain:
        plain["required"] = list(plain["properties"])
        plain["additionalProperties"] = False
    return plain


def read_answer(text: str, kind: type[T]) -> T | str:
    """The JSON object in a model's answer as a `kind`, or a sentence that says what is wrong.

    Text around the object (reasoning, code fences) is passed over.
    """
    wrong, read = "the answer is not a JSON object", 0
    decoder = json.JSONDecoder()
    start = text.find("{")
    for _ in range(MAX_STARTS):
        if start < 0:
            break
        try:
            data, end = decoder.raw_decode(text, start)
            return msgspec.convert(data, kind)
        except msgspec.ValidationError as error:
            reason = f"the answer does not have the form that was asked for: {error}"
            got = end - start
        except json.JSONDecodeError as error:
            reason = f"the answer is not a JSON object: {error}"
            got, end = error.pos - start, start + 1
        except RecursionError:
            return "the answer is nested too deeply"
        except ValueError as error:
            # Python refuses to read integers of absurd length.
            return f"the answer is not a JSON object: {error}"
        # What went furthest was meant as the answer; shorter ones are pieces of it or of prose.
        if got > read:
            wrong, read = reason, got
        start = text.find("{", end)
    return wrong
