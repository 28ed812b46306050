"""`kill -9` in the middle of a mission: whoever dies and comes back, the cups arrive."""

from __future__ import annotations

from pathlib import Path

import pytest

from cli.demo.mission_run import DemoOptions, running
from cli.demo.summary import Summary
from keyexpr_schema.tasks import TaskState

pytestmark = [pytest.mark.e2e, pytest.mark.slow, pytest.mark.timeout(240)]


async def mission_with_a_death(
    mission: str, out: Path, victim: str, skill: str, robot: str
) -> Summary:
    """Kill `victim` while `robot` carries out `skill`, start it again, and see it through."""
    options = DemoOptions(
        mission=mission, out=out, backend="kinematic", speed="10", timeout_s=120.0
    )
    async with running(options) as demo:

        def busy() -> bool:
            return any(
                (record.state, record.skill, record.robot) == (TaskState.RUNNING, skill, robot)
                for record in demo.board.tasks.values()
            )

        async def play() -> Summary:
            await demo.give()
            await demo.board.until(busy, 60.0, f"{robot} to {skill}")
            await demo.fleet.kill(victim)
            await demo.fleet.start(victim)
            await demo.ended()
            return await demo.judged()

        return await demo.fleet.guard(play())


@pytest.mark.parametrize(
    ("mission", "victim", "skill", "robot"),
    [
        ("two-cups", "planner", "pick", "hsr"),
        ("two-cups", "router", "pick", "hsr"),
        ("two-cups", "record", "pick", "hsr"),
        ("two-cups", "worker-hsr", "navigate", "hsr"),
        ("two-cups", "worker-locobot", "navigate", "locobot"),
        # While nobody plans, the cup is found, and both robots look on in vain.
        ("find-cup", "planner", "search", "locobot"),
        ("find-cup", "planner", "pick", "hsr"),
        ("find-cup", "worker-locobot", "search", "locobot"),
    ],
)
async def test_the_mission_survives(
    tmp_path: Path, mission: str, victim: str, skill: str, robot: str
) -> None:
    out = tmp_path / "run"
    summary = await mission_with_a_death(mission, out, victim, skill, robot)
    logs = "\n".join(f"{log.name}:\n{log.read_text()[-2000:]}" for log in out.glob("*.log"))
    assert summary.ok, f"{[verdict.sentence for verdict in summary.goals]}\n{logs}"
    assert summary.contacts is not None
    assert summary.contacts.robot_robot == 0
