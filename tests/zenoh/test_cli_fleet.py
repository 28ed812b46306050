"""The processes of a demo: none dies unnoticed, and none stays behind."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from cli.demo.bring_up import router_up
from cli.demo.fleet import Fleet, free_endpoint
from cli.errors import BadArgument, ProcessDied

DEADLINE_S = 20.0


def make(out: Path) -> Fleet:
    fleet = Fleet(free_endpoint(), "demo", out)
    fleet.declare("router", "router", "--listen", fleet.endpoint, "--data", str(out / "data"))
    return fleet


def runs(pid: int) -> bool:
    """Whether the process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


async def until(condition: Callable[[], bool]) -> None:
    async with asyncio.timeout(DEADLINE_S):
        while not condition():
            await asyncio.sleep(0.02)


async def test_a_process_is_ready_by_its_keys_and_gone_at_the_end(tmp_path: Path) -> None:
    async with make(tmp_path) as fleet:
        await fleet.start("router")
        await fleet.guard(router_up(fleet))
        pid = fleet.pid("router")
        assert pid is not None
        assert runs(pid)
        with pytest.raises(BadArgument, match="runs already"):
            await fleet.start("router")
    assert not runs(pid)
    assert f"listening on {fleet.endpoint}" in fleet.log("router").read_text()


async def test_a_death_that_nobody_asked_for_ends_the_work(tmp_path: Path) -> None:
    async with make(tmp_path) as fleet:
        await fleet.start("router")
        await fleet.guard(router_up(fleet))
        pid = fleet.pid("router")
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(ProcessDied) as error:
            await fleet.guard(asyncio.Event().wait())
    assert "router ended unexpectedly by SIGKILL; its log is" in str(error.value)
    assert str(fleet.log("router")) in str(error.value)


async def test_a_process_that_cannot_start_says_why(tmp_path: Path) -> None:
    async with make(tmp_path) as fleet:
        fleet.declare("ghost", "sim", "no-such-mission")
        await fleet.start("ghost")
        with pytest.raises(ProcessDied, match=r"exit code 1, saying .*no mission") as error:
            await fleet.guard(asyncio.Event().wait())
    assert str(fleet.log("ghost")) in str(error.value)


async def test_a_killed_process_can_be_started_again(tmp_path: Path) -> None:
    async with make(tmp_path) as fleet:
        await fleet.start("router")
        await fleet.guard(router_up(fleet))
        first = fleet.pid("router")
        await fleet.kill("router")
        assert fleet.pid("router") is None
        await fleet.start("router")
        await fleet.guard(router_up(fleet))
        assert fleet.pid("router") not in (None, first)
    assert fleet.log("router").read_text().count("listening") == 2


async def test_an_error_in_the_block_leaves_nothing_behind(tmp_path: Path) -> None:
    fleet = make(tmp_path)
    pid = None
    with pytest.raises(RuntimeError, match="mine"):
        async with fleet:
            await fleet.start("router")
            pid = fleet.pid("router")
            raise RuntimeError("mine")
    assert pid is not None
    assert not runs(pid)


async def test_children_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    """`kill -9` of a demo: it can tidy up nothing, so its children look after themselves."""
    program = f"""
import asyncio
from pathlib import Path
from cli.demo.bring_up import router_up
from cli.demo.fleet import Fleet, free_endpoint

async def main():
    async with Fleet(free_endpoint(), "demo", Path({str(tmp_path)!r})) as fleet:
        fleet.declare("router", "router", "--listen", fleet.endpoint, "--data", {str(tmp_path)!r})
        await fleet.start("router")
        await router_up(fleet)
        print(fleet.pid("router"), flush=True)
        await asyncio.Event().wait()

asyncio.run(main())
"""
    parent = await asyncio.create_subprocess_exec(
        sys.executable, "-c", program, stdout=asyncio.subprocess.PIPE
    )
    try:
        assert parent.stdout is not None
        child = int(await parent.stdout.readline())
        assert runs(child)
    finally:
        parent.kill()
        await parent.wait()
    await until(lambda: not runs(child))
