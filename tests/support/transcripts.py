"""Pages with commands and what they show: every command is typed into one bash, in order.

A block of `console` has commands after `$ `, and below each what it prints, or nothing where the
page leaves that out. A command ends with 0, or as the page says behind it (`# exit code 1`); one
that goes on `# until Ctrl-C` gets that once it has printed something.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

PROMPT = "$ "
INTERRUPTED = 130
_FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_DIFFERS = {
    "a time": r"\b\d\d:\d\d\b",
    "a date": r"\b\d{4}-\d\d-\d\d\b",
    "a weekday": r"\b(?:Mon|Tue|Wed|Thu|Fri|Sat|Sun)\b",
    "seconds": r"\b\d+(?:\.\d+)? s\b",
    "a charge": r"\b\d+ %",
    "an id that is drawn": r"-(?:\d{8}-\d{6}-)?[0-9a-f]{6,12}\b",
    "a port": r"(?<=127\.0\.0\.1:)\d+",
    "what is left out": "…",
}
"""What differs from run to run: one of a kind in a page stands for any of that kind."""
_VARIES = re.compile("|".join(f"({pattern})" for pattern in _DIFFERS.values()))


@dataclass(frozen=True)
class Typed:
    """A command of a page, the line where it stands, and what is shown below it."""

    command: str
    line: int
    shown: tuple[str, ...]

    @property
    def code(self) -> int:
        """The exit code that the page says."""
        said = re.search(r"# (?:.*[,;] )?exit code (\d+)$", self.command)
        return INTERRUPTED if self.until_ctrl_c else int(said[1]) if said else 0

    @property
    def until_ctrl_c(self) -> bool:
        """Whether it goes on until somebody ends it."""
        return self.command.endswith("until Ctrl-C")


def typed(page: str) -> list[Typed]:
    """The commands of a page's blocks, in order."""
    found: list[Typed] = []
    for block in _FENCED.finditer(page):
        if block[1] != "console":
            continue
        at = page.count("\n", 0, block.start(2)) + 1
        for number, line in enumerate(block[2].splitlines(), at):
            if line.startswith(PROMPT):
                found.append(Typed(line.removeprefix(PROMPT), number, ()))
            elif found and found[-1].command.endswith("\\"):
                last = found.pop()
                found.append(Typed(f"{last.command}\n{line}", last.line, ()))
            else:
                last = found.pop()
                found.append(Typed(last.command, last.line, (*last.shown, line)))
    return found


def not_typed(page: str) -> list[str]:
    """Lines that look like commands to a reader, and are in no block whose commands are typed."""
    rest = _FENCED.sub(lambda block: "" if block[1] == "console" else block[0], page)
    return [line for line in rest.splitlines() if re.match(r"^(?:\$|\s*robotctl|    \S)", line)]


def differs(shown: tuple[str, ...], printed: str) -> str | None:
    """What of a page's lines a command has not printed; `None`: it has printed just that.

    A line with `…` alone stands for any number of lines; blanks count as one.
    """
    lines = [" ".join(line.split()) for line in printed.splitlines() if line.strip()]
    wanted = [" ".join(line.split()) for line in shown if line.strip()]
    at, any_ = 0, False
    for line in wanted:
        if line == "…":
            any_ = True
            continue
        pattern = _pattern(line)
        ends = len(lines) if any_ else at + 1
        found = next(
            (i for i in range(at, min(ends, len(lines))) if pattern.fullmatch(lines[i])), None
        )
        if found is None:
            return line
        at, any_ = found + 1, False
    if at < len(lines) and not any_:
        return f"nothing where it says {lines[at]!r}"
    return None


def _pattern(line: str) -> re.Pattern[str]:
    parts, at = [], 0
    for found in _VARIES.finditer(line):
        kind = list(_DIFFERS.values())[(found.lastindex or 1) - 1]
        parts += [re.escape(line[at : found.start()]), ".+" if kind == "…" else kind]
        at = found.end()
    return re.compile("".join([*parts, re.escape(line[at:])]))


class Bash:
    """A bash that somebody types into, with robotctl on its path, in the morning.

    Its clocks show ten, in some zone, so that no day ends and no schedule begins meanwhile.
    """

    def __init__(self, folder: Path) -> None:
        hours = (datetime.now(UTC).hour - 10 + 12) % 24 - 12
        kept = {k: v for k, v in os.environ.items() if not k.startswith("ROBOTFLEET_")}
        # Whom a shell has started in the background hears no Ctrl-C, nor does who is started by it.
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        self._process = subprocess.Popen(
            ["bash", "--noprofile", "--norc"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=folder,
            start_new_session=True,
            env={
                **kept,
                "HOME": str(folder),
                "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
                "TZ": f"Etc/GMT{hours:+d}",
            },
        )
        signal.signal(signal.SIGINT, before)
        self._write("trap : INT")

    def run(self, command: str, *, until_ctrl_c: bool = False) -> tuple[int, str]:
        """Type it, and say how it ended and what it printed."""
        mark = f"--- {os.urandom(8).hex()} "
        self._write(f"{{ {command}\n}} < /dev/null; printf '\\n{mark}%d\\n' $?")
        printed = []
        for line in self._lines():
            if line.startswith(mark):
                return int(line.removeprefix(mark)), "".join(printed)
            printed.append(line)
            if until_ctrl_c and line.strip():
                os.killpg(self._process.pid, signal.SIGINT)
                until_ctrl_c = False
        raise AssertionError(f"bash has ended: {''.join(printed)}")

    def close(self) -> None:
        """End it, with what was typed last."""
        self._process.kill()
        with self._process:
            pass

    def _write(self, text: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{text}\n")
        self._process.stdin.flush()

    def _lines(self) -> Iterator[str]:
        assert self._process.stdout is not None
        return iter(self._process.stdout.readline, "")
