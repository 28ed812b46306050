"""Which component does what with which key: a debugging aid, off unless `ROBOTFLEET_TRACE` is set.

The variable names a file; every session of every process that inherits it appends a line for each
operation and key expression that it had not used before: `component operation key keyexpr`.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

from keyexpr_schema.key import Key

TRACE_VARIABLE = "ROBOTFLEET_TRACE"
Operation = Literal["put", "delete", "read", "watch", "token", "watch-tokens", "query", "serve"]


class Trace:
    """Notes the operations of one session."""

    def __init__(self, component: str) -> None:
        path = os.environ.get(TRACE_VARIABLE)
        self._path = Path(path) if path else None
        self._component = component
        self._known: set[tuple[Operation, str]] = set()

    def note(self, operation: Operation, key: Key[Any, Any], keyexpr: str) -> None:
        """Append a line, if tracing is on and this is new."""
        if self._path is None or (operation, keyexpr) in self._known:
            return
        self._known.add((operation, keyexpr))
        # One write in append mode: lines of other processes do not end up inside it.
        with self._path.open("a", encoding="utf-8") as file:
            file.write(f"{self._component} {operation} {key.name} {keyexpr}\n")
