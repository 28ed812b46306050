"""What ends unasked is started again; what nothing can be without is not."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from cli.errors import ProcessDied
from cli.processes.child_processes import ChildProcesses, free_endpoint
from cli.processes.supervision import Supervision
from tests.support.polling import until


async def test_again_after_a_pause_but_not_the_world(tmp_path: Path) -> None:
    said: list[str] = []
    async with ChildProcesses(free_endpoint(), "demo", tmp_path) as processes:
        processes.declare("ghost", "sim", "no-such-mission")
        processes.declare("world", "sim", "no-such-mission")
        keeping = asyncio.create_task(
            Supervision(processes, {"world": "it was the world"}, said.append, lambda: None).run()
        )
        await processes.start("ghost")
        await until(lambda: processes.starts("ghost") == 3)
        processes.log("ghost").unlink()  # while it runs, or between two runs
        processes.log("ghost").mkdir()
        await until(
            lambda: any("cannot be started: it is a folder and no file" in line for line in said)
        )
        await processes.start("world")
        with pytest.raises(ExceptionGroup) as error:
            await keeping
    [died] = error.value.exceptions
    assert isinstance(died, ProcessDied)
    assert str(died).endswith(f"its log is {tmp_path / 'world.log'}: it was the world")
    pauses = [line.rpartition("again in ")[2] for line in said if "again in" in line]
    assert pauses[:4] == ["0.5 s", "1 s", "2 s", "4 s"]
    assert "ghost ended unexpectedly with exit code 1, saying “" in said[0]
