"""The logs of a fleet that is up: their ends, what comes, and their size."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from cli.processes.log_files import cut, followed, last_lines
from tests.support.polling import until


async def test_a_log_is_followed_from_its_end_also_when_it_begins_anew(tmp_path: Path) -> None:
    log = tmp_path / "planner.log"
    with log.open("ab") as written:  # as a process has it
        written.write(b"one\ntwo\n\xff three\n")
        written.flush()
        at, told = last_lines(log, 2)
        assert told == ["two", "\ufffd three"]
        lines = followed(log, at)
        written.write(b"four\nfi")
        written.flush()
        assert await anext(lines) == "four"
        written.write(b"ve\n")
        written.flush()
        assert await anext(lines) == "five"
        cut(log, largest_bytes=1000)
        assert log.stat().st_size > 0
        cut(log, largest_bytes=10)
        assert log.with_name("planner.log.1").read_bytes().startswith(b"one\ntwo\n")
        written.write(b"six\n")
        written.flush()
        assert await anext(lines) == "six"
        assert last_lines(log, 5)[1] == ["six"]
    cut(tmp_path / "none.log")


async def test_a_log_that_is_not_there_yet_is_waited_for(tmp_path: Path) -> None:
    looked = []

    class Log(type(tmp_path)):  # type: ignore[misc]
        def open(self, *arguments: Any, **named: Any) -> Any:
            looked.append(self)
            return super().open(*arguments, **named)

    log = Log(tmp_path / "planner.log")
    coming = asyncio.ensure_future(anext(followed(log, 0)))
    await until(lambda: bool(looked))
    assert not coming.done()
    (tmp_path / "planner.log").write_bytes(b"first\n")
    assert await coming == "first"
