"""The recorder as a process on real keys: what was there before, what comes, how it ends."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from fleet.timeline import viewer
from fleet.timeline.errors import UnreadableRecording
from fleet.timeline.process import run_recorder
from fleet.timeline.reader import Row, rows, summary
from keyexpr_schema.errors import Unreachable
from keyexpr_schema.free_ports import free_port
from keyexpr_schema.keyspace import (
    DIAGNOSTIC,
    GOAL_SPEC,
    SIM_CLOCK,
    SIM_FRAMES,
    SIM_SCENE,
    TASK_RECORD,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.simulation import Body, Frame, Frames, Scene, SimAddress, SimClock
from keyexpr_schema.payloads.tasks import TaskAddress, TaskRecord, TaskState
from keyexpr_schema.transport.session import Session, open_session
from tests.support.child_process import blocking_child
from tests.support.full_disk import SmallDisk
from tests.support.polling import DEADLINE_S, until


@contextmanager
def start(
    endpoint: str,
    out: Path,
    view: bool = False,
    rolls: str = "None",
    on: Callable[..., list[str]] = lambda *command: [*command],
) -> Iterator[subprocess.Popen[str]]:
    """A recorder in a process of its own, on a machine without a screen; it writes often."""
    code = (
        "from pathlib import Path; from fleet.timeline.process import run_recorder; "
        "from fleet.timeline.rolling import Rolling; import fleet.timeline.process as process; "
        "process.FLUSH_S = process.POSES_S = 0.2; "
        f"run_recorder(({endpoint!r},), 'robotfleet', Path({str(out)!r}), view={view}, "
        f"rolling={rolls})"
    )
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    with blocking_child(*on(sys.executable, "-c", code), env=env) as process:
        yield process


@contextmanager
def recorder(endpoint: str, out: Path) -> Iterator[subprocess.Popen[str]]:
    """A recorder that is ready."""
    with start(endpoint, out) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == f"recording to {out}"
        yield process


def read(out: Path, entity: str, component: str) -> list[Row]:
    """What there is already of a recording that is still being written."""
    try:
        return rows(out, entity, component)
    except UnreadableRecording:
        return []


async def until_written(out: Path, entity: str, component: str, count: int) -> list[Row]:
    """Wait until the file holds so many rows."""

    async def written() -> list[Row] | None:
        found = await asyncio.to_thread(read, out, entity, component)
        return found if len(found) >= count else None

    found: list[Row] = await until(written, f"{count} rows of {component} in {entity}", DEADLINE_S)
    return found


def record(state: TaskState, ended_s: float | None = None, number: int = 1) -> TaskRecord:
    return TaskRecord(
        plan="p1",
        revision=1,
        task=f"t{number}",
        skill="navigate",
        args={"robot": f"r{number}", "place": "kitchen"},
        actor=f"a{number}",
        robot=f"r{number}",
        state=state,
        attempt=1,
        started_s=3.0,
        ended_s=ended_s,
    )


async def work(
    session: Session, state: TaskState, ended_s: float | None = None, number: int = 1
) -> None:
    address = TaskAddress(plan="p1", task=f"t{number}")
    await session.confirm(TASK_RECORD, address, record(state, ended_s, number))


def move(session: Session, time_s: float) -> None:
    clock = SimClock(time_s=time_s, wall_time_s=time.time(), speed=1.0)
    session.put(SIM_CLOCK, SimAddress(), clock)
    pose = ((time_s, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    frame = Frame(time_s=time_s, poses={"r1/base": pose})
    session.put(SIM_FRAMES, SimAddress(), Frames(frames=(frame,)))


@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
async def test_a_recorder_writes_what_was_and_what_comes_until_it_ends(
    router, session_config, tmp_path, end
):
    out = tmp_path / "run.rrd"
    async with open_session(session_config(component="test")) as session:
        await session.confirm(GOAL_SPEC, GoalAddress(goal="g1"), Goal(goal="g1", text="before"))
        await work(session, TaskState.RUNNING)
        base = Body(body="r1/base", owner="r1", shapes=())
        scene = Scene(world="test", bodies=(base,), fixed={})
        await session.confirm(SIM_SCENE, SimAddress(), scene)
        with recorder(router.endpoint, out) as process:
            await until_written(out, "/fleet/log/goals", "text", 1)
            await until_written(out, "/robots/r1", "state", 1)
            await session.confirm(GOAL_SPEC, GoalAddress(goal="g2"), Goal(goal="g2", text="after"))
            for step in range(1, 40):
                move(session, 0.1 * step + 3.0)
                await asyncio.sleep(0.01)  # a stream keeps its pace
            await work(session, TaskState.SUCCEEDED, 7.0)
            await until_written(out, "/fleet/log/goals", "text", 2)
            await until_written(out, "/world/bodies/r1/r1\\/base", "translation", 5)
            await until_written(out, "/robots/r1", "state", 2)
            process.send_signal(end)
            status = await asyncio.to_thread(process.wait, DEADLINE_S)
            assert status == (-9 if end is signal.SIGKILL else 0)
    texts = [row.value[0] for row in rows(out, "/fleet/log/goals", "text")]
    assert texts == ["goal g1: “before”", "goal g2: “after”"]
    lane = [(row.sim_s, row.value[0]) for row in rows(out, "/robots/r1", "state")]
    assert lane == [(3.0, "p1/t1#1"), (7.0, "")]
    assert summary(out).timelines == {"sim_time", "wall_time"}


async def test_a_recorder_carries_on_after_the_router_was_away(router, session_config, tmp_path):
    out = tmp_path / "run.rrd"
    with recorder(router.endpoint, out) as process:
        async with open_session(session_config(component="test")) as session:
            await work(session, TaskState.RUNNING)
            await until_written(out, "/robots/r1", "state", 1)
            await asyncio.to_thread(router.restart)
            await session.wait_connected(DEADLINE_S)
            await work(session, TaskState.SUCCEEDED, 7.0)
            lane = await until_written(out, "/robots/r1", "state", 2)
            assert lane[-1] == Row(7.0, [""])
        process.send_signal(signal.SIGTERM)
        assert await asyncio.to_thread(process.wait, DEADLINE_S) == 0


async def test_a_recording_that_rolls_goes_on_in_the_next_file(router, session_config, tmp_path):
    """A file of any size is large enough here: a new one is begun at each flush."""
    rolls = "Rolling(size_bytes=1, keep=2)"
    with start(router.endpoint, tmp_path / "run.rrd", rolls=rolls) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == f"recording to {tmp_path / 'run-0001.rrd'}"
        async with open_session(session_config(component="test")) as session:
            await work(session, TaskState.RUNNING)
            for number in (2, 3, 4):
                line = await asyncio.to_thread(process.stdout.readline)
                assert line.strip() == f"recording to {tmp_path / f'run-{number:04d}.rrd'}"
            await work(session, TaskState.SUCCEEDED, 7.0)
            line = await asyncio.to_thread(process.stdout.readline)
        process.send_signal(signal.SIGTERM)
        said = await asyncio.to_thread(process.stdout.read)
        assert await asyncio.to_thread(process.wait, DEADLINE_S) == 0
    last = int(Path([*line.split(), *said.split()][-1]).stem[-4:])
    files = sorted(tmp_path.glob("*.rrd"))
    assert [path.name for path in files] == [f"run-{last - 1:04d}.rrd", f"run-{last:04d}.rrd"]
    for path in files:
        assert "/fleet/dag/p1/1" in summary(path).entities


async def test_a_recording_on_a_full_disk_stays_whole_and_goes_on_in_the_next_file(
    router, session_config, tmp_path
):
    disk = SmallDisk(tmp_path / "small", "8m")
    with start(router.endpoint, disk.folder / "run.rrd", on=disk.command) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == f"recording to {disk.folder / 'run.rrd'}"
        first, second = (disk.seen_by(process.pid) / f"run{n}.rrd" for n in ("", "-0001"))
        async with open_session(session_config(component="test")) as session:
            await work(session, TaskState.RUNNING)
            await until_written(first, "/robots/r1", "state", 1)
            # What is torn is cut to the end of a flush: of the first, once there was another one.
            await work(session, TaskState.RUNNING, number=2)
            await until_written(first, "/robots/r2", "state", 1)
            disk.fill(process.pid)
            await work(session, TaskState.FAILED, 7.0)
            (told,) = (await until(lambda: session.list(DIAGNOSTIC), "a diagnostic")).values()
            assert told.sentence.startswith(
                f"the recorder cannot write to {disk.folder} (No space left on device): nothing is "
            )
            disk.free(process.pid)
            line = await asyncio.to_thread(process.stdout.readline)
            assert line.strip() == f"recording to {disk.folder / 'run-0001.rrd'}"
            await session.confirm(GOAL_SPEC, GoalAddress(goal="g1"), Goal(goal="g1", text="go on"))
            await until_written(second, "/fleet/log/goals", "text", 1)
            assert rows(first, "/robots/r1", "state"), "it was cut to nothing"

            async def over() -> bool:
                return not await session.list(DIAGNOSTIC)

            await until(over, "nothing to be wrong any more")
        process.send_signal(signal.SIGTERM)
        assert await asyncio.to_thread(process.wait, DEADLINE_S) == 0


@pytest.mark.slow
async def test_a_viewer_can_look_on_while_it_records(router, session_config, tmp_path):
    """Without a screen the recorder says how; whoever connects there gets what is recorded."""
    out, seen = tmp_path / "run.rrd", tmp_path / "seen.rrd"
    with ExitStack() as stack:
        process = stack.enter_context(start(router.endpoint, out, view=True))
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("there is no screen here; look on with: rerun --connect ")
        assert process.stdout.readline().strip() == f"recording to {out}"
        async with open_session(session_config(component="test")) as session:
            looking = viewer.start([line.split()[-1], "--save", str(seen)])
            stack.callback(viewer.end, looking)
            await session.confirm(GOAL_SPEC, GoalAddress(goal="g1"), Goal(goal="g1", text="see"))
            await until_written(out, "/fleet/log/goals", "text", 1)
            # Whoever has not connected when the recorder ends gets nothing.
            await until(seen.exists, "what the viewer saves")
        process.send_signal(signal.SIGTERM)
        assert await asyncio.to_thread(process.wait, DEADLINE_S) == 0
        await until_written(seen, "/fleet/log/goals", "text", 1)


def test_without_a_router_the_recorder_says_so(tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with pytest.raises(Unreachable, match=endpoint):
        run_recorder((endpoint,), "robotfleet", tmp_path / "x.rrd", connect_timeout_s=0.3)
    assert not (tmp_path / "x.rrd").exists()
