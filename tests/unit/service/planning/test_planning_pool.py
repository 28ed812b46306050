"""Planning processes, real ones: whatever becomes of one, each job is answered, and once."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from fleet.core.events import PlanningFailed, PlanningSucceeded
from fleet.core.plan_entry import ReplanReason, ReplanScope
from fleet.core.planning_input import PlanningInput
from fleet.service.planning.messages import JOB, Answer
from fleet.service.planning.pool import PlanningPool
from fleet.service.planning.process import PlanningProcessEnded
from tests.support.child_process import child_process
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, carrier, manipulator
from tests.support.open_files import open_files
from tests.support.plug_in_site import plug_in_site
from tests.support.polling import DEADLINE_S, until
from tests.support.process_ids import alive

THEIRS = '''
import os, signal, subprocess, sys
from pathlib import Path
from fleet.planners import NoPlan, Planner
from fleet.planners.symbolic.planner import SymbolicPlanner

HERE = Path(__file__).parent

class Their(SymbolicPlanner):
    """Says that it is there, does something of its own, and plans as usual."""
    def _solve(self, problem):
        with (HERE / "begun").open("a") as begun:
            begun.write(f"{problem.plan} {os.getpid()}\\n")
        self.act(problem)
        return super()._solve(problem)

class Loops(Their):
    name = "loops"
    def act(self, problem):
        while True:
            pass

class Starts(Loops):
    name = "starts"
    def act(self, problem):
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
        (HERE / "child-").write_text(str(child.pid))
        (HERE / "child-").rename(HERE / "child")
        super().act(problem)

class Prints(Their):
    name = "prints"
    def act(self, problem):
        print("hello", "x" * 100000)
        os.write(1, b"\\0\\0\\0\\2hi")
        subprocess.run([sys.executable, "-c", "print('a child prints')"])
        assert sys.stdin.read() == ""

class Crashes(Their):
    name = "crashes"
    def act(self, problem):
        os.kill(os.getpid(), signal.SIGSEGV)

class Waits(Their):
    """Until somebody writes into the plan's own pipe."""
    name = "waits"
    def act(self, problem):
        (HERE / problem.plan).read_bytes()

class Patient(Waits):
    name, waiting_s = "patient", 600.0

class Exits(Their):
    name = "exits"
    def act(self, problem):
        sys.exit("that was enough")

class Closes(Their):
    """Whatever is open, and goes on."""
    name = "closes"
    def act(self, problem):
        os.closerange(3, 256)
        while True:
            pass

class Leaves(Their):
    """Somebody behind who keeps the pipe and is in no group of ours."""
    name = "leaves"
    def act(self, problem):
        if (left := os.fork()) == 0:
            os.setsid()
            (HERE / f"left-{os.getpid()}").touch()
            signal.pause()
        while not (HERE / f"left-{left}").exists():
            pass
        os.kill(os.getpid(), signal.SIGKILL)

class Swells(Their):
    name = "swells"
    def act(self, problem):
        bytearray(1 << 40)
'''
PLANNERS = (
    "Loops",
    "Starts",
    "Prints",
    "Crashes",
    "Waits",
    "Patient",
    "Exits",
    "Swells",
    "Closes",
    "Leaves",
)


REASON = ReplanReason(scope=ReplanScope.ANEW, number=1, sentence="so")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the plug-in is, for child processes only."""
    offered = {"robotfleet.planners": {name.lower(): name for name in PLANNERS}}
    monkeypatch.setenv("PYTHONPATH", str(plug_in_site(tmp_path, THEIRS, offered)))
    return tmp_path


class Listened(FleetModel):
    """A fleet whose planning inputs are kept."""

    def __init__(self, *args: Any) -> None:
        self.inputs: list[PlanningInput] = []
        super().__init__(*args)

    def run(self, given: PlanningInput) -> PlanningSucceeded | PlanningFailed:
        self.inputs.append(given)
        return super().run(given)


def given(job: int = 1, planner: str = "symbolic", **of_job: Any) -> PlanningInput:
    """An input: two cups for two robots."""
    model = Listened((manipulator(), carrier()), 2)
    model.plan(bring(1, "hallway"), bring(2, "living_room"), allocator="round-robin")
    made = model.inputs[0]
    return replace(
        made,
        job=replace(made.job, job=job, plan=f"p{job}", planner=planner, **of_job),
        limit_s=600.0,
    )


@asynccontextmanager
async def pool(failures: Path | None = None) -> AsyncIterator[PlanningPool]:
    async with PlanningPool(failures=failures).running() as running:
        await running.ready()
        yield running


async def answer_of(running: PlanningPool) -> Answer:
    async with asyncio.timeout(3 * DEADLINE_S):  # it runs at low priority
        return await running.answers.get()


async def plan(running: PlanningPool, job: int) -> None:
    """An ordinary job is answered, as if nothing had happened, and nothing else is."""
    running.submit(given(job))
    answer = await answer_of(running)
    assert isinstance(answer, PlanningSucceeded), answer
    assert answer.job == job
    assert running.answers.empty()


def begun(site: Path) -> list[tuple[str, int]]:
    """Plans that planners began with, and the processes they were in."""
    path = site / "begun"
    lines = path.read_text().splitlines() if path.exists() else []
    return [(line.split()[0], int(line.split()[1])) for line in lines if len(line.split()) == 2]


def left_behind(site: Path) -> list[int]:
    return [int(path.name.removeprefix("left-")) for path in site.glob("left-*")]


async def test_an_answer_is_that_of_the_same_job_in_this_process(site: Path) -> None:
    model = Listened((manipulator(), carrier()), 2)
    job = given()
    async with pool() as running:
        running.submit(job)
        running.submit(job)
        answer = await answer_of(running)
        assert isinstance(answer, PlanningSucceeded)
        here = model.run(job)
        assert replace(answer, planning_time_s=0.0) == replace(here, planning_time_s=0.0)
        await plan(running, 2)


async def test_a_job_whose_process_is_killed_is_done_by_another(site: Path) -> None:
    os.mkfifo(site / "p1")
    async with pool() as running:
        running.submit(given(1, "waits"))
        ((_, pid),) = await until(lambda: begun(site))
        os.kill(pid, signal.SIGKILL)
        (_, other) = (await until(lambda: begun(site)[1:]))[0]
        assert other != pid
        await asyncio.to_thread((site / "p1").write_bytes, b"go")
        answer = await answer_of(running)
        assert isinstance(answer, PlanningSucceeded), answer
        await plan(running, 2)


async def test_a_job_that_ends_its_process_is_answered_and_kept(site: Path) -> None:
    failures = site / "failures"
    async with pool(failures) as running:
        job = given(1, "crashes")
        running.submit(job)
        answer = await answer_of(running)
        assert isinstance(answer, PlanningFailed)
        assert answer.postponed
        assert answer.reason == "the planning process ended (SIGSEGV)"
        assert len(begun(site)) == 2
        await plan(running, 2)
    (kept,) = failures.iterdir()
    assert msgspec.json.decode(kept.read_bytes(), type=PlanningInput) == job


async def test_a_loop_without_end_is_answered_at_the_limit(site: Path) -> None:
    async with pool() as running:
        running.submit(replace(given(1, "loops"), limit_s=0.5))
        answer = await answer_of(running)
        assert isinstance(answer, PlanningFailed)
        assert (answer.reason, answer.postponed) == ("planning took longer than 0.5 s", True)
        for _, pid in begun(site):
            await until(lambda pid=pid: not alive(pid))
        await plan(running, 2)


async def test_a_process_that_closes_its_pipe_is_no_better_than_one_that_ended(site: Path) -> None:
    async with pool() as running:
        running.submit(given(1, "closes"))
        answer = await answer_of(running)
        assert isinstance(answer, PlanningFailed)
        assert answer.reason == "the planning process ended (SIGKILL)"
        await plan(running, 2)


async def test_who_is_left_behind_with_the_pipe_holds_nobody_up(site: Path) -> None:
    before = open_files()
    try:
        async with pool() as running:
            running.submit(given(1, "leaves"))
            answer = await answer_of(running)
            assert isinstance(answer, PlanningFailed)
            assert answer.reason == "the planning process ended (SIGKILL)"
            await plan(running, 2)
        await until(lambda: open_files() <= before)
    finally:
        for left in left_behind(site):
            os.kill(left, signal.SIGKILL)


@pytest.mark.parametrize(
    ("planner", "reason"),
    [("exits", "that was enough"), ("swells", "MemoryError")],
)
async def test_what_a_planner_raises_is_the_answer(site: Path, planner: str, reason: str) -> None:
    async with pool() as running:
        running.submit(given(1, planner))
        answer = await answer_of(running)
        assert isinstance(answer, PlanningFailed)
        assert answer.reason == f"the planner failed: {reason}"
        await plan(running, 2)
        assert len(begun(site)) == 1


async def test_what_a_planner_prints_is_no_answer(site: Path) -> None:
    async with pool() as running:
        running.submit(given(1, "prints"))
        assert isinstance(await answer_of(running), PlanningSucceeded)
        await plan(running, 2)


async def test_a_running_plan_comes_first_and_a_dry_run_last(site: Path) -> None:
    os.mkfifo(site / "p1")
    async with pool() as running:
        running.submit(given(1, "waits", reason=REASON))
        running.submit(given(2, dry_run=True))
        running.submit(given(3))
        running.submit(given(4, reason=REASON))
        await until(lambda: begun(site))
        await asyncio.to_thread((site / "p1").write_bytes, b"go")
        answers = [await answer_of(running) for _ in range(4)]
        assert [getattr(answer, "job", None) for answer in answers] == [1, 4, 3, 2]


async def test_a_running_plan_waits_for_no_dry_run(site: Path) -> None:
    for name in ("p1", "p2"):
        os.mkfifo(site / name)
    async with pool() as running:
        running.submit(given(1, "waits", dry_run=True))
        running.submit(given(2, "waits", dry_run=True))
        await until(lambda: begun(site))
        running.submit(given(3, reason=REASON))
        answer = await answer_of(running)
        assert isinstance(answer, PlanningSucceeded)
        assert answer.job == 3
        assert [name for name, _ in begun(site)] == ["p1"], "dry runs go one after the other"
        for name in ("p1", "p2"):
            await asyncio.to_thread((site / name).write_bytes, b"go")
            assert isinstance(await answer_of(running), PlanningSucceeded)


async def test_jobs_that_wait_for_others_go_on_beside_each_other_and_the_rest(site: Path) -> None:
    for name in ("p1", "p2"):
        os.mkfifo(site / name)
    async with pool() as running:
        running.submit(given(1, "patient"))
        running.submit(given(2, "patient"))
        await until(lambda: len(begun(site)) == 2)
        await plan(running, 3)
        for number in (2, 1):
            await asyncio.to_thread((site / f"p{number}").write_bytes, b"go")
            answer = await answer_of(running)
            assert isinstance(answer, PlanningSucceeded)
            assert answer.job == number


async def test_a_job_that_nobody_waits_for_any_more_is_ended_or_not_begun(site: Path) -> None:
    async with pool() as running:
        running.submit(given(1, "starts"))
        running.submit(given(2, "loops"))
        ((_, pid),) = await until(lambda: begun(site))
        child = int(await until(lambda: (site / "child").exists() and (site / "child").read_text()))
        assert alive(child)
        for job in (2, 1, 7):
            running.drop(job)
        await until(lambda: not alive(pid))
        await until(lambda: not alive(child), "the end of what the planner had started")
        await plan(running, 3)
        assert len(begun(site)) == 1


async def test_a_configuration_that_will_not_do_is_told(tmp_path: Path) -> None:
    path = tmp_path / "llm.yaml"
    path.write_text("llm: {modell: x}\n")
    async with PlanningPool(path).running() as running:
        with pytest.raises(PlanningProcessEnded, match=r"llm\.modell: there is no such field"):
            await running.ready()


PARENT = """
import asyncio, sys
from fleet.service.planning.messages import JOB
from fleet.service.planning.pool import PlanningPool

async def main():
    async with PlanningPool().running() as pool:
        pool.submit(JOB.decode(open(sys.argv[1], "rb").read()))
        await pool.answers.get()

asyncio.run(main())
"""


@pytest.mark.parametrize("planner", ["loops", "waits"])
async def test_it_ends_when_the_planner_is_killed(site: Path, planner: str) -> None:
    os.mkfifo(site / "p1")
    (site / "job").write_bytes(msgspec.msgpack.encode(given(1, planner)))
    assert JOB.decode((site / "job").read_bytes()) == given(1, planner)
    command = (sys.executable, "-c", PARENT, str(site / "job"))
    async with child_process(*command, stdout=None, stderr=None):
        ((_, pid),) = await until(lambda: begun(site))
    await until(lambda: not alive(pid))
