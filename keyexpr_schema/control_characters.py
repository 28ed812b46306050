"""Characters that a terminal obeys and does not show.

A label, a text, a reason may come from a file or a key that anybody writes. On a terminal an escape
sequence in one moves the cursor, hides what was printed, or sets the title; in a log it does so for
whoever reads it later; and a sign that turns the direction of writing shows a name as another one.
"""

from __future__ import annotations

import logging
import re

_CONTROL = r"\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069\ufeff"
_ANY = re.compile(f"[\t\n{_CONTROL}]")
_BUT_LINES = re.compile(f"[{_CONTROL}]")


class _Record(logging.LogRecord):
    def getMessage(self) -> str:  # noqa: N802 - logging's name
        return visible(super().getMessage(), lines=True)


def show_in_logs() -> None:
    """From now on no log line of this process has control characters, whoever writes it."""
    logging.setLogRecordFactory(_Record)


def _escaped(found: re.Match[str]) -> str:
    code = ord(found[0])
    return {9: r"\t", 10: r"\n", 13: r"\r"}.get(code) or (
        f"\\x{code:02x}" if code < 0x20 else f"\\u{code:04x}"
    )


def visible(text: str, *, lines: bool = False) -> str:
    r"""`text` with control characters as escapes (`\x1b`); with `lines`, lines and tabs stay."""
    return (_BUT_LINES if lines else _ANY).sub(_escaped, text)


def first_control_character(text: str, *, lines: bool = False) -> str | None:
    """The first control character in `text` as its escape, or `None`: there is none."""
    found = (_BUT_LINES if lines else _ANY).search(text)
    return None if found is None else _escaped(found)
