"""Writes docs/keyspace.md from the key-space: `python -m keyexpr_schema.document`."""

from __future__ import annotations

import inspect
import re
from pathlib import Path
from typing import Any

import msgspec

from keyexpr_schema.authors import Author, Source, is_signed, structs_in
from keyexpr_schema.key import Component
from keyexpr_schema.keyspace import KEY_TREES, KEYSPACE

_PREAMBLE = """\
<!-- Written by `python -m keyexpr_schema.document` from keyexpr_schema/keyspace.py. -->

# The key-space

Every value is JSON, and its Zenoh encoding names schema and version:
`application/json;robotfleet/<name>/<version>`. A value without a schema is read, too, so
`{"goal": "g1", "text": "bring the first cup to the hallway"}` can be put by hand.

The realm (a site or a tenant) is the Zenoh session's `namespace`: on the wire `goals/g1/spec` of
realm `robotfleet` is `robotfleet/goals/g1/spec`. Ids are 1 to 63 ASCII letters, digits, `_`, `.`
or `-`, the first a letter or a digit.

What becomes of a value: *stored* values are kept by the store, the latest by Zenoh timestamp wins,
and a deletion leaves a tombstone; of *stored, latest matters* values a slow reader may miss all but
the last; *not stored* values reach whoever listens; a *liveliness token* is there while its owner
is connected; *query and reply* keys are written by who sends the query, and read by who replies.

Where there are certificates, who writes a *signed* key signs the value with its certificate's key,
since it says who it is from, in the fields of type `Author` (a person) and `Source` (a robot,
`person`, or the planner), and that it is deleted. Nothing else is taken in (decisions/0054).

A *person* uses the fleet by robotctl or a program of their own; an *own worker* is the worker of
the robot that the key names, a *worker* that of any robot. To see who uses which keys in a running
fleet, start its processes with `ROBOTFLEET_TRACE=FILE`: each session appends a line for every
operation that it had not done before on a key expression, such as
`worker-hsr put report robots/hsr/reports/plan-1/t1/1`.
"""


def document() -> str:
    """The page, in Markdown."""
    lines = [
        _PREAMBLE,
        "| key | payload | written by | read by | delivery |",
        "| --- | --- | --- | --- | --- |",
    ]
    for key in KEYSPACE:
        payload = _link(key.payload) if key.payload.__struct_fields__ else "-"
        if key.reply is not None:
            payload += f" → {_link(key.reply)}"
        delivery = f"{key.delivery.value}, signed" if is_signed(key) else key.delivery.value
        lines.append(
            f"| `{key.template}` | {payload} | {_named(key.writers)} | {_named(key.readers)} "
            f"| {delivery} |"
        )
    lines.append("\nWhen what they are about has been over for long, the planner deletes keys,")
    lines.append("whoever wrote them, by wildcards:\n\n```text")
    lines += [tree.template for tree in KEY_TREES]
    lines.append("```")
    lines.append(
        "\nWhat a store has lost of these, whoever wrote them, the planner puts back:\n\n```text"
    )
    lines += [key.template for key in KEYSPACE if key.put_back]
    lines.append("```")
    lines.append("\n## Keys\n")
    lines += [f"- `{key.template}` (`{key.schema}`): {key.about}" for key in KEYSPACE]
    lines.append("\n## Payloads")
    for kind in _payloads():
        lines.append(f"\n### {kind.__name__}\n\n{inspect.cleandoc(kind.__doc__ or '')}\n")
        lines += ["| field | type | default |", "| --- | --- | --- |"]
        for field in msgspec.structs.fields(kind):
            lines.append(f"| `{field.name}` | {_type(field.type)} | {_default(field)} |")
    return "\n".join(lines) + "\n"


def _named(components: Component) -> str:
    if components == Component.ANYONE:
        return "anyone"
    return ", ".join(str(each.name).lower().replace("_", " ") for each in components)


def _link(kind: type[Any]) -> str:
    return f"[{kind.__name__}](#{kind.__name__.lower()})"


def _payloads() -> list[type[msgspec.Struct]]:
    """Every struct that a key carries, each once, with those inside it after it."""
    found: list[type[msgspec.Struct]] = []
    for key in KEYSPACE:
        structs_in(key.payload, found)
        structs_in(key.reply, found)
    return found


def _type(kind: Any) -> str:
    if kind in (Author, Source):
        return "`Author`" if kind == Author else "`Source`"
    text = re.sub(r"typing\.Annotated\[str, msgspec\.Meta\([^)]*\)\]", "Id", str(kind))
    text = re.sub(r"typing\.Annotated\[float, msgspec\.Meta\([^)]*\)\]", "float", text)
    text = re.sub(r"typing\.Optional\[(\w+)\]", r"\1 | None", text)
    text = re.sub(r"<(?:class|enum) '([\w.]+)'>", r"\1", text)
    text = re.sub(r"\b(?:[A-Za-z_]\w*\.)+(\w+)", r"\1", text)
    return f"`{text}`".replace("|", "\\|")


def _default(field: msgspec.structs.FieldInfo) -> str:
    if field.default_factory is not msgspec.NODEFAULT:
        return f"`{field.default_factory()!r}`"
    if field.default is msgspec.NODEFAULT:
        return "required"
    plain = field.default if field.default == () else msgspec.to_builtins(field.default)
    return f"`{plain!r}`"


if __name__ == "__main__":
    Path("docs/keyspace.md").write_text(document(), encoding="utf-8")
