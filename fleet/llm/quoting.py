"""Text of other people in prompts: cleaned, and quoted as data that cannot leave its fence."""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Iterable, Mapping
from typing import Any

import msgspec

from keyexpr_schema.payloads.plans import Violation

MAX_TEXT = 300
"""Characters of one label or sentence; more is cut."""
MAX_VIOLATIONS = 20
"""Reasons given in one round; more would bury the first, which is often the cause of the others."""


def cleaned(text: str) -> str:
    """Text of people without control and invisible formatting characters, cut to `MAX_TEXT`."""
    shown = printable(text)
    return shown if len(shown) <= MAX_TEXT else shown[: MAX_TEXT - 1] + "…"


def printable(text: str) -> str:
    """Text with spaces for control and invisible formatting characters."""
    return "".join(
        " " if unicodedata.category(c) in ("Cc", "Cf", "Zl", "Zp", "Cs", "Co") else c for c in text
    )


def fenced(data: Any) -> str:
    """Data as JSON that cannot leave its fence: `<` and `>` are escaped, texts are cleaned."""
    lines = json.dumps(_clean(data), ensure_ascii=False, indent=1)
    return lines.replace("<", "\\u003c").replace(">", "\\u003e")


def _clean(data: Any) -> Any:
    if isinstance(data, str):
        return cleaned(data)
    if isinstance(data, Mapping):
        return {cleaned(str(key)): _clean(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_clean(item) for item in data]
    return data


def violations_text(violations: Iterable[Violation]) -> tuple[str, str]:
    """Violations as sentences, one a line, and as data; both fit to stand in a fence."""
    rows = list(violations)[:MAX_VIOLATIONS]
    sentences = "\n".join(f"- {cleaned(row.sentence)}" for row in rows)
    sentences = sentences.replace("<", "\\u003c").replace(">", "\\u003e")
    return sentences, fenced(msgspec.to_builtins(rows))
