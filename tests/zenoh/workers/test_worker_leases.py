"""Leases on real keys: a robot that does not hear of its planner comes to rest by itself."""

from __future__ import annotations

from keyexpr_schema.keyspace import LEASE, ROBOT_STATE
from keyexpr_schema.payloads.leases import LeaseGrant, LeaseQuery
from keyexpr_schema.payloads.motions import MotionKind
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.system import PlannerAddress
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.payloads.waits import WaitKind, WaitReason
from tests.support.polling import until
from tests.support.worker_world import Fleet, MakeFleet

SHORT_S, LONG_S = 4.0, 3600.0


class Planner:
    """Gives leases of `length_s` while `gives` is set, and counts who asked."""

    def __init__(self, length_s: float) -> None:
        self.length_s, self.gives = length_s, True
        self.asked: list[LeaseQuery] = []

    async def give(self, _: PlannerAddress, asked: LeaseQuery) -> LeaseGrant:
        self.asked.append(asked)
        if not self.gives:
            return LeaseGrant(granted={})
        return LeaseGrant(granted=dict.fromkeys(asked.robots, self.length_s))


def drives(fleet: Fleet) -> bool:
    return any(motion.kind is MotionKind.GO_TO for _, motion in fleet.world.begun)


async def test_a_robot_whose_planner_falls_silent_rests_and_says_so_when_it_is_heard_again(
    fleet_of: MakeFleet,
) -> None:
    planner = Planner(SHORT_S)
    async with (
        fleet_of() as fleet,
        fleet.worker("hsr"),
        fleet.session.serve(LEASE, planner.give),
    ):
        fleet.world.steps = 1
        order = await fleet.order("hsr", "t1", "navigate", to="kitchen", lease_s=SHORT_S)
        await until(lambda: drives(fleet), "the robot to drive")
        fleet.world.paused = True  # it does not arrive
        planner.gives = False
        await until(lambda: not fleet.world.backend.is_running("hsr"), "the robot to rest")
        motions = len(fleet.world.begun)
        known = len(planner.asked)
        await until(lambda: len(planner.asked) > known + 3, "the worker to go on asking")
        assert len(fleet.world.begun) == motions
        planner.length_s = LONG_S  # what follows does not depend on how soon anybody asks
        planner.gives, fleet.world.paused = True, False
        report = await fleet.report(order)
        assert (report.state, report.lapsed, report.stops) == (ReportState.INTERRUPTED, True, ())
        assert report.reason == "the planner was not heard of for the length of its lease"
        again = await fleet.order("hsr", "t1", "navigate", to="kitchen", attempt=2, lease_s=LONG_S)
        assert (await fleet.report(again)).state is ReportState.SUCCEEDED
    incarnations = {run for asked in planner.asked for run in asked.robots.values()}
    assert len(incarnations) == 1


async def test_nothing_begins_before_a_lease_is_given_and_who_waits_can_be_cancelled(
    fleet_of: MakeFleet,
) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.steps = 1
        first = await fleet.order("hsr", "t1", "navigate", to="kitchen", lease_s=SHORT_S)
        planner = Planner(LONG_S)
        planner.gives = False
        async with fleet.session.serve(LEASE, planner.give):
            await until(lambda: len(planner.asked) > 3, "the worker to ask")
            assert not drives(fleet)
            waits = WaitReason(kind=WaitKind.LEASE, robot="hsr", plan=first.plan, task="t1")

            async def told() -> bool:
                state = await fleet.session.get(ROBOT_STATE, RobotAddress("hsr"))
                return state is not None and state.waits_for == (waits,)

            await until(told, "the robot to say what it waits for")
            await fleet.order(
                "hsr", "t1", "navigate", to="kitchen", cancelled=True, lease_s=SHORT_S
            )
            report = await fleet.report(first)
            assert (report.state, report.started_s) == (ReportState.CANCELLED, None)
            planner.gives = True
            later = await fleet.order("hsr", "t2", "navigate", to="kitchen", lease_s=LONG_S)
            assert (await fleet.report(later)).state is ReportState.SUCCEEDED
