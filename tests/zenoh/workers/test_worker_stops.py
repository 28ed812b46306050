"""Emergency stops on real keys: the worker obeys them by itself, whoever gave them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial

from keyexpr_schema.facts import NOTHING
from keyexpr_schema.keyspace import ROBOT_STATE, STOP, STOP_RELEASE
from keyexpr_schema.payloads.motions import Motion, MotionKind
from keyexpr_schema.payloads.programs import ProgramEnd
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.stops import Stop, StopAddress, StopRelease, StopReleaseAddress
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from tests.support.polling import DEADLINE_S, until
from tests.support.worker_world import Fleet, MakeFleet
from workers.shared_watch import SharedWatch

HSR = RobotAddress("hsr")


async def stop(session: Session, name: str, *robots: str) -> None:
    await session.confirm(STOP, StopAddress(name), Stop(stop=name, robots=robots, by="ana"))


async def lift(session: Session, name: str) -> None:
    await session.delete(STOP, StopAddress(name))


async def rests_by(fleet: Fleet, *names: str) -> None:
    async def obeyed() -> bool:
        state = await fleet.session.get(ROBOT_STATE, HSR)
        return state is not None and state.stops == names

    await until(obeyed, f"the robot to say that it rests by {names}")


def begun(kind: MotionKind) -> Callable[[list[tuple[str, Motion]]], bool]:
    return lambda motions: ("hsr", kind) in [(name, motion.kind) for name, motion in motions]


def moves(fleet: Fleet) -> bool:
    return fleet.world.backend.is_running("hsr")


@asynccontextmanager
async def on_the_way(fleet: Fleet) -> AsyncIterator[None]:
    """Within the block the world stands still, so that nobody arrives before a word does."""
    fleet.world.paused = True
    yield
    fleet.world.paused = False


async def test_a_robot_that_drives_comes_to_rest_and_its_work_goes_on_from_the_facts(
    fleet_of: MakeFleet,
) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.steps = 1
        order = await fleet.order("hsr", "t1", "navigate", to="kitchen")
        await fleet.world.until_begun(begun(MotionKind.GO_TO))
        async with on_the_way(fleet):
            await stop(fleet.session, "s1")
            await rests_by(fleet, "s1")
        assert not moves(fleet)
        motions = len(fleet.world.begun)
        later = await fleet.order("hsr", "t2", "navigate", to="hallway")
        pose = fleet.world.backend.senses("hsr").pose_m_rad
        await stop(fleet.session, "s2", "hsr")
        await rests_by(fleet, "s1", "s2")
        await lift(fleet.session, "s1")
        await rests_by(fleet, "s2")
        assert len(fleet.world.begun) == motions
        assert fleet.world.backend.senses("hsr").pose_m_rad == pose
        release = StopRelease(stop="s2", robot="hsr")
        await fleet.session.confirm(STOP_RELEASE, StopReleaseAddress("s2", "hsr"), release)
        report = await fleet.report(order)
        assert (report.state, report.stops) == (ReportState.INTERRUPTED, ("s1",))
        assert report.reason == "emergency stop s1 by ana"
        assert (await fleet.report(later)).state is ReportState.SUCCEEDED
        await rests_by(fleet)


async def test_an_order_that_is_cancelled_during_a_stop_ends_then(fleet_of: MakeFleet) -> None:
    async with fleet_of() as fleet, fleet.worker("hsr"):
        fleet.world.steps = 1
        order = await fleet.order("hsr", "t1", "navigate", to="kitchen")
        await fleet.world.until_begun(begun(MotionKind.GO_TO))
        async with on_the_way(fleet):
            await stop(fleet.session, "s1", "hsr")
            await rests_by(fleet, "s1")
        await fleet.order("hsr", "t1", "navigate", to="kitchen", cancelled=True)
        report = await fleet.report(order)
        assert report.state is ReportState.CANCELLED and not moves(fleet)


async def test_what_was_put_down_when_the_order_was_cancelled_is_not_with_the_robot(
    fleet_of: MakeFleet,
) -> None:
    """The hand had opened, and nobody had looked where the cup is: then nobody knows it."""
    async with fleet_of() as fleet, fleet.worker("hsr"):
        await fleet.order("hsr", "t1", "navigate", to="kitchen")
        cup = {"object": "cup_1", "place": "kitchen"}
        assert (await fleet.report(await fleet.order("hsr", "t2", "pick", **cup))).facts
        fleet.world.steps = 1
        order = await fleet.order("hsr", "t3", "place", **cup)
        await fleet.world.until_begun(begun(MotionKind.RELEASE))
        motions = len(fleet.world.begun)
        await fleet.world.until_begun(lambda all_begun: len(all_begun) > motions)
        async with on_the_way(fleet):
            await stop(fleet.session, "s1", "hsr")
            await rests_by(fleet, "s1")
        await fleet.order("hsr", "t3", "place", cancelled=True, **cup)
        report = await fleet.report(order)
        said = {(fact.relation, fact.subject): fact.value for fact in report.facts}
        assert report.state is ReportState.CANCELLED
        assert (said["holding", "hsr"], said["at", "cup_1"]) == (NOTHING, None)
        at = await fleet.fact("at", "cup_1")
        assert at is not None and at.value is None


async def test_a_worker_that_starts_into_a_stop_stays_still(
    fleet_of: MakeFleet,
) -> None:
    """Also one that had been killed in the middle of an attempt, and so would look around."""
    async with fleet_of() as fleet:
        async with fleet.worker("hsr"):
            fleet.world.steps = 1
            order = await fleet.order("hsr", "t1", "navigate", to="kitchen")
            await fleet.world.until_begun(begun(MotionKind.GO_TO))
        motions = len(fleet.world.begun)
        await stop(fleet.session, "s1")
        starting = asyncio.create_task(entered(fleet))
        await rests_by(fleet, "s1")
        assert len(fleet.world.begun) == motions
        await lift(fleet.session, "s1")
        await starting
        assert (await fleet.report(order)).state is ReportState.INTERRUPTED


async def entered(fleet: Fleet) -> None:
    async with fleet.worker("hsr"):
        await rests_by(fleet)


async def test_whoever_gives_the_stop_is_stopped_too(
    session_config: Callable[..., SessionConfig],
) -> None:
    """A stop that goes out by a worker's own session comes back to it."""
    async with open_session(session_config()) as session:
        shared = SharedWatch(session, "hsr")
        following = asyncio.create_task(shared.run())
        await shared.synced()
        await stop(session, "s1")
        async with asyncio.timeout(DEADLINE_S):
            await shared.stops("hsr").stopped()
        following.cancel()
        await asyncio.wait([following])


async def test_a_program_goes_on_at_the_call_that_was_interrupted(fleet_of: MakeFleet) -> None:
    code = 'navigate(to="kitchen")\nnavigate(to="hallway")\n'
    async with fleet_of() as fleet, fleet.worker("hsr"):
        order = await fleet.programmed("hsr", code)
        to_hallway = partial(goes_to, "hallway")
        await fleet.world.until_begun(to_hallway)
        async with on_the_way(fleet):
            await stop(fleet.session, "s1")
            await rests_by(fleet, "s1")
        await lift(fleet.session, "s1")
        report = await fleet.report(order)
        assert report.state is ReportState.SUCCEEDED, report.reason
        assert report.program is not None and report.program.end is ProgramEnd.DONE
        places = [motion.place for _, motion in fleet.world.begun if motion.place]
        assert places == ["kitchen", "hallway", "hallway"]


def goes_to(place: str, motions: list[tuple[str, Motion]]) -> bool:
    return any(motion.place == place for _, motion in motions)
