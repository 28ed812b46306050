"""Pauses, drains and stops by robotctl, with a real planner and a worker in a simulated world."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from keyexpr_schema.keyspace import FACT, GOAL_SPEC, GOAL_STATUS, HOLD, ORDER, REPORT, ROBOT_STATE
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.motions import Motion, MotionKind
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.payloads.world import PERSON_SOURCE, Fact, FactAddress
from keyexpr_schema.transport.session import Session, SessionConfig
from sim.backend import Backend
from sim.files.mission_file import Mission
from sim.kinematic.backend import KinematicBackend, MotionModel
from tests.support.planner_process import planner, value
from tests.support.polling import until
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess
from tests.support.worker_world import Fleet, running_fleet

WORKING = {MotionKind.APPROACH, MotionKind.GRASP}


async def test_what_runs_is_interrupted_and_done_again_when_nothing_holds_the_robot_any_more(
    router: RouterProcess, session_config: Callable[..., SessionConfig], tmp_path: Path
) -> None:
    robotctl = Robotctl(router.endpoint, tmp_path)

    def backend(mission: Mission) -> Backend:
        robots = [(r.spec, r.start_m_rad) for r in mission.robots]
        return KinematicBackend(mission.world, robots, MotionModel(), step_s=0.05)

    async with (
        running_fleet(session_config, tmp_path / "workers", backend) as fleet,
        fleet.worker("hsr"),
        planner(router.endpoint, tmp_path / "planner", "--realm", "robotfleet", "--auto-plan"),
    ):
        session = fleet.session
        # On the clock of the world, which no planner is told here.
        known = Fact(subject="cup_1", relation="at", value="kitchen", source=PERSON_SOURCE)
        await session.confirm(FACT, FactAddress.of(known.key), known)
        goal = Goal(goal="g", text="Bring the first cup to the hallway.")
        fleet.world.steps = 1
        await session.confirm(GOAL_SPEC, GoalAddress("g"), goal)
        await fleet.world.until_begun(lambda motions: kinds(motions) >= WORKING)
        fleet.world.paused = True  # in the middle of it
        paused = await robotctl.soon("pause", "--robot", "hsr", "--now", "--why", "look at it")
        assert paused.code == 0
        await fleet.world.until_begun(lambda motions: motions[-1][1].kind is MotionKind.STOW)
        fleet.world.paused = False
        left_off = await until(lambda: reports(fleet, ReportState.CANCELLED), "it to leave off")
        assert [report.task for report in left_off] == ["t2"]
        await at_rest(fleet)
        await until(lambda: no_order(session), "the planner to withdraw what was left off")

        assert (await robotctl.soon("stop", "--robot", "hsr", "--wait", "60")).code == 0
        drained = await robotctl.soon("drain", "hsr")
        resumed = await robotctl.soon("resume", "--all")
        assert (drained.code, resumed.code) == (0, 0)
        assert "lifted" in resumed.out and "look at it" not in resumed.out
        await at_rest(fleet)
        still = (await session.list(HOLD)).values()
        assert sorted(hold.kind.value for hold in still) == ["drain", "pause"]
        assert (await robotctl.soon("return", "hsr")).code == 0
        assert not await session.list(ORDER), "the pause is another one's"
        fleet.world.steps = 20
        assert (await robotctl.soon("resume", "--robot", "hsr")).code == 0
        await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.REACHED)

        fleet.world.steps = 1
        before = len(fleet.world.begun)
        other = Goal(goal="h", text="Bring the first cup to the living room.")
        await session.confirm(GOAL_SPEC, GoalAddress("h"), other)
        in_hand = {MotionKind.GRASP, MotionKind.STOW}
        await fleet.world.until_begun(lambda all_: kinds(all_[before:]) >= in_hand)
        fleet.world.paused = True
        assert (await robotctl.soon("goal", "delete", "h")).code == 0
        fleet.world.paused, fleet.world.steps = False, 20
        address = GoalAddress("put-down-cup_1")
        down = await value(session, GOAL_STATUS, address, state=GoalState.REACHED)
        held = fleet.world.backend.senses("hsr").holding
        attempts = [
            r.attempt
            for r in await reports(fleet, ReportState.SUCCEEDED)
            if (r.plan, r.task) == ("plan-1", "t2")
        ]
    assert "while cup_1 was in the hand of hsr" in down.note and held is None
    assert attempts == [2], "done again, and counted as no failure"


def kinds(motions: list[tuple[str, Motion]]) -> set[MotionKind]:
    return {motion.kind for _, motion in motions}


async def no_order(session: Session) -> bool:
    return not await session.list(ORDER)


async def reports(fleet: Fleet, state: ReportState) -> list[Any]:
    found = (await fleet.session.list(REPORT)).values()
    return [report for report in found if report.state is state]


async def at_rest(fleet: Fleet) -> None:
    async def idle() -> bool:
        state = await fleet.session.get(ROBOT_STATE, RobotAddress("hsr"))
        return state is not None and state.activity is RobotActivity.IDLE and not state.stops

    await until(idle, "the robot to rest")
    assert not fleet.world.backend.is_running("hsr")
