"""A simulated world behind real Zenoh: calls, clocks, stops, lost workers and lost routers."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

import pytest

from keyexpr_schema.errors import NoReply
from keyexpr_schema.keyspace import (
    SIM_CLOCK,
    SIM_MOTION,
    SIM_SCENE,
    SIM_SENSES,
    SIM_TRUTH,
    STOP,
)
from keyexpr_schema.payloads.motions import Motion, MotionKind, MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.simulation import MotionCall, SimAddress, SimClock, SimRobotAddress
from keyexpr_schema.payloads.stops import Stop, StopAddress
from keyexpr_schema.transport.session import Session, SessionConfig, open_session
from sim.embodiment import SimEmbodiment
from sim.files.mission_file import load_mission
from sim.kinematic.backend import KinematicBackend, MotionModel
from sim.server.publisher import WorldPublisher
from sim.server.sim_server import IDLE_S, REST_S, SimServer
from tests.support.child_process import child_process
from tests.support.polling import DEADLINE_S, until
from tests.support.router_process import RouterProcess
from workers.embodiment import Embodiment, SensingEmbodiment
from workers.errors import RobotUnreachable

Make = Callable[..., SessionConfig]
HSR = SimRobotAddress("hsr")
TO_KITCHEN = Motion(kind=MotionKind.GO_TO, place="kitchen")
LOOK = Motion(kind=MotionKind.LOOK)


@asynccontextmanager
async def served(
    make: Make,
    speed: float | None = None,
    step_s: float | None = None,
    kind: type[KinematicBackend] = KinematicBackend,
    **options: Any,
) -> AsyncIterator[tuple[KinematicBackend, Session]]:
    """The two-cups world without physics on a session of its own, and another session to ask."""
    mission = load_mission("two-cups")
    robots = [(robot.spec, robot.start_m_rad) for robot in mission.robots]
    backend = kind(mission.world, robots, MotionModel(), step_s=step_s)
    async with open_session(make(component="sim")) as session, open_session(make()) as asker:
        server = SimServer(session, backend, speed, **options)
        running = asyncio.create_task(server.run())
        await server.ready()
        try:
            yield backend, asker
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)


async def ask(session: Session, call: MotionCall) -> MotionOutcome:
    """Ask until somebody serves: declarations take a moment to get around."""

    async def reply() -> MotionOutcome | None:
        with suppress(NoReply):
            outcome: MotionOutcome = await session.query(SIM_MOTION, HSR, call, 5.0)
            return outcome
        return None

    outcome: MotionOutcome = await until(reply, "an answer to a motion call")
    return outcome


async def test_a_motion_is_carried_out_in_simulated_time(session_config: Make) -> None:
    async with (
        served(session_config) as (backend, asker),
        SimEmbodiment(asker, "hsr", "i1") as body,
    ):
        assert isinstance(body, Embodiment)
        outcome = await body.perform(TO_KITCHEN)
        assert outcome.state is MotionState.SUCCEEDED
        assert outcome.senses.place == "kitchen"
        assert backend.time_s > 5.0
        assert body.now_s() == pytest.approx(backend.time_s)
        assert (await body.senses()).place == "kitchen"


async def test_the_same_call_is_carried_out_once(session_config: Make) -> None:
    async with served(session_config) as (backend, asker):
        call = MotionCall(call="c1", incarnation="i1", motion=TO_KITCHEN)
        first = await ask(asker, call)
        ended_s = backend.time_s
        assert first.state is MotionState.SUCCEEDED
        assert await ask(asker, call) == first
        assert backend.time_s == ended_s


async def test_a_newer_run_of_a_worker_takes_over_for_good(session_config: Make) -> None:
    async with served(session_config, speed=0.1, step_s=0.05) as (_, asker):
        old = MotionCall(call="c1", incarnation="old", motion=TO_KITCHEN, wait_s=0.0)
        assert (await ask(asker, old)).state is MotionState.RUNNING
        new = MotionCall(call="c2", incarnation="new", wait_s=0.0)
        assert not (await ask(asker, new)).senses.moving
        refused = await ask(asker, old)
        assert refused.state is MotionState.FAILED
        assert refused.reason == "a newer run of this robot's worker drives it"


async def test_cancelling_stops_the_robot_and_it_keeps_its_hand_closed(
    session_config: Make,
) -> None:
    async with served(session_config, speed=0.1, step_s=0.05) as (backend, asker):
        body = SimEmbodiment(asker, "hsr", "i1")
        going = asyncio.create_task(body.perform(TO_KITCHEN))
        await until(lambda: backend.senses("hsr").moving)
        going.cancel()
        with pytest.raises(asyncio.CancelledError):
            await going
        assert not backend.senses("hsr").moving
        outcome = backend.outcome("hsr")
        assert outcome is not None and outcome.state is MotionState.STOPPED


async def test_a_stop_that_overtakes_its_motion_wins(session_config: Make) -> None:
    async with served(session_config) as (backend, asker):
        stop = MotionCall(call="c1", incarnation="i1", stop=True)
        assert (await ask(asker, stop)).state is MotionState.STOPPED
        late = MotionCall(call="c1", incarnation="i1", motion=TO_KITCHEN)
        assert (await ask(asker, late)).state is MotionState.STOPPED
        assert backend.time_s == 0.0


async def test_a_motion_nobody_asks_about_is_stopped(session_config: Make) -> None:
    async with served(session_config, speed=1.0, step_s=0.05, watchdog_s=0.3) as (backend, asker):
        call = MotionCall(call="c1", incarnation="i1", motion=TO_KITCHEN, wait_s=0.0)
        assert (await ask(asker, call)).state is MotionState.RUNNING
        await until(lambda: not backend.senses("hsr").moving)
        outcome = await ask(asker, call)
        assert outcome.state is MotionState.STOPPED
        assert outcome.reason == "nobody asked about it any more"


async def test_time_stands_still_while_nobody_moves(
    session_config: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sim.server.publisher.REPEAT_WALL_S", 0.1)
    async with served(session_config, grace_s=0.05) as (backend, asker):
        body = SimEmbodiment(asker, "hsr", "i1")
        await body.perform(LOOK)
        moved_s = backend.time_s
        async with asker.watch(SIM_CLOCK) as watch:
            clocks = [await anext(watch) for _ in range(3)]  # put again and again
        assert {change.value.time_s for change in clocks} == {moved_s}


class Rolling(KinematicBackend):
    """A world in which something rolls until a time."""

    rests_s = 0.0

    def at_rest(self) -> bool:
        return self.time_s >= self.rests_s


@pytest.mark.parametrize(("rests_s", "stands_s"), [(2.0, 2.0), (1e9, REST_S)])
async def test_time_goes_on_until_what_rolls_has_come_to_rest_but_not_for_ever(
    session_config: Make, rests_s: float, stands_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sim.server.publisher.REPEAT_WALL_S", 0.1)
    monkeypatch.setattr(Rolling, "rests_s", rests_s)
    async with served(session_config, step_s=0.05, kind=Rolling) as (backend, asker):
        await until(lambda: backend.time_s >= stands_s, "the time at which nothing moves")
        async with asker.watch(SIM_CLOCK) as watch:
            clocks = [await anext(watch) for _ in range(3)]  # put again and again
        assert clocks[-1].value.time_s == clocks[-2].value.time_s == backend.time_s
        assert backend.time_s == pytest.approx(stands_s, abs=0.1)


async def test_the_world_waits_for_the_next_call_of_a_robot_whose_motion_ended(
    session_config: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with served(session_config, grace_s=2.0) as (backend, asker):
        body = SimEmbodiment(asker, "hsr", "i1")
        other = SimEmbodiment(asker, "locobot", "i1")
        await body.perform(LOOK)
        looked_s = backend.time_s
        driving = asyncio.create_task(other.perform(TO_KITCHEN))
        await until(lambda: backend.senses("locobot").moving)
        looks_around = 0
        publish = WorldPublisher.publish

        def counted(self: WorldPublisher, robots: tuple[str, ...] = ()) -> None:
            nonlocal looks_around
            looks_around += 1
            publish(self, robots)

        monkeypatch.setattr(WorldPublisher, "publish", counted)
        waiting_since_s = time.monotonic()
        await body.senses()
        assert backend.time_s == looked_s  # held back for the sake of hsr
        await until(lambda: looks_around > 5)
        # A call would wake it up; without any it looks around now and then.
        assert looks_around <= 3 + (time.monotonic() - waiting_since_s) / IDLE_S
        await body.perform(LOOK)
        assert backend.time_s == pytest.approx(looked_s + 2.0)
        outcome = await driving  # hsr has no more to do, and its grace is over some time
        assert outcome.state is MotionState.SUCCEEDED


async def test_paced_time_goes_on_by_itself_and_no_faster(
    session_config: Make,
) -> None:
    began = time.monotonic()  # before it: what it is behind it may catch up
    async with served(session_config, speed=4.0, step_s=0.05) as (backend, _):
        await until(lambda: backend.time_s >= 2.0)
        assert time.monotonic() - began > 0.4


async def test_senses_truths_and_scene_are_published(session_config: Make) -> None:
    async with served(session_config) as (_, asker):
        body = SimEmbodiment(asker, "hsr", "i1")
        async with asker.watch(SIM_SENSES) as watch:
            await body.perform(TO_KITCHEN)
            async with asyncio.timeout(DEADLINE_S):
                async for change in watch:
                    if change.address.robot == "hsr" and change.value.place == "kitchen":
                        break
        await until_stored(asker)
        truths = await asker.list(SIM_TRUTH)
        assert {address.object: t.support for address, t in truths.items()} == {
            "cup_1": "kitchen_table",
            "cup_2": "kitchen_table",
        }


async def until_stored(asker: Session) -> None:
    await until(lambda: asker.get(SIM_SCENE, SimAddress()), "the scene")
    await until(lambda: asker.list(SIM_TRUTH), "the truths")


async def test_senses_are_pushed_so_that_nobody_has_to_ask(session_config: Make) -> None:
    async with served(session_config, speed=4.0, step_s=0.05) as (_, asker):
        async with SimEmbodiment(asker, "hsr", "i1") as body:
            assert isinstance(body, SensingEmbodiment)
            driving = asyncio.create_task(body.perform(TO_KITCHEN))
            heard = []
            async with asyncio.timeout(DEADLINE_S):
                while not heard or heard[-1].place != "kitchen":
                    heard.append(await body.next_senses())
            outcome = await driving
            assert [one.time_s for one in heard] == sorted(one.time_s for one in heard)
            assert any(one.moving for one in heard)
            assert body.now_s() >= outcome.senses.time_s


async def test_robots_of_a_session_share_a_clock_that_goes_back_with_the_simulation(
    session_config: Make,
) -> None:
    def tick(time_s: float) -> None:
        clock = SimClock(time_s=time_s, wall_time_s=time.time(), speed=None)
        sim.put(SIM_CLOCK, SimAddress(), clock)

    async with (
        open_session(session_config(component="sim")) as sim,
        open_session(session_config()) as asker,
        SimEmbodiment(asker, "hsr", "i1") as one,
    ):
        async with SimEmbodiment(asker, "locobot", "i2") as other:
            for time_s in (50.0, 51.0, 0.5):

                def heard(time_s: float = time_s) -> bool:
                    tick(time_s)
                    return one.now_s() == other.now_s() == time_s

                await until(heard, f"both to hear of {time_s:g} s")
        await until(lambda: tick(2.0) or one.now_s() == 2.0, "the one that is left to hear")
        late = Senses(robot="hsr", time_s=1e9, pose_m_rad=(1.0, 2.0, 0.0), place="kitchen")
        sim.put(SIM_SENSES, SimRobotAddress("hsr"), late)
        await until(lambda: one.now_s() == 1e9, "the senses to be heard")
        await until(lambda: tick(2.0) or one.now_s() == 2.0, "that the clock is right")


async def test_an_unknown_robot_is_named_together_with_those_there_are(
    session_config: Make,
) -> None:
    async with served(session_config) as (_, asker):
        await ask(asker, MotionCall(call="c0", incarnation="i1"))
        with pytest.raises(NoReply, match=r"no robot 'r2d2' in this world; there are hsr, locobot"):
            await asker.query(
                SIM_MOTION, SimRobotAddress("r2d2"), MotionCall(call="c1", incarnation="i1")
            )


async def test_a_router_that_goes_away_ends_neither_world_nor_motion(
    session_config: Make, router: RouterProcess
) -> None:
    patient = {"watchdog_s": 1.0, "unlinked_s": 3600.0}
    async with served(session_config, speed=2.5, step_s=0.05, **patient) as (backend, asker):
        body = SimEmbodiment(asker, "hsr", "i1", patience_s=DEADLINE_S)
        going = asyncio.create_task(body.perform(TO_KITCHEN))
        await until(lambda: backend.senses("hsr").moving)
        await asyncio.to_thread(router.kill)
        gone_s = backend.time_s
        await until(lambda: backend.time_s > gone_s + 5.0)  # twice what the watchdog waits
        assert backend.senses("hsr").moving
        await asyncio.to_thread(router.restart)
        outcome = await going
        assert outcome.state is MotionState.SUCCEEDED
        await until_stored(asker)


async def test_a_world_that_is_cut_off_for_long_stops_its_robots(
    session_config: Make, router: RouterProcess
) -> None:
    """Nobody could: whoever drives them may believe that they rest."""
    quick = {"watchdog_s": 2.0, "unlinked_s": 2.0}
    async with served(session_config, speed=0.1, step_s=0.05, **quick) as (backend, asker):
        await ask(asker, MotionCall(call="c0", incarnation="i1"))  # it is served by now
        body = SimEmbodiment(asker, "hsr", "i1", patience_s=0.2)
        going = asyncio.create_task(body.perform(TO_KITCHEN))
        await until(lambda: backend.senses("hsr").moving)
        await asyncio.to_thread(router.kill)
        await until(lambda: not backend.senses("hsr").moving, "the robot to rest")
        with pytest.raises(RobotUnreachable):
            await going


async def test_without_a_simulation_the_body_is_unreachable(session_config: Make) -> None:
    async with open_session(session_config()) as session:
        body = SimEmbodiment(session, "hsr", "i1", patience_s=0.3)
        with pytest.raises(RobotUnreachable, match="the simulation does not answer: nobody serves"):
            await body.perform(LOOK)


async def test_the_process_says_when_it_is_ready_and_ends_on_sigterm(router: RouterProcess) -> None:
    code = (
        "from sim.server.process import run_simulation; "
        f"run_simulation('two-cups', ({router.endpoint!r},), backend='kinematic', speed=None)"
    )
    async with child_process(sys.executable, "-c", code) as process, asyncio.timeout(DEADLINE_S):
        assert process.stdout is not None and process.stderr is not None
        line = await process.stdout.readline()
        assert line == b"world home running: 2 robots, 2 objects\n"
        os.kill(process.pid, signal.SIGTERM)
        assert await process.wait() == 0
        assert await process.stderr.read() == b""


async def test_an_emergency_stop_holds_a_driver_whose_worker_is_dead(session_config: Make) -> None:
    everything_rests = Stop(stop="s1")
    async with served(session_config, speed=0.1, watchdog_s=3600.0) as (backend, asker):
        begun = MotionCall(call="c1", incarnation="i1", motion=TO_KITCHEN, wait_s=0.0)
        assert (await ask(asker, begun)).state is MotionState.RUNNING
        await asker.confirm(STOP, StopAddress("s1"), everything_rests)
        await until(lambda: not backend.is_running("hsr"), "the robot to come to rest")
        await until(lambda: backend.held == {"hsr", "locobot"}, "nobody to make way any more")
        assert (await ask(asker, begun)).state is MotionState.STOPPED
        another = MotionCall(call="c2", incarnation="i1", motion=TO_KITCHEN, wait_s=0.0)
        refused = await ask(asker, another)
        assert (refused.state, refused.reason) == (MotionState.STOPPED, "emergency stop s1")
        assert not backend.is_running("hsr")
        await asker.delete(STOP, StopAddress("s1"))

        async def goes() -> bool:
            return (await ask(asker, another)).state is MotionState.RUNNING

        await until(goes, "the motion to begin when the stop is over")
        assert not backend.held
