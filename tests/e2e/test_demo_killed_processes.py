"""`kill -9` in the middle of a mission: whoever dies and comes back, the cups arrive.

In physics for the first demonstration. The second is killed in the world without physics, where
what is done while nobody plans, or looks, takes as long as it says.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from benchmarks.chaos.journal import Reports, all_reports, done_twice
from cli.demo.mission_run import DemoOptions, running_demo
from cli.demo.summary import Summary
from keyexpr_schema.payloads.tasks import FINAL_REPORTS, ReportState, TaskState
from tests.support.polling import DEADLINE_S
from tests.support.robotctl import Robotctl

pytestmark = [pytest.mark.e2e, pytest.mark.slow]


@pytest.fixture
def patience(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A planner that is killed is back before its robots' leases are over, as slow as that may be:
    what rests for want of a lease is interrupted, too."""
    configuration = tmp_path / "robotctl.yaml"
    configuration.write_text("planner: {lease_s: 120, lost_after_s: 150}\n")
    monkeypatch.setenv("ROBOTFLEET_CONFIG", str(configuration))


class Death(NamedTuple):
    """Who is killed (several are joined by +) while a robot carries out a skill."""

    victim: str
    skill: str
    robot: str


async def mission_with_deaths(
    mission: str, out: Path, backend: str, deaths: Sequence[Death]
) -> tuple[Summary, Reports]:
    """Kill one after the other, each in the middle of another task, and start it again at once;
    see the mission through."""
    speed = "max" if backend == "mujoco" else "10"
    apart = any(death.victim.startswith("worker-") for death in deaths)
    options = DemoOptions(mission, out, backend, speed, timeout_s=DEADLINE_S, apart=apart)
    async with running_demo(options) as demo:
        hit: set[str] = set()

        def task_of(death: Death) -> str | None:
            wanted = (TaskState.RUNNING, death.skill, death.robot)
            tasks = demo.view.tasks.values()
            found = (t.task for t in tasks if (t.state, t.skill, t.robot) == wanted)
            return next((task for task in found if task not in hit), None)

        async def play() -> tuple[Summary, Reports]:
            await demo.submit()
            for death in deaths:
                what = f"{death.robot} to {death.skill}"
                await demo.view.until(lambda death=death: bool(task_of(death)), DEADLINE_S, what)
                hit.add(task_of(death) or "")
                for name in death.victim.split("+"):
                    await demo.processes.kill(name)
                for name in death.victim.split("+"):
                    await demo.processes.start(name)
            await demo.wait_until_ended()
            return await demo.verify(), await all_reports(demo.session)

        return await demo.processes.guard(play())


def check_no_attempt_ran_twice(reports: Reports) -> None:
    """An attempt begins once and ends once, and its number is used for nothing else."""
    assert reports
    assert done_twice(reports) == []
    open_ = [at for at, said in reports.items() if not FINAL_REPORTS & {r.state for r in said}]
    assert open_ == [], "attempts without an end"


@pytest.mark.parametrize(
    ("mission", "backend", "deaths"),
    [
        (
            "two-cups",
            "mujoco",
            [
                Death("planner+record", "pick", "hsr"),
                Death("router", "place_on_robot", "hsr"),
                Death("workers", "pick", "hsr"),
            ],
        ),
        (
            "two-cups",
            "mujoco",
            [
                Death("worker-hsr", "pick", "hsr"),
                Death("worker-locobot", "navigate", "locobot"),
                Death("worker-hsr", "place", "hsr"),
            ],
        ),
        # While nobody plans, the cup is found, and both robots look on in vain.
        ("find-cup", "kinematic", [Death("planner", "search", "locobot")]),
        ("find-cup", "kinematic", [Death("worker-locobot", "search", "locobot")]),
    ],
    ids=["planner+router+workers", "each-worker", "planner-while-searching", "worker-searching"],
)
async def test_the_mission_survives(
    tmp_path: Path, mission: str, backend: str, deaths: list[Death], patience: None
) -> None:
    out = tmp_path / "run"
    summary, reports = await mission_with_deaths(mission, out, backend, deaths)
    logs = "\n".join(f"{log.name}:\n{log.read_text()[-2000:]}" for log in out.glob("*.log"))
    assert summary.ok, f"{[verdict.sentence for verdict in summary.goals]}\n{logs}"
    assert all(verdict.physics == "holds" for verdict in summary.goals)
    assert summary.contacts is not None
    assert summary.contacts.robot_robot == 0
    check_no_attempt_ran_twice(reports)
    interrupted = Counter(
        said[-1].robot for said in reports.values() if said[-1].state is ReportState.INTERRUPTED
    )
    # Who was hit in the middle of its work said so, and somebody took it up again; nobody else.
    hit = Counter(death.robot for death in deaths if death.victim.startswith("worker"))
    assert hit <= interrupted, interrupted
    # Where all workers die, the other robot may have been at work as well.
    all_at_once = any(death.victim == "workers" for death in deaths)
    assert all_at_once or interrupted == hit
    assert not all_at_once or max(interrupted.values()) == 1


async def test_a_mission_is_stopped_its_processes_are_killed_and_it_goes_on(tmp_path: Path) -> None:
    """Nothing moves from the stop to its end, though the planner and all workers start anew."""
    out = tmp_path / "run"
    options = DemoOptions("two-cups", out, "mujoco", "max", timeout_s=DEADLINE_S)
    async with running_demo(options) as demo:
        robotctl = Robotctl(demo.processes.endpoint, tmp_path, demo.processes.realm)
        view = demo.view

        def picking() -> bool:
            running = (r for r in view.tasks.values() if r.state is TaskState.RUNNING)
            return any(record.skill == "pick" for record in running)

        def poses() -> list[float]:
            states = (view.robot_states[name] for name in sorted(view.robot_specs))
            return [number for state in states for number in state.pose_m_rad or ()]

        def resting(stop: str, but: set[str]) -> bool:
            states = [view.robot_states[robot] for robot in view.robot_specs]
            return all(s.stops == (stop,) and s.incarnation not in but for s in states)

        async def play() -> Summary:
            await demo.submit()
            await view.until(picking, DEADLINE_S, "a pick")
            stopped = await robotctl.soon("stop", "--all", "--wait", "60", "--json")
            assert stopped.code == 0, stopped.err
            stop = stopped.data["stop"]["stop"]
            await view.until(lambda: resting(stop, set()), DEADLINE_S, "the view to show that, too")
            where = poses()
            before = {state.incarnation for state in view.robot_states.values()}
            for victim in ("planner", "workers"):
                await demo.processes.kill(victim)
            for victim in ("workers", "planner"):
                await demo.processes.start(victim)
            await view.until(lambda: resting(stop, before), DEADLINE_S, "new workers to rest, too")
            assert poses() == pytest.approx(where, abs=1e-3)
            resumed = await robotctl.soon("resume", "--all")
            assert resumed.code == 0, resumed.err
            await demo.wait_until_ended()
            return await demo.verify()

        summary = await demo.processes.guard(play())
    assert summary.ok, [verdict.sentence for verdict in summary.goals]
    assert summary.contacts is not None and summary.contacts.robot_robot == 0
