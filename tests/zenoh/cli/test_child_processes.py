"""The processes of a demo: none dies unnoticed, and none stays behind."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from pathlib import Path

import pytest

from cli.errors import BadArgument, ProcessDied
from cli.processes.bring_up import router_up
from cli.processes.child_processes import ChildProcesses, free_endpoint
from tests.support.child_process import child_process
from tests.support.polling import until
from tests.support.process_ids import alive


def make(out: Path) -> ChildProcesses:
    processes = ChildProcesses(free_endpoint(), "demo", out)
    processes.declare(
        "router", "router", "--listen", processes.endpoint, "--data", str(out / "data")
    )
    return processes


async def test_a_process_is_ready_by_its_keys_and_gone_at_the_end(tmp_path: Path) -> None:
    async with make(tmp_path) as processes:
        await processes.start("router")
        await processes.guard(router_up(processes))
        pid = processes.pid("router")
        assert pid is not None
        assert alive(pid)
        with pytest.raises(BadArgument, match="runs already"):
            await processes.start("router")
    assert not alive(pid)
    assert f"listening on {processes.endpoint}" in processes.log("router").read_text()


async def test_a_death_that_nobody_asked_for_ends_the_work(tmp_path: Path) -> None:
    async with make(tmp_path) as processes:
        await processes.start("router")
        await processes.guard(router_up(processes))
        pid = processes.pid("router")
        assert pid is not None
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(ProcessDied) as error:
            await processes.guard(asyncio.Event().wait())
    assert "router ended unexpectedly by SIGKILL; its log is" in str(error.value)
    assert str(processes.log("router")) in str(error.value)


async def test_a_process_that_cannot_start_says_why(tmp_path: Path) -> None:
    async with make(tmp_path) as processes:
        processes.declare("ghost", "sim", "no-such-mission")
        await processes.start("ghost")
        with pytest.raises(ProcessDied, match=r"exit code 1, saying .*no mission") as error:
            await processes.guard(asyncio.Event().wait())
    assert str(processes.log("ghost")) in str(error.value)


async def test_a_second_simulation_in_a_realm_is_turned_away(tmp_path: Path) -> None:
    """Also one without pace, whose clock stands still."""
    async with make(tmp_path) as processes:
        await processes.start("router")
        await processes.guard(router_up(processes))
        for name in ("sim", "sim-again"):
            processes.declare(name, "sim", "two-cups", "--backend", "kinematic", "--speed", "max")
        await processes.start("sim")
        await until(lambda: "running" in processes.log("sim").read_text())
        await processes.kill("sim")
        await processes.start("sim")  # what is left of the dead one keeps nobody out
        await until(lambda: processes.log("sim").read_text().count("running") == 2)
        await processes.start("sim-again")
        with pytest.raises(ProcessDied, match=r"sim-again .*a simulated world runs in realm demo"):
            await processes.guard(asyncio.Event().wait())
        assert processes.pid("sim") is not None


async def test_of_two_simulations_that_start_at_once_one_stays(tmp_path: Path) -> None:
    async with make(tmp_path) as processes:
        await processes.start("router")
        await processes.guard(router_up(processes))
        names = ("sim", "sim-as-well")
        for name in names:
            processes.declare(name, "sim", "two-cups", "--backend", "kinematic")
        await asyncio.gather(*(processes.start(name) for name in names))
        with pytest.raises(ProcessDied, match=r"sim.* .a simulated world runs in realm demo"):
            await processes.guard(asyncio.Event().wait())
        stays = [name for name in names if processes.pid(name) is not None]
        assert len(stays) == 1
        await until(lambda: "running" in processes.log(stays[0]).read_text())
        assert processes.pid(stays[0]) is not None


async def test_a_killed_process_can_be_started_again(tmp_path: Path) -> None:
    async with make(tmp_path) as processes:
        await processes.start("router")
        await processes.guard(router_up(processes))
        first = processes.pid("router")
        await processes.kill("router")
        assert processes.pid("router") is None
        await processes.start("router")
        await processes.guard(router_up(processes))
        assert processes.pid("router") not in (None, first)
    assert processes.log("router").read_text().count("listening") == 2


async def test_an_error_in_the_block_leaves_nothing_behind(tmp_path: Path) -> None:
    processes = make(tmp_path)
    pid = None
    with pytest.raises(RuntimeError, match="mine"):
        async with processes:
            await processes.start("router")
            pid = processes.pid("router")
            raise RuntimeError("mine")
    assert pid is not None
    assert not alive(pid)


async def test_children_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    """`kill -9` of a demo: it can tidy up nothing, so its children look after themselves."""
    program = f"""
import asyncio
from pathlib import Path
from cli.processes.bring_up import router_up
from cli.processes.child_processes import ChildProcesses, free_endpoint

async def main():
    async with ChildProcesses(free_endpoint(), "demo", Path({str(tmp_path)!r})) as processes:
        listen = ("--listen", processes.endpoint)
        processes.declare("router", "router", *listen, "--data", {str(tmp_path)!r})
        await processes.start("router")
        await router_up(processes)
        print(processes.pid("router"), flush=True)
        await asyncio.Event().wait()

asyncio.run(main())
"""
    async with child_process(sys.executable, "-c", program, stderr=None) as parent:
        assert parent.stdout is not None
        child = int(await parent.stdout.readline())
        assert alive(child)
    await until(lambda: not alive(child))
