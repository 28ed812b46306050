"""What is known of an `up`, from when it has begun."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path

from cli.processes.identity import ProcessId
from cli.processes.up_state import UpState, begun_state, only_up, running_state, write_state


def state(process: ProcessId | None) -> UpState:
    return UpState(
        process=process,
        since_wall_s=0.0,
        endpoint="tcp/127.0.0.1:1",
        realm="r",
        folder="runs/r",
        mission=None,
        ready=False,
        children=(),
    )


async def test_one_that_has_begun_and_says_nothing_yet_is_waited_for(tmp_path: Path) -> None:
    assert await begun_state(tmp_path, 60.0) is None
    write_state(tmp_path, state(ProcessId(os.getpid(), "of a former one")))
    with only_up(tmp_path, "r"):
        assert running_state(tmp_path) is None
        waiting = asyncio.ensure_future(begun_state(tmp_path, 60.0))
        await asyncio.to_thread(int)
        assert not waiting.done()
        new = state(ProcessId.of(os.getpid()))
        write_state(tmp_path, new)
        assert await waiting == new == running_state(tmp_path)
    assert running_state(tmp_path) is None
