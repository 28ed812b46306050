"""A number that was given out again is another process, and is left alone."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest
from msgspec.structs import replace

from cli.errors import BadArgument
from cli.processes.identity import ProcessId
from cli.processes.run_folder import claim_run_folder, new_run_folder
from cli.processes.supervision import LONGEST_AGAIN_S, pause_s
from cli.processes.take_down import take_down
from cli.processes.up_state import (
    Child,
    UpState,
    only_up,
    read_state,
    running_state,
    state_folder,
    write_state,
)
from cli.settings import DEFAULT_ROUTER, load_settings
from tests.support.child_process import child_process


def this() -> ProcessId:
    found = ProcessId.of(os.getpid())
    assert found is not None
    return found


def up_of(process: ProcessId, *children: ProcessId) -> UpState:
    return UpState(
        process=process,
        since_wall_s=0.0,
        endpoint="tcp/127.0.0.1:1",
        realm="r",
        folder="/",
        mission=None,
        ready=True,
        children=tuple(
            Child(name=f"c{n}", process=each, since_wall_s=0.0, restarts=0, log="/log")
            for n, each in enumerate(children)
        ),
    )


async def test_only_the_process_that_is_meant_gets_a_signal() -> None:
    async with child_process(sys.executable, "-c", "input()", stderr=None) as child:
        there = ProcessId.of(child.pid)
        assert there is not None
        assert there.alive
        other = replace(there, born="another time")
        assert not other.alive
        assert not other.send(signal.SIGKILL)
        assert there.alive
        assert there.send(signal.SIGKILL)
        await child.wait()
        assert not there.alive
        assert not there.send(signal.SIGKILL)
    assert ProcessId.of(child.pid) is None


async def test_what_is_down_already_is_not_searched_for_by_its_number() -> None:
    """The pids in a state that is left over are this test's own by now."""
    old = replace(this(), born="before")
    assert await take_down(up_of(old, old), 0.0, lambda _: None) == []


async def test_what_does_not_end_is_killed() -> None:
    deaf = (
        "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); "
        "print(1, flush=True); input()"
    )
    async with child_process(sys.executable, "-c", deaf, stderr=None) as child:
        assert child.stdout is not None
        await child.stdout.readline()
        there = ProcessId.of(child.pid)
        assert there is not None
        said: list[str] = []
        # A zombie is no process that runs: the one that started it has yet to hear of its end.
        assert await take_down(up_of(there), 0.0, said.append) == []
        assert [line.split(")")[0] for line in said] == [f"up (pid {child.pid}"]


def test_one_up_a_realm_and_settings_find_it(tmp_path: Path) -> None:
    environ = {"HOME": str(tmp_path)}
    folder = state_folder("r", environ)
    assert folder == tmp_path / ".local/state/robotfleet/r"
    assert state_folder("r", {}) is None
    assert running_state(folder) is None
    with only_up(folder, "r"):
        assert running_state(folder) is None  # it has not said where yet
        write_state(folder, up_of(this()))
        assert running_state(folder) == read_state(folder) == up_of(this())
        with pytest.raises(BadArgument, match=rf"up in realm r already \(pid {os.getpid()}\)"):
            with only_up(folder, "r"):
                pass
        found = load_settings(None, "r", False, environ, tmp_path)
        assert (found.routers, found.said) == (("tcp/127.0.0.1:1",), False)
        assert load_settings(None, None, False, environ, tmp_path).routers == (DEFAULT_ROUTER,)
        told = load_settings(["tcp/127.0.0.1:2"], "r", False, environ, tmp_path)
        assert (told.routers, told.said) == (("tcp/127.0.0.1:2",), True)
    assert running_state(folder) is None
    assert read_state(folder) is not None  # its logs can still be read
    assert load_settings(None, "r", False, environ, tmp_path).routers == (DEFAULT_ROUTER,)


def test_pauses_grow_and_have_an_end() -> None:
    pauses = [pause_s(n) for n in range(1, 12)]
    assert pauses[:3] == [0.5, 1.0, 2.0]
    assert pauses == sorted(pauses)
    assert pauses[-1] == LONGEST_AGAIN_S


def test_two_runs_never_share_a_folder(tmp_path: Path) -> None:
    """Also two that begin within the same second."""
    folders = {new_run_folder("two-cups", tmp_path) for _ in range(3)}
    assert len(folders) == 3
    for folder in folders:
        claim_run_folder(folder)
        with pytest.raises(BadArgument, match="the data of another run"):
            claim_run_folder(folder)
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "notes.txt").write_text("not of a run")
    claim_run_folder(mine)
    (mine / "data").rmdir()
    (mine / "planner.log").touch()
    with pytest.raises(BadArgument, match=r"the planner\.log of another run"):
        claim_run_folder(mine)
