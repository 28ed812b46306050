"""What is printed, on terminals that cannot show it, that obey it, or that are gone."""

from __future__ import annotations

import codecs
import errno
import io
import json
import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
from rich.table import Table

from cli import terminal
from cli.terminal import DEGRADED, CarefulStream, json_text, unguarded, unreadable
from cli.views.console import console, table
from keyexpr_schema.control_characters import first_control_character, visible


@pytest.fixture
def handler(monkeypatch: pytest.MonkeyPatch) -> None:
    """The handler of encoding errors, with the streams as they were."""
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(sys, name, io.StringIO())
    terminal.prepare()


@pytest.mark.usefixtures("handler")
def test_letters_that_an_encoding_has_not_become_their_nearest() -> None:
    said = "“Café” → 2 ÷ ✓ … 漢 \udce9"
    assert said.encode("ascii", DEGRADED) == rb'"Cafe" -> 2 / + ... ? \xe9'
    assert said.encode("latin-1", DEGRADED) == '"Café" -> 2 ÷ + ... ? \\xe9'.encode("latin-1")
    assert "漢 \udce9".encode("utf-8", DEGRADED) == "漢 \\xe9".encode()
    assert codecs.lookup_error(DEGRADED) is not None


EVIL = "cup\x1b[2J\x1b]0;gotcha\x07\r\x9b31m \u202efdp"
SEEN = r"cup\x1b[2J\x1b]0;gotcha\x07\r\u009b31m \u202efdp"


def test_control_characters_are_shown_and_not_obeyed() -> None:
    assert visible(EVIL + "\n") == SEEN + r"\n"
    assert visible("a\n\tb", lines=True) == "a\n\tb"
    assert first_control_character(EVIL) == r"\x1b"
    assert first_control_character("Küche, 厨房") is None
    behind = io.StringIO()
    stream = CarefulStream(behind, required=True)
    stream.write(f"label: {EVIL}\n")
    console(stream).print(table(["name"], [[EVIL]]))  # type: ignore[arg-type]
    console(stream).print(EVIL)  # type: ignore[arg-type]
    shown = behind.getvalue()
    assert shown.count(SEEN) == 1 and shown.count(r"\x1b[2J\x1b]0;gotch") == 3
    assert first_control_character(shown.replace("\n", "")) is None
    assert unguarded(stream) is behind  # type: ignore[arg-type]


def shown_in(columns: int, drawn: Table) -> list[str]:
    paper = console(io.StringIO())
    paper.width = columns
    with paper.capture() as printed:
        paper.print(drawn)
    return [line.rstrip() for line in printed.get().splitlines()]


def test_a_table_breaks_no_words_however_narrow_the_terminal_is() -> None:
    rows = [["bring-the-first-cup-to-the-hallway", "reached", "who knows", None]] * 2
    drawn = table(["goal", "state", "why", "plan"], rows)
    assert shown_in(80, drawn)[1].split() == [*rows[0][:2], "who", "knows"]
    assert shown_in(58, drawn)[2].split() == ["knows"]  # broken between words, and only there
    assert shown_in(40, drawn) == 2 * [rows[0][0], "  state  reached", "  why    who knows"]
    assert shown_in(4, drawn)  # something
    assert shown_in(20, table(["a", "b"], [])) == ["a  b"]


class Pieces(io.RawIOBase):
    """A file that keeps what is written to it as it comes."""

    def __init__(self) -> None:
        self.written: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, piece: Any) -> int:
        self.written.append(bytes(piece))
        return len(self.written[-1])


def test_what_is_not_buffered_is_written_line_by_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("stdin", "stdout", "stderr"):
        monkeypatch.setattr(sys, name, io.StringIO())
    out = Pieces()
    sys.stdout = io.TextIOWrapper(out, "utf-8", write_through=True)
    terminal.prepare()
    print("worker hsr", "ready", flush=True)
    print("a plug-in's own words")
    assert out.written == [b"worker hsr ready\n", b"a plug-in's own words\n"]


def test_commands_end_when_nobody_reads_and_daemons_go_on() -> None:
    for required in (True, False):
        read, write = os.pipe()
        os.close(read)
        with os.fdopen(write, "w", encoding="utf-8") as behind:
            stream = CarefulStream(behind, required)
            stream.write("a line\n")
            with pytest.raises(BrokenPipeError) if required else nullcontext():
                stream.flush()
            stream.write("another\n")  # it leads nowhere now
            stream.flush()


class _Full(io.StringIO):
    def write(self, text: str) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_daemon_goes_on_where_there_is_no_room_for_its_log() -> None:
    assert CarefulStream(_Full(), required=False).write("a line\n") == 7
    with pytest.raises(OSError, match="No space left"):
        CarefulStream(_Full(), required=True).write("a line\n")


def test_json_is_valid_on_every_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    encoded = json.dumps({"text": "“Café” 𝄞"}, ensure_ascii=False).encode()
    for encoding in ("utf-8", "ascii", "latin-1"):
        stream = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
        monkeypatch.setattr(sys, "stdout", stream)
        assert json.loads(json_text(encoded)) == {"text": "“Café” 𝄞"}
        assert encoding == "utf-8" or json_text(encoded).isascii()


def test_bytes_that_are_no_text_are_told_unless_they_name_a_file(tmp_path: Path) -> None:
    named = os.fsdecode(bytes(tmp_path) + b"/caf\xe9.yaml")
    assert unreadable(["goal", "add", "Küche"]) is None
    assert unreadable(["plan", "check", named]) == rf"{tmp_path}/caf\xe9.yaml"
    Path(named).write_text("a: 1\n")
    assert unreadable(["plan", "check", named]) is None


def test_robotctl_prints_to_whatever_there_is() -> None:
    def run(code: str, **streams: int | None) -> subprocess.CompletedProcess[bytes]:
        started = f"import os, sys; {code}; sys.argv[1:] = ['task', 'list', '--router', 'x/y']\n"
        script = f"{started}from cli.main import main\nmain()"
        env = {**os.environ, "PYTHONIOENCODING": "ascii", "COLUMNS": "60"}
        return subprocess.run(
            [sys.executable, "-c", script], capture_output=True, check=False, env=env, timeout=60
        )

    told = run("pass")
    assert told.returncode == 1 and told.stderr.startswith(b"Error: ") and told.stderr.isascii()
    closed = run("os.close(0); os.close(1); sys.stdout = sys.stdin = None")
    assert closed.returncode == 1 and closed.stderr == told.stderr
