"""A worker on real keys: orders in, reports and facts out."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from keyexpr_schema.errors import Overtaken
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.key import A, Key
from keyexpr_schema.keyspace import FACT, ORDER, REPORT, ROBOT_ALIVE, ROBOT_STATE, UNDECODABLE
from keyexpr_schema.payloads.motions import MotionKind
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress, RobotState
from keyexpr_schema.payloads.tasks import OrderAddress, Report, ReportAddress, ReportState
from keyexpr_schema.payloads.world import Fact, FactAddress
from tests.support.full_disk import no_room
from tests.support.polling import until
from tests.support.router_process import RouterProcess
from tests.support.worker_world import DEADLINE_S, Fleet, MakeFleet
from workers.orders.journal import Journal
from workers.skill_context import SkillContext
from workers.skill_registry import skill


def truth(fleet: Fleet, name: str) -> tuple[str | None, str | None, str | None]:
    """`(place, support, held_by)` of an object, as it really is."""
    found = next(t for t in fleet.world.backend.truths() if t.object == name)
    return found.place, found.support, found.held_by


async def state_of(fleet: Fleet, robot: str, holds: Callable[[RobotState], bool]) -> RobotState:
    fixed: dict[str, str | int] = {"robot": robot}
    async with (
        asyncio.timeout(DEADLINE_S),
        fleet.session.watch((ROBOT_STATE, fixed)) as watch,
    ):
        async for change in watch:
            if change.value is not None and holds(change.value):
                return change.value  # type: ignore[no-any-return]
    raise AssertionError("a watch does not end")


async def lose(fleet: Fleet, key: Key[A, Any], address: A) -> None:
    """Take a value out of the store; its worker may have put it again before that is known."""
    with suppress(Overtaken):
        await fleet.session.delete(key, address)


def kinds(fleet: Fleet, robot: str) -> list[MotionKind]:
    return [motion.kind for name, motion in fleet.world.begun if name == robot]


async def test_what_a_store_has_lost_of_a_robot_is_observed_again(
    fleet_of: MakeFleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("workers.runtime.REPEAT_S", 0.2)
    async with fleet_of() as fleet, fleet.worker("hsr"):
        lost = [FactAddress("hsr", AT), FactAddress("hsr", HOLDING)]
        for address in lost:

            async def said(address: FactAddress = address) -> bool:
                return await fleet.session.get(FACT, address) is not None

            await until(said, "what the worker knows when it starts")
        for address in lost:
            await lose(fleet, FACT, address)
        for address in lost:

            async def again(address: FactAddress = address) -> bool:
                return await fleet.session.get(FACT, address) is not None

            await until(again, f"{address.relation} of the robot")


async def test_a_cup_is_fetched_and_put_down_and_every_fact_is_true(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        assert (await state_of(fleet, "hsr", lambda s: s.place == "living_room")).holding is None
        first = await fleet.report(await fleet.order("hsr", "t1", "navigate", to="kitchen"))
        assert (first.state, first.reason) == (ReportState.SUCCEEDED, None)
        assert len(first.tries) == 1 and first.started_s is not None
        second = await fleet.report(
            await fleet.order("hsr", "t2", "pick", object="cup_1", place="kitchen")
        )
        assert second.state is ReportState.SUCCEEDED, second.reason
        assert truth(fleet, "cup_1")[2] == "hsr"
        held = await fleet.fact("holding", "hsr")
        at = await fleet.fact("at", "cup_1")
        assert held is not None and held.value == "cup_1" and held.source == "hsr"
        assert at is not None and at.value == "hsr"
        assert (await state_of(fleet, "hsr", lambda s: s.holding == "cup_1")).place == "kitchen"
        await fleet.report(await fleet.order("hsr", "t3", "navigate", to="hallway"))
        last = await fleet.report(
            await fleet.order("hsr", "t4", "place", object="cup_1", place="hallway")
        )
        assert last.state is ReportState.SUCCEEDED, last.reason
        assert truth(fleet, "cup_1") == ("hallway", "hallway_table", None)
        said = {(f.relation, f.subject): f.value for f in last.facts}
        assert said["at", "cup_1"] == "hallway_table" and said["holding", "hsr"] == NOTHING
        for (relation, subject), value in said.items():
            stored = await fleet.fact(relation, subject)
            assert stored is not None and stored.value == value


async def test_a_cup_is_handed_to_the_robot_with_the_basket(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"), fleet.worker("locobot"):
        drive = await fleet.order("locobot", "t1", "navigate", to="kitchen")
        await fleet.order("hsr", "t2", "navigate", to="kitchen")
        await fleet.order("hsr", "t3", "pick", object="cup_2", place="kitchen")
        await fleet.report(drive)
        give = await fleet.order(
            "hsr", "t4", "place_on_robot", object="cup_2", carrier="locobot", place="kitchen"
        )
        report = await fleet.report(give)
        assert report.state is ReportState.SUCCEEDED, report.reason
        assert truth(fleet, "cup_2")[1] == "locobot"
        said = {(f.relation, f.subject): f.value for f in report.facts}
        assert said["at", "cup_2"] == "locobot" and said["holding", "hsr"] == NOTHING
        assert (await state_of(fleet, "locobot", lambda s: s.basket == ("cup_2",))).holding is None


async def test_searching_tells_what_lies_there_and_what_does_not(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("locobot"):
        await fleet.report(await fleet.order("locobot", "t1", "navigate", to="kitchen"))
        report = await fleet.report(await fleet.order("locobot", "t2", "search", place="kitchen"))
        assert report.state is ReportState.SUCCEEDED, report.reason
        said = {(f.relation, f.subject): f.value for f in report.facts}
        assert said["at", "cup_1"] == said["at", "cup_2"] == "kitchen_table"
        assert said["searched", "kitchen"] is True


async def test_a_grasp_that_slips_twice_is_done_at_the_third_try(fleet_of: MakeFleet) -> None:
    async with fleet_of({"hsr": {"grasp": (1, 2)}}) as fleet, fleet.worker("hsr"):
        report = await fleet.report(
            await fleet.order("hsr", "t1", "pick", object="cup_1", place="kitchen")
        )
        slipped = "the object slipped out of the hand"
        assert report.state is ReportState.SUCCEEDED
        assert [t.reason for t in report.tries] == [slipped, slipped, None]
        did = kinds(fleet, "hsr")
        for n in (i for i, kind in enumerate(did) if kind is MotionKind.GRASP):
            assert did[n + 1] is MotionKind.STOW, "safe before the next try"


async def test_three_slips_are_a_failure_with_three_reasons(fleet_of: MakeFleet) -> None:
    async with fleet_of({"hsr": {"grasp": (1, 2, 3)}}) as fleet, fleet.worker("hsr"):
        report = await fleet.report(
            await fleet.order("hsr", "t1", "pick", object="cup_1", place="kitchen")
        )
        assert (report.state, report.retryable) == (ReportState.FAILED, True)
        assert [t.number for t in report.tries] == [1, 2, 3]
        assert all(t.reason == report.reason for t in report.tries)
        again = await fleet.report(
            await fleet.order("hsr", "t1", "pick", attempt=2, object="cup_1", place="kitchen")
        )
        assert again.state is ReportState.SUCCEEDED


async def test_a_cup_that_is_not_there_is_not_looked_for_for_ever(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        report = await fleet.report(
            await fleet.order("hsr", "t1", "pick", object="cup_1", place="living_room")
        )
        assert (report.state, report.retryable) == (ReportState.FAILED, False)
        assert report.reason == "cup_1 is not to be seen in living_room"
        assert {(f.relation, f.subject): f.value for f in report.facts}["at", "cup_1"] is None
        assert kinds(fleet, "hsr").count(MotionKind.LOOK) >= 2


async def test_a_cancelled_order_stops_the_robot(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.paused = True  # it sets out, and is not there before all of this has happened
        order = await fleet.order("hsr", "t1", "navigate", to="kitchen")
        waiting = await fleet.order("hsr", "t2", "navigate", to="hallway")
        await fleet.report(order, ReportState.STARTED)
        await fleet.order("hsr", "t2", "navigate", to="hallway", cancelled=True)
        dropped = await fleet.report(waiting)
        assert dropped.state is ReportState.CANCELLED and dropped.tries == ()
        await fleet.order("hsr", "t1", "navigate", to="kitchen", cancelled=True)
        await fleet.world.until_begun(lambda begun: begun[-1][1].kind is MotionKind.STOW)
        fleet.world.paused = False
        report = await fleet.report(order)
        assert report.state is ReportState.CANCELLED
        assert report.reason == "the order was cancelled"
        senses = fleet.world.backend.senses("hsr")
        assert senses.place != "kitchen" and not senses.moving


async def test_a_worker_without_room_stops_what_is_cancelled_and_goes_on_when_there_is(
    fleet_of: MakeFleet,
) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.paused = True
        order = await fleet.order("hsr", "t1", "navigate", to="kitchen")
        started = await fleet.report(order, ReportState.STARTED)
        with no_room():
            behind = await fleet.order("hsr", "t2", "navigate", to="hallway")
            troubled = await state_of(fleet, "hsr", lambda state: state.trouble is not None)
            assert troubled.trouble is not None and troubled.trouble.startswith(
                "the worker of hsr cannot write to "
            )
            await fleet.order("hsr", "t1", "navigate", to="kitchen", cancelled=True)
            await fleet.world.until_begun(lambda begun: begun[-1][1].kind is MotionKind.STOW)
            fleet.world.paused = False
            assert await fleet.session.get(REPORT, ReportAddress.of(started)) == started
        assert (await fleet.report(order)).state is ReportState.CANCELLED
        assert (await fleet.report(behind)).state is ReportState.SUCCEEDED
        assert (await state_of(fleet, "hsr", lambda state: state.trouble is None)).place


async def test_what_is_not_done_by_its_deadline_has_failed(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.steps = 1  # the drive takes longer than a look at the clock
        order = await fleet.order("hsr", "t1", "navigate", deadline_s=2.0, to="kitchen")
        report = await fleet.report(order)
        assert report.state is ReportState.FAILED
        assert report.reason == "navigate was not done within its deadline of 2 s"
        assert report.started_s is not None and report.tries[0].ended_s >= report.started_s + 2.0
        assert fleet.world.backend.senses("hsr").place != "kitchen"


async def test_an_order_that_is_withdrawn_before_its_start_is_dropped(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.paused = True
        first = await fleet.order("hsr", "t1", "navigate", to="kitchen")
        await fleet.report(first, ReportState.STARTED)
        await fleet.order("hsr", "t2", "pick", object="cup_1", place="kitchen")
        await fleet.session.delete(ORDER, OrderAddress("hsr", "p", "t2"))
        # Who answers this has heard of all that was before it.
        last = await fleet.order("hsr", "t4", "navigate", to="hallway", cancelled=True)
        assert (await fleet.report(last)).state is ReportState.CANCELLED
        third = await fleet.order("hsr", "t3", "navigate", to="hallway")
        fleet.world.paused = False
        assert (await fleet.report(third)).state is ReportState.SUCCEEDED
        assert MotionKind.GRASP not in kinds(fleet, "hsr")
        assert await fleet.session.get(REPORT, ReportAddress("hsr", "p", "t2", 1)) is None


async def test_what_a_robot_cannot_do_is_refused_with_what_it_can(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("locobot"):
        order = await fleet.order("locobot", "t1", "pick", object="cup_1", place="kitchen")
        report = await fleet.report(order)
        assert (report.state, report.retryable) == (ReportState.REFUSED, False)
        assert report.reason is not None and "carries out charge, navigate, search" in report.reason
        wrong = await fleet.report(await fleet.order("locobot", "t2", "navigate", to="attic"))
        assert wrong.state is ReportState.REFUSED
        assert wrong.reason is not None and "hallway, kitchen, living_room" in wrong.reason


async def test_an_order_of_an_older_planner_is_refused(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("locobot"):
        now = await fleet.order("locobot", "t1", "navigate", epoch=5, to="hallway")
        assert (await fleet.report(now)).state is ReportState.SUCCEEDED
        old = await fleet.order("locobot", "t2", "navigate", epoch=4, to="kitchen")
        report = await fleet.report(old)
        assert (report.state, report.retryable) == (ReportState.REFUSED, True)
        assert report.reason is not None and "epoch 4" in report.reason
        assert report.fence == 5
        assert fleet.world.backend.senses("locobot").place == "hallway"


async def test_a_report_that_was_lost_is_put_again_and_nothing_moves(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("locobot"):
        order = await fleet.order("locobot", "t1", "navigate", to="kitchen")
        report = await fleet.report(order)
        moved = len(fleet.world.begun)
        where = ReportAddress("locobot", "p", "t1", 1)
        await lose(fleet, REPORT, where)
        again = await fleet.order("locobot", "t1", "navigate", epoch=2, to="kitchen")
        assert await fleet.report(again) == report
        assert len(fleet.world.begun) == moved


async def test_a_report_that_is_lost_is_put_again_while_its_order_stands(
    fleet_of: MakeFleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without an order that is put again, and by a worker that was started anew, too."""
    monkeypatch.setattr("workers.runtime.REPEAT_S", 0.2)
    where = ReportAddress("locobot", "p", "t1", 1)
    async with fleet_of() as fleet:
        async with fleet.worker("locobot"):
            order = await fleet.order("locobot", "t1", "navigate", to="kitchen")
            report = await fleet.report(order)
            moved = len(fleet.world.begun)
            await lose(fleet, REPORT, where)
            assert await fleet.report(order) == report
        await lose(fleet, REPORT, where)
        async with fleet.worker("locobot"):
            assert await fleet.report(order) == report
            assert len(fleet.world.begun) == moved
            # An order that is gone takes its report along: nobody asks for it any more.
            await fleet.session.delete(ORDER, OrderAddress("locobot", "p", "t1"))
            other = await fleet.order("locobot", "t2", "navigate", to="kitchen")
            ended = await fleet.report(other)
            assert ended.state is ReportState.SUCCEEDED  # by then the worker knows of both orders
            await lose(fleet, REPORT, where)
            await lose(fleet, REPORT, ReportAddress.of(ended))
            assert await fleet.report(other) == ended  # it has looked again at what is missing
            assert await fleet.session.get(REPORT, where) is None


async def test_the_same_names_of_a_planner_that_lost_its_journal_are_another_attempt(
    fleet_of: MakeFleet,
) -> None:
    async with fleet_of() as fleet, fleet.worker("locobot"):
        names = ("locobot", "t1", "navigate")
        old = await fleet.order(*names, planner="before", revision=7, attempt=2, to="kitchen")
        first = await fleet.report(old)
        assert (first.state, first.planner) == (ReportState.SUCCEEDED, "before")
        new = await fleet.order(*names, planner="after", attempt=2, epoch=2, to="hallway")
        second = await fleet.report(new, newer_than=first)
        assert (second.state, second.planner) == (ReportState.SUCCEEDED, "after")
        assert fleet.world.backend.senses("locobot").place == "hallway"
        moved = len(fleet.world.begun)
        # What the planner before orders now counts for nothing, and does not hide the newer word.
        await fleet.order(*names, planner="before", revision=7, attempt=2, to="kitchen")
        late = await fleet.order("locobot", "t2", "navigate", planner="before", to="kitchen")
        assert (await fleet.report(late)).state is ReportState.REFUSED
        assert await fleet.report(new) == second
        assert len(fleet.world.begun) == moved


async def first_report(fleet: Fleet, **fixed: str) -> Report:
    """The first report on a key whose address has these values."""
    async with asyncio.timeout(DEADLINE_S), fleet.session.watch((REPORT, dict(fixed))) as watch:
        async for change in watch:
            if change.value is not None:
                return change.value  # type: ignore[no-any-return]
    raise AssertionError("a watch does not end")


async def test_orders_that_make_no_sense_disturb_nobody(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.paused = True
        running = await fleet.order("hsr", "t1", "navigate", to="kitchen")
        await fleet.report(running, ReportState.STARTED)
        fleet.world.paused = False
        keys = [ORDER.build(OrderAddress("hsr", "p", f"bad{n}")) for n in (1, 2, 3)]
        zeroth = replace(running, task="bad2", attempt=0)
        huge = replace(running, task="bad3", epoch=2**70)
        for key, data in zip(
            keys, (b'{"robot": 5}', ORDER.encode(zeroth), ORDER.encode(huge)), strict=True
        ):
            fleet.session.link.send_soon(key, data, "application/json", block=True)
        await fleet.session.confirm(ORDER, OrderAddress("hsr", "p", "other"), running)
        reasons: dict[str, str] = {}
        unusable: set[str] = set()
        async with asyncio.timeout(DEADLINE_S), fleet.session.watch(UNDECODABLE) as watch:
            async for change in watch:
                if change.value is not None and change.address.component == "worker-hsr":
                    reasons[change.value.keyexpr] = change.value.reason
                    if change.value.digest is not None:
                        unusable.add(change.value.keyexpr)
                    if len(reasons) == 3:
                        break
        assert set(reasons) == set(keys)
        assert "attempt 0 is not a count" in reasons[keys[1]]
        assert unusable == {keys[1]}, "it decodes, and is told of as long as it is there"
        report = await first_report(fleet, robot="hsr", task="other")
        assert report.state is ReportState.REFUSED and not report.retryable
        assert report.reason is not None and "orders/p/t1" in report.reason
        assert (await fleet.report(running)).state is ReportState.SUCCEEDED


async def test_a_later_attempt_takes_the_place_of_the_one_that_runs(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.paused = True
        first = await fleet.order("hsr", "t1", "navigate", to="kitchen")
        await fleet.report(first, ReportState.STARTED)
        second = await fleet.order("hsr", "t1", "navigate", attempt=2, to="hallway")
        await fleet.world.until_begun(lambda begun: begun[-1][1].kind is MotionKind.STOW)
        fleet.world.paused = False
        assert (await fleet.report(first)).state is ReportState.CANCELLED
        assert (await fleet.report(second)).state is ReportState.SUCCEEDED
        late = await fleet.order("hsr", "t1", "navigate", attempt=1, epoch=2, to="kitchen")
        assert (await fleet.report(late)).state is ReportState.CANCELLED
        assert fleet.world.backend.senses("hsr").place == "hallway"


async def test_rubbish_on_the_key_of_a_fact_is_written_over(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("locobot"):
        fleet.session.link.send_soon(
            FACT.build(FactAddress("locobot", "at")), b"5", "application/json", block=True
        )
        report = await fleet.report(await fleet.order("locobot", "t1", "navigate", to="kitchen"))
        assert report.state is ReportState.SUCCEEDED
        at = await fleet.fact("at", "locobot")
        assert at is not None and at.value == "kitchen"


@skill("gossip")
async def gossip(ctx: SkillContext) -> None:
    """Sees a cup at once, and needs the robot's while to come back and tell."""
    ctx.observe("at", "cup_1", "kitchen")
    ctx.observe("at", "cup_2", "kitchen")
    await ctx.do(MotionKind.GO_TO, place="kitchen")


async def test_what_others_saw_later_is_not_overwritten(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("locobot", gossip, skills=("gossip",)):
        fleet.world.paused = True
        order = await fleet.order("locobot", "t1", "gossip")
        started = (await fleet.report(order, ReportState.STARTED)).started_s
        assert started is not None
        later = Fact(subject="cup_1", relation="at", value="hsr", source="x", time_s=started + 0.1)
        # Whatever clocks say: the worker saw both cups before this, and tells it afterwards.
        slow_clock = replace(later, subject="cup_2", time_s=1.0)
        for fact in (later, slow_clock):
            await fleet.session.confirm(FACT, FactAddress(fact.subject, "at"), fact)
        fleet.world.paused = False
        assert (await fleet.report(order)).state is ReportState.SUCCEEDED
        one, two = await fleet.fact("at", "cup_1"), await fleet.fact("at", "cup_2")
        assert (one, two) == (later, slow_clock)


@skill("trip")
async def trip(ctx: SkillContext) -> None:
    """A skill with a bug."""
    raise KeyError("legs")


async def test_a_bug_in_a_skill_is_reported_and_the_worker_goes_on(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("locobot", trip, skills=("trip",)):
        report = await fleet.report(await fleet.order("locobot", "t1", "trip"))
        assert (report.state, report.retryable) == (ReportState.FAILED, False)
        assert report.reason == "unexpected error in skill trip: KeyError: 'legs'"
        after = await fleet.order("locobot", "t2", "navigate", to="kitchen")
        assert (await fleet.report(after)).state is ReportState.SUCCEEDED


async def test_a_report_survives_a_router_that_was_away(
    fleet_of: MakeFleet, router: RouterProcess
) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr") as worker:
        fleet.world.paused = True
        order = await fleet.order("hsr", "t1", "navigate", to="kitchen")
        await fleet.report(order, ReportState.STARTED)
        router.kill()
        fleet.world.paused = False
        async with asyncio.timeout(DEADLINE_S):
            while fleet.world.backend.senses("hsr").place != "kitchen":
                await fleet.world.tick()
        router.restart()
        report = await fleet.report(order)
        assert report.state is ReportState.SUCCEEDED
        assert report.incarnation == worker.incarnation
        at = await fleet.fact("at", "hsr")
        assert at is not None and at.value == "kitchen"


async def test_a_worker_that_is_told_to_end_says_what_it_leaves_behind(
    fleet_of: MakeFleet,
) -> None:
    async with fleet_of() as fleet:
        async with fleet.worker("hsr"):
            fleet.world.paused = True
            order = await fleet.order("hsr", "t1", "navigate", to="kitchen")
            await fleet.report(order, ReportState.STARTED)
        report = await fleet.report(order)
        assert report.state is ReportState.INTERRUPTED
        assert not fleet.world.backend.senses("hsr").moving
        state = await state_of(fleet, "hsr", lambda s: s.activity is RobotActivity.STOPPED)
        assert state.place != "kitchen"
        fleet.world.paused = False
        async with fleet.worker("hsr"):  # the order still stands, and is not begun again
            other = await fleet.order("hsr", "t2", "navigate", to="hallway")
            assert (await fleet.report(other)).state is ReportState.SUCCEEDED
        went = [m.place for n, m in fleet.world.begun if n == "hsr" and m.kind is MotionKind.GO_TO]
        assert went == ["kitchen", "hallway"]


async def test_what_was_in_the_hand_before_and_is_not_at_the_start_is_where_nobody_knows(
    fleet_of: MakeFleet, tmp_path: Path
) -> None:
    """Its last words were not sent, since no router was there when it ended."""
    async with fleet_of() as fleet:
        with Journal(tmp_path / "workers" / "hsr.journal") as journal:
            for subject, relation, value in (("hsr", HOLDING, "cup_1"), ("cup_1", AT, "hsr")):
                fact = Fact(subject=subject, relation=relation, value=value, source="hsr")
                journal.send(replace(fact, time_s=fleet.world.backend.time_s))
        async with fleet.worker("hsr"):

            async def seen() -> bool:
                hand = await fleet.fact(HOLDING, "hsr")
                return hand is not None and hand.value == NOTHING

            await until(seen, "that the hand is empty")
            order = await fleet.order("hsr", "t1", "navigate", to="kitchen")
            await fleet.report(order)  # all that was said before is in the store
            cup = await fleet.fact(AT, "cup_1")
            assert cup is not None
            assert cup.value is None


async def test_a_worker_is_alive_while_it_runs(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, asyncio.timeout(DEADLINE_S):
        watching = fleet.session.watch_tokens(ROBOT_ALIVE, robot="hsr", debounce_s=0.05)
        async with watching as tokens:
            async with fleet.worker("hsr") as worker:
                change = await anext(tokens)
                assert change.alive and change.address.incarnation == worker.incarnation
            assert not (await anext(tokens)).alive
        state = await fleet.session.get(ROBOT_STATE, RobotAddress("hsr"))
        assert state is not None and state.activity is RobotActivity.STOPPED


async def test_what_was_believed_to_lie_here_and_does_not_becomes_unknown(
    fleet_of: MakeFleet,
) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        wrong = Fact(subject="cup_1", relation="at", value="living_room", source="person")
        await fleet.session.confirm(FACT, FactAddress("cup_1", "at"), wrong)
        report = await fleet.report(await fleet.order("hsr", "t1", "search", place="living_room"))
        assert report.state is ReportState.SUCCEEDED, report.reason
        told = {(f.relation, f.subject): f.value for f in report.facts}
        assert told["at", "cup_1"] is None and ("at", "cup_2") not in told
        stored = await fleet.fact("at", "cup_1")
        assert stored is not None and (stored.value, stored.source) == (None, "hsr")


async def test_a_hand_takes_one_thing_and_takes_it_once(
    fleet_of: MakeFleet, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Nobody is going to answer: no need to wait ten seconds for it, three times.
    monkeypatch.setattr(sys.modules["workers.skills.place_on_robot"], "STATE_S", 0.1)
    async with fleet_of() as fleet, fleet.worker("hsr"):
        first = await fleet.order("hsr", "t1", "pick", object="cup_1", place="kitchen")
        assert (await fleet.report(first)).state is ReportState.SUCCEEDED
        done = len(fleet.world.begun)
        again = await fleet.order("hsr", "t1", "pick", attempt=2, object="cup_1", place="kitchen")
        assert (await fleet.report(again)).state is ReportState.SUCCEEDED
        assert len(fleet.world.begun) == done, "it holds the cup already"
        other = await fleet.report(
            await fleet.order("hsr", "t2", "pick", object="cup_2", place="kitchen")
        )
        assert (other.state, other.retryable) == (ReportState.FAILED, False)
        assert other.reason is not None and "holds cup_1 already" in other.reason
        give = await fleet.report(
            await fleet.order(
                "hsr", "t3", "place_on_robot", object="cup_1", carrier="locobot", place="kitchen"
            )
        )
        assert give.state is ReportState.FAILED
        assert give.reason == "locobot does not say where it is: is its worker running?"
        assert truth(fleet, "cup_1")[2] == "hsr"
