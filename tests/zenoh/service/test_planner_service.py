"""The planner process on a real router; the test plays the robots' part on their keys."""

from __future__ import annotations

import asyncio
import shutil
from contextlib import suppress
from pathlib import Path

import pytest
from msgspec.structs import replace

from keyexpr_schema.errors import Overtaken
from keyexpr_schema.keyspace import (
    ANSWER,
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    ORDER,
    PLAN_PROPOSAL,
    PLAN_REQUEST,
    PLAN_SPEC,
    PLAN_STATUS,
    PLANNER_STATUS,
    ROBOT_ALIVE,
    ROBOT_SPEC,
    STORE_JOURNAL,
    TASK_RECORD,
    UNDECODABLE,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress, GoalState
from keyexpr_schema.payloads.plans import Plan, PlanAddress, PlanState, Task
from keyexpr_schema.payloads.requests import PlanRequest, RequestAddress
from keyexpr_schema.payloads.robots import AliveAddress, RobotAddress
from keyexpr_schema.payloads.system import PlannerAddress, StoreAddress, StoreQuery
from keyexpr_schema.payloads.tasks import OrderAddress
from keyexpr_schema.payloads.world import FactAddress
from keyexpr_schema.transport.link import Put
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.household import fact, manipulator
from tests.support.planner_process import (
    PlannerProcess,
    ask_for_plan,
    carry_out,
    finish,
    next_order,
    person,
    planner,
    value,
)
from tests.support.polling import DEADLINE_S, until
from tests.support.robotctl import Robotctl
from tests.support.router_process import RouterProcess


async def test_a_goal_is_planned_ordered_and_reached(router: RouterProcess, tmp_path: Path) -> None:
    async with planner(router.endpoint, tmp_path), person(router.endpoint) as session:
        await ask_for_plan(session)
        await finish(session, set())

        async def nothing_ordered() -> bool:
            return await session.list(ORDER) == {}

        await until(nothing_ordered, "the end of all orders")


async def test_kill_9_in_the_middle_gives_no_attempt_twice(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path) as first:
        await ask_for_plan(session)
        before = await next_order(session, set())
        first.kill()
        done = {before.task}
        # The robot reports while no planner is there; the next one has to find it.
        await carry_out(session, before)
        await first.start()
        after = await next_order(session, done)
        assert after.epoch == before.epoch + 1
        assert after.attempt == 1
        await finish(session, done)


async def test_a_router_that_is_killed_loses_nothing(router: RouterProcess, tmp_path: Path) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path):
        await ask_for_plan(session)
        order = await next_order(session, set())
        router.kill()
        router.restart()
        await carry_out(session, order)
        await finish(session, {order.task})


async def test_a_planner_that_lost_its_journal_repeats_nothing(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path / "one"):
            await ask_for_plan(session)
            await finish(session, set())
        shutil.rmtree(tmp_path / "one")
        async with planner(router.endpoint, tmp_path / "two"):
            request = PlanRequest(request="r2")
            await session.confirm(PLAN_REQUEST, RequestAddress("r2"), request)
            answer = await value(session, ANSWER, RequestAddress("r2"), accepted=False)
            assert "no goal that waits" in answer.sentence
            assert await session.list(ORDER) == {}


async def test_a_planner_that_lost_its_journal_cancels_what_the_other_ordered(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path / "one") as first:
            await ask_for_plan(session)
            order = await next_order(session, set())
            first.kill()
        shutil.rmtree(tmp_path / "one")
        async with planner(router.endpoint, tmp_path / "two"):
            address = OrderAddress.of(order)
            cancelled = await value(session, ORDER, address, cancelled=True)
            assert (cancelled.planner, cancelled.attempt) == (order.planner, order.attempt)
            await carry_out(session, cancelled)

            async def gone() -> bool:
                return await session.get(ORDER, address) is None

            await until(gone, "the order is withdrawn")


async def test_a_planner_that_lost_its_journal_hears_what_was_reported_before_it_came(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path / "one") as first:
            await ask_for_plan(session)
            order = await next_order(session, set())
            first.kill()
        shutil.rmtree(tmp_path / "one")
        await carry_out(session, order)
        async with planner(router.endpoint, tmp_path / "two"):

            async def gone() -> bool:
                return await session.get(ORDER, OrderAddress.of(order)) is None

            await until(gone, "the order is withdrawn")


async def test_a_status_that_the_store_has_lost_is_published_again(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session, planner(router.endpoint, tmp_path):

        async def said() -> bool:
            status = await session.get(PLANNER_STATUS, PlannerAddress())
            return status is not None and bool(status.planners)

        await until(said, "what the planner can do")
        before = await session.get(PLANNER_STATUS, PlannerAddress())
        with suppress(Overtaken):  # by the planner's own, if that was quicker than the answer
            await session.delete(PLANNER_STATUS, PlannerAddress())
        await until(said, "the same again")
        assert await session.get(PLANNER_STATUS, PlannerAddress()) == before


async def test_durations_are_learned_and_outlive_the_planners_journal(
    router: RouterProcess, tmp_path: Path
) -> None:
    robotctl = Robotctl(router.endpoint, tmp_path, realm="test")
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path / "one"):
            await ask_for_plan(session)
            await finish(session, set(), took_s=73.0)
        (known,) = (await robotctl.soon("durations", "--json")).data
        assert known["model"] == "hsr"
        assert known["skills"]["pick"]["mean"] == (27.0 + 73.0) / 2
        assert "50.0 s  23.0 s  1" in (await robotctl.soon("durations")).out
        shutil.rmtree(tmp_path / "one")
        async with planner(router.endpoint, tmp_path / "two"):
            again = Goal(goal="g2", text="Bring cup 1 to the kitchen")
            await session.confirm(GOAL_SPEC, GoalAddress("g2"), again)
            await value(session, GOAL_STATUS, GoalAddress("g2"), state=GoalState.WAITING)
            request = PlanRequest(request="r2", plan="p2", goals=("g2",))
            await session.confirm(PLAN_REQUEST, RequestAddress("r2"), request)
            await value(session, ANSWER, RequestAddress("r2"), accepted=True)
            tasks = (await session.list(TASK_RECORD, plan="p2")).values()
            assert [task.duration_s for task in tasks if task.skill == "pick"] == [50.0]


async def test_what_a_lost_robot_was_to_do_goes_to_another(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with (
        person(router.endpoint) as session,
        planner(router.endpoint, tmp_path, "--lost-after", "0.5", "--lease", "0"),
    ):
        async with (
            open_session(session.config) as robot,
            robot.token(ROBOT_ALIVE, AliveAddress("near", "i1")),
        ):
            await robot.confirm(ROBOT_SPEC, RobotAddress("near"), manipulator("near"))
            for known in (fact("near", "at", "kitchen"), fact("near", "holding", "nothing")):
                await robot.confirm(FACT, FactAddress.of(known.key), known)
            await ask_for_plan(session)
            await until(lambda: session.list(ORDER, robot="near"), "an order for the nearest")
        # Its worker is gone now, and does not come back.
        await finish(session, set())
        status = await session.get(PLAN_STATUS, PlanAddress("p"))
        assert status is not None
        assert status.revision == 2
        assert set(status.allocation.values()) == {"hsr"}


async def test_a_second_planner_takes_charge_and_the_first_stops(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with planner(router.endpoint, tmp_path / "one") as first:
        async with planner(router.endpoint, tmp_path / "two"):
            assert first.process is not None
            assert await asyncio.to_thread(first.process.wait, DEADLINE_S) == 1
            assert "took charge" in first.end()


async def test_two_planners_on_one_journal_are_refused(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with planner(router.endpoint, tmp_path):
        second = PlannerProcess(router.endpoint, tmp_path)
        with pytest.raises(AssertionError):
            await second.start()
        assert "another planner works with" in second.end()


async def test_what_is_malformed_or_unknown_is_told_and_disturbs_nobody(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with planner(router.endpoint, tmp_path), person(router.endpoint) as session:
        for keyexpr in ("goals/bad/spec", "requests/plan/bad", "world/facts/cup_1/colour"):
            data = b'{"goal": 7, "text":'
            stamp = session.link.new_timestamp()
            await session.link.send(Put(keyexpr, data, "application/json", stamp))
        dragon = Goal(goal="dragon", text="Bring the dragon to the hallway")
        await session.confirm(GOAL_SPEC, GoalAddress("dragon"), dragon)
        status = await value(session, GOAL_STATUS, GoalAddress("dragon"), state=GoalState.REJECTED)
        assert "known are cup_1" in status.reason

        async def rejected() -> bool:
            rejects = await session.list(UNDECODABLE, component="planner")
            return len(rejects) == 3

        await until(rejected, "three rejects")
        await ask_for_plan(session)
        await finish(session, set())


async def test_a_goal_deleted_while_no_planner_is_there_is_forgotten(
    router: RouterProcess, tmp_path: Path
) -> None:
    async with person(router.endpoint) as session:
        async with planner(router.endpoint, tmp_path):
            goal = Goal(goal="g", text="Bring cup 1 to the hallway")
            await session.confirm(GOAL_SPEC, GoalAddress("g"), goal)
            await value(session, GOAL_STATUS, GoalAddress("g"), state=GoalState.WAITING)
        await session.delete(GOAL_SPEC, GoalAddress("g"))
        async with planner(router.endpoint, tmp_path):

            async def gone() -> bool:
                return await session.get(GOAL_STATUS, GoalAddress("g")) is None

            await until(gone, "the status of the deleted goal to go")


async def test_a_proposal_is_taken_when_a_planner_starts_and_a_spec_of_nobody_goes(
    router: RouterProcess, tmp_path: Path
) -> None:
    task = Task(task="t1", skill="navigate", args={"robot": "?a1", "to": "hallway"}, actor="a1")
    plan = Plan(plan="mine", goals=(), conditions=(), tasks=(task,), autostart=False)
    async with person(router.endpoint) as session:
        await session.confirm(PLAN_PROPOSAL, PlanAddress("mine"), plan)
        await session.confirm(PLAN_SPEC, PlanAddress("old"), replace(plan, plan="old"))
        async with planner(router.endpoint, tmp_path):
            status = await value(session, PLAN_STATUS, PlanAddress("mine"), state=PlanState.READY)
            assert status.allocation == {"a1": "hsr"}

            async def gone() -> bool:
                return await session.get(PLAN_SPEC, PlanAddress("old")) is None

            await until(gone, "the deletion of a plan that no planner made")
            assert await session.get(PLAN_STATUS, PlanAddress("old")) is None


async def test_a_planner_may_start_before_its_router(tmp_path: Path) -> None:
    router = RouterProcess(tmp_path / "router")
    router.kill()
    process = PlannerProcess(router.endpoint, tmp_path / "planner")
    starting = asyncio.create_task(process.start())
    try:
        router.restart()
        await starting
        config = SessionConfig(endpoints=(router.endpoint,), realm="test")
        async with open_session(config) as session:
            status = await session.get(PLANNER_STATUS, PlannerAddress())
            assert status is not None
            assert status.epoch == 1
            assert OrderAddress("hsr", "p", "t") not in await session.list(ORDER)
    finally:
        process.end()
        router.kill()


async def test_planners_that_start_together_never_have_the_same_epoch(
    router: RouterProcess, tmp_path: Path
) -> None:
    """Each takes a higher one than those before it; all but the last then stop, and say so."""
    processes = [PlannerProcess(router.endpoint, tmp_path / str(n)) for n in range(3)]
    config = SessionConfig(endpoints=(router.endpoint,), realm="test")
    charges: dict[int, set[str]] = {}
    try:
        async with open_session(config) as session:
            await asyncio.gather(*(p.start() for p in processes), return_exceptions=True)
            async with asyncio.timeout(DEADLINE_S):
                while len(charges) < len(processes):
                    asked = StoreQuery(after=0)
                    journal = await session.query(STORE_JOURNAL, StoreAddress(), asked)
                    for entry in journal.entries:
                        if entry.keyexpr == PLANNER_STATUS.build(PlannerAddress()):
                            status = PLANNER_STATUS.decode(entry.value.encode())
                            charges.setdefault(status.epoch, set()).add(status.incarnation)
            assert sorted(charges) == [1, 2, 3]
            assert all(len(each) == 1 for each in charges.values())

            async def one_is_left() -> bool:
                alive = [p for p in processes if p.process and p.process.poll() is None]
                return len(alive) == 1

            await until(one_is_left, "all planners but one to stop")
    finally:
        said = [process.end() for process in processes if process.process is not None]
    assert sum("took charge of realm" in each for each in said) == 2
