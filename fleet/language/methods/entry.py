"""A compound task written as an entry of a task file."""

from __future__ import annotations

import json
from collections.abc import Iterable

from fleet.language.methods.model import CompoundTask, Method


def entry_of(task: CompoundTask) -> str:
    """The task's lines of YAML, to stand under `tasks:`."""
    lines = [f"  {task.name}:"]
    if task.about:
        lines.append(f"    about: {_text(task.about)}")
    lines.append(f"    says: {_row(task.says)}")
    if task.defaults:
        given = ", ".join(f"{name}: {_text(value)}" for name, value in task.defaults.items())
        lines.append(f"    defaults: {{{given}}}")
    if task.yields:
        lines.append("    yields: true")
    if len(task.methods) == 1:
        lines += _method(task.methods[0], "    ", "    ")
    else:
        lines.append("    methods:")
        for method in task.methods:
            lines += _method(method, "      - ", "        ")
    return "\n".join(lines) + "\n"


def _method(method: Method, first: str, rest: str) -> list[str]:
    lines = [f"needs: {_row(method.needs)}"] if method.needs else []
    if len(method.do) == 1:
        lines.append(f"do: {_row(method.do[0])}")
    else:
        rows = ", ".join(map(_row, method.do))
        lines.append(f"in_order: [{rows}]")
    return [f"{first if not n else rest}{line}" for n, line in enumerate(lines)]


def _row(texts: Iterable[str]) -> str:
    return f"[{', '.join(map(_text, texts))}]"


def _text(text: str) -> str:
    """As a scalar in quotes, which JSON and YAML write alike."""
    return json.dumps(text, ensure_ascii=False)
