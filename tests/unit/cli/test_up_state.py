"""What is known of an `up`, from when it has begun."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

from cli.processes.identity import ProcessId
from cli.processes.up_state import begun, begun_state, only_up, running_state


async def test_one_that_has_begun_and_says_nothing_yet_is_waited_for(tmp_path: Path) -> None:
    assert await begun_state(tmp_path, 60.0) is None
    begun(tmp_path, ProcessId(os.getpid(), "of a former one"), "r", None)
    with only_up(tmp_path, "r"):
        assert running_state(tmp_path) is None
        waiting = asyncio.ensure_future(begun_state(tmp_path, 60.0))
        await asyncio.to_thread(int)
        assert not waiting.done()
        begun(tmp_path, ProcessId.of(os.getpid()), "r", "two-cups")
        told = await waiting
        assert told is not None and told.mission == "two-cups"
        assert told == running_state(tmp_path)
    assert running_state(tmp_path) is None
