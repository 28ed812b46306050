"""Standard streams as robotctl uses them: on whatever terminal, with whatever is typed or printed.

What is printed may come from files and keys that anybody writes, and goes to terminals that cannot
show all of it. So all text passes one stream: control characters are printed as escapes, letters
that the terminal's encoding has not as their nearest ones, and when nobody reads any more a command
ends and a daemon goes on.
"""

from __future__ import annotations

import codecs
import io
import os
import re
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TextIO

DEGRADED = "robotctl-degraded"
"""The name of the handler of encoding errors."""
_PLAIN = str.maketrans(
    {
        "“": '"',
        "”": '"',
        "\u2018": "'",
        "\u2019": "'",
        "…": "...",
        "\u2013": "-",
        "\u2014": "-",
        "→": "->",
        "←": "<-",
        "▶": ">",
        "✓": "+",
        "✗": "x",
        "·": "*",
        "□": "o",
        "─": "-",
        "÷": "/",
        "\u00d7": "x",
        "≤": "<=",
        "≥": ">=",
    }
)


def prepare() -> None:
    """Take the standard streams over; those that are closed lead nowhere."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            # Else the next file that is opened, the store's, would be written to by whoever prints.
            os.open(os.devnull, os.O_RDWR)
    codecs.register_error(DEGRADED, _degraded)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name) or _nowhere()
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=DEGRADED)
            if stream.write_through:  # PYTHONUNBUFFERED
                # By lines: `print` ends one by itself, and Podman 4.3 shows none of such.
                stream.reconfigure(line_buffering=True, write_through=False)
        setattr(sys, name, CarefulStream(stream, required=name == "stdout"))
    if isinstance(sys.stdin, io.TextIOWrapper):
        sys.stdin.reconfigure(errors="replace")


def keep_on() -> None:
    """From now on nobody has to read what is printed: a daemon outlives its terminal."""
    if isinstance(sys.stdout, CarefulStream):
        sys.stdout.required = False


def unreadable(arguments: Sequence[str]) -> str | None:
    """The first argument whose bytes are no text, as it can be shown; the name of a file may be."""
    for argument in arguments:
        no_text = any("\udc80" <= letter <= "\udcff" for letter in argument)
        if no_text and not Path(argument).exists():
            return argument.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
    return None


def json_text(encoded: bytes) -> str:
    """JSON as it can be printed here: valid, and the same whatever the terminal can show."""
    text = encoded.decode()
    if _speaks_unicode(sys.stdout):
        return text
    import json

    return re.sub(r"[^\x00-\x7f]", lambda found: json.dumps(found[0])[1:-1], text)


def unguarded(stream: TextIO) -> TextIO:
    """The stream behind a guarded one, for who guards what is printed by itself (`console`)."""
    return stream.behind if isinstance(stream, CarefulStream) else stream


class CarefulStream(io.TextIOBase):
    """A stream of text that shows control characters, and breaks for nobody.

    `required`: who prints ends when nobody reads any more, by a `BrokenPipeError`, or where
    there is no room for what is printed, by another `OSError`.
    """

    def __init__(self, behind: TextIO, required: bool) -> None:
        self.behind, self.required = behind, required

    def write(self, text: str) -> int:
        """Print `text`."""
        shown = text
        if not text.replace("\n", "").replace("\t", "").isprintable():
            from keyexpr_schema.control_characters import visible  # no help page needs it

            shown = visible(text, lines=True)
        self._guarded(lambda: self.behind.write(shown))
        return len(text)

    def flush(self) -> None:
        """Have what was printed read."""
        self._guarded(self.behind.flush)

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return self.behind.isatty()

    def fileno(self) -> int:
        """The file behind it."""
        return self.behind.fileno()

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """What letters become."""
        return self.behind.encoding

    def _guarded(self, act: Callable[[], object]) -> None:
        try:
            act()
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.behind.fileno())  # what is still to be flushed goes there, too
            os.close(nowhere)
            if self.required:
                raise
        except OSError as error:
            if self.required:
                raise OSError(error.errno, error.strerror, "standard output") from None
            # else the disk of a log is full, or a terminal is gone


def _nowhere() -> TextIO:
    return Path(os.devnull).open("w", encoding="utf-8")


def _speaks_unicode(stream: TextIO) -> bool:
    return (stream.encoding or "").lower().replace("-", "").startswith("utf")


def _degraded(error: UnicodeError) -> tuple[str, int]:
    """What stands for letters that an encoding has not."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    import unicodedata

    found = []
    for letter in error.object[error.start : error.end]:
        if "\ud800" <= letter <= "\udfff":
            found.append(f"\\x{ord(letter) - 0xDC00:02x}" if letter >= "\udc80" else "?")
            continue
        plain = unicodedata.normalize("NFKD", letter.translate(_PLAIN))
        found.append("".join(c for c in plain if c.isascii()) or "?")
    return "".join(found), error.end
