"""What the session promises while routers die, links drop and values are bad."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from typing import Any

import pytest
import zenoh

from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import (
    NoReply,
    Unconfirmed,
    UndecodablePayload,
    Unreachable,
)
from keyexpr_schema.keyspace import FACT, GOAL_SPEC, REJECT, ROBOT_ALIVE, SIM_MOTION, SIM_SENSES
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.motions import MotionOutcome, MotionState, Senses
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.payloads.simulation import MotionCall, SimRobotAddress
from keyexpr_schema.payloads.world import Fact, FactAddress
from keyexpr_schema.transport.connecting import zenoh_config
from keyexpr_schema.transport.session import Session, Watch, open_session
from keyexpr_schema.transport.storage import Write

AT = FactAddress("cup_1", "at")


def goal(name: str, text: str = "bring the cup") -> Goal:
    return Goal(goal=name, text=text)


def fact(value: int) -> Fact:
    return Fact(subject="cup_1", relation="at", value=value, source="test")


async def until(condition: Callable[[], Awaitable[bool]], timeout_s: float = 10.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not await condition():
            await asyncio.sleep(0.01)


async def take(watch: Any, count: int, timeout_s: float = 10.0) -> list[Any]:
    async with asyncio.timeout(timeout_s):
        return [await anext(watch) for _ in range(count)]


async def take_until_value(watch: Watch, value: object, timeout_s: float = 15.0) -> list[Any]:
    seen = []
    async with asyncio.timeout(timeout_s):
        async for change in watch:
            seen.append(None if change.value is None else change.value.value)
            if seen[-1] == value:
                break
    return seen


async def test_every_confirmed_write_outlives_kill_9_in_mid_stream(router, session_config):
    async with open_session(session_config()) as session:
        confirmed: list[int] = []

        async def write_for_ever(first: int) -> None:
            for number in range(first, 1_000_000, 4):
                address = GoalAddress(f"g{number}")
                await session.confirm(GOAL_SPEC, address, goal(address.goal), 30.0)
                confirmed.append(number)

        for _ in range(4):
            before = len(confirmed)
            first = max(confirmed, default=0) // 4 * 4 + 4
            tasks = [asyncio.create_task(write_for_ever(first + i)) for i in range(4)]

            async def grown(least: int = before + 200) -> bool:
                return len(confirmed) >= least

            await until(grown)
            router.kill()
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            promised = set(confirmed)
            router.restart()
            stored = await session.list(GOAL_SPEC, 10.0)
            missing = promised - {int(address.goal[1:]) for address in stored}
            assert not missing


async def test_a_confirm_that_spans_the_routers_death_arrives(router, session_config):
    async with open_session(session_config()) as session:
        router.kill()
        task = asyncio.create_task(session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"), 20))
        await until(lambda: _not_connected(session))
        assert not task.done()
        router.restart()
        await task
        assert await session.get(GOAL_SPEC, GoalAddress("g1")) == goal("g1")


async def _not_connected(session: Session) -> bool:
    return not session.connected


async def test_without_its_router_everything_says_so(router, session_config):
    async with open_session(session_config()) as session:
        router.kill()
        await until(lambda: _not_connected(session))
        with pytest.raises(Unreachable, match=r"no router answers at tcp/.* for 0\.3 s: start one"):
            await session.get(GOAL_SPEC, GoalAddress("g1"), 0.3)
        with pytest.raises(Unreachable):
            await session.list(GOAL_SPEC, 0.3)
        with pytest.raises(Unreachable):
            await session.wait_connected(0.2)
        with pytest.raises(Unconfirmed, match=r"goals/g1/spec was not confirmed .* no router"):
            await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"), 0.3)
        with pytest.raises(NoReply, match="no router answers"):
            await session.query(SIM_MOTION, SimRobotAddress("r1"), _call("c1"))
        router.restart()
        await session.wait_connected(10)
        assert await session.get(GOAL_SPEC, GoalAddress("g1"), 10) is None


async def test_a_session_may_open_before_its_router(router, session_config):
    router.kill()
    config = session_config(connect_timeout_s=None)

    async def opened() -> bool:
        async with open_session(config) as session:
            return session.connected

    task = asyncio.create_task(opened())
    done, _ = await asyncio.wait({task}, timeout=0.8)
    assert not done
    router.restart()
    assert await asyncio.wait_for(task, 10)


async def test_cancelling_an_open_that_waits_leaves_nothing_behind(router, session_config):
    router.kill()

    async def opened() -> None:
        async with open_session(session_config(connect_timeout_s=None)):
            pass

    task = asyncio.create_task(opened())
    done, _ = await asyncio.wait({task}, timeout=0.3)
    assert not done
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task


def test_an_exception_in_the_block_still_lets_the_interpreter_end(router):
    program = f"""
import asyncio
from keyexpr_schema.keyspace import GOAL_SPEC, ROBOT_ALIVE
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.transport.session import SessionConfig, open_session

async def main():
    async with open_session(SessionConfig(endpoints=({router.endpoint!r},))) as session:
        async with session.watch(GOAL_SPEC) as watch, session.watch_tokens(ROBOT_ALIVE):
            async with session.token(ROBOT_ALIVE, AliveAddress("r1", "a")):
                await watch.synced()
                raise RuntimeError("something broke")

asyncio.run(main())
"""
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=20
    )
    assert result.returncode == 1
    assert result.stderr.strip().endswith("RuntimeError: something broke")


async def test_a_watch_shows_what_is_stored_then_changes_then_deletions(session_config):
    async with open_session(session_config()) as session:
        await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
        async with session.watch(GOAL_SPEC, (FACT, {"subject": "cup_1"})) as watch:
            await watch.synced()
            [first] = await take(watch, 1)
            assert (first.key, first.address, first.value) == (
                GOAL_SPEC,
                GoalAddress("g1"),
                goal("g1"),
            )
            await session.confirm(FACT, AT, fact(1))
            await session.confirm(FACT, FactAddress("cup_2", "at"), fact(5))
            await session.delete(GOAL_SPEC, GoalAddress("g1"))
            changes = await take(watch, 2)
            assert [(c.key, c.value) for c in changes] == [(FACT, fact(1)), (GOAL_SPEC, None)]


async def test_a_watch_across_kill_9_misses_nothing_and_never_goes_back(router, session_config):
    async with (
        open_session(session_config(component="reader")) as reader,
        open_session(session_config(component="writer")) as writer,
        reader.watch(FACT) as watch,
    ):
        for number in range(0, 60, 20):
            for value in range(number, number + 10):
                await writer.confirm(FACT, AT, fact(value))
            router.restart()
            for value in range(number + 10, number + 20):
                await writer.confirm(FACT, AT, fact(value), 20)
            seen = await take_until_value(watch, number + 19)
            assert seen == sorted(seen)
            assert set(range(number, number + 10)) <= set(seen)


async def test_what_was_written_while_a_reader_was_cut_off_reaches_it(router, session_config):
    async with open_session(session_config()) as reader, reader.watch(FACT) as watch:
        await watch.synced()
        router.kill()
        await until(lambda: _not_connected(reader))
        router.restart()
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(7))
        assert (await take_until_value(watch, 7))[-1] == 7


async def test_a_deletion_that_a_watch_missed_is_found_by_listing(router, session_config):
    """Deleted in the store while no router ran, so that no message ever told of it."""
    async with open_session(session_config(lease_s=1.0)) as reader, reader.watch(FACT) as watch:
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(1))
            await take_until_value(watch, 1)
        router.stop()
        await until(lambda: _not_connected(reader))
        _delete_in_store(router.data_dir, "robotfleet/" + FACT.build(AT))
        router.restart()
        [change] = await take(watch, 1, 20)
        assert (change.address, change.value) == (AT, None)


def _delete_in_store(data_dir: Any, keyexpr: str) -> None:
    with SqliteStore(data_dir) as store:
        known = store.get(keyexpr)
        assert known is not None
        assert store.apply([Write(keyexpr, known.stamp + (1 << 128), True, "", b"")]) == 1


async def test_an_empty_router_is_not_taken_for_deletion(router, session_config):
    """A router without its store answers nothing; what is known stays known."""
    async with open_session(session_config()) as reader, reader.watch(FACT) as watch:
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(1))
        await take_until_value(watch, 1)
        router.kill()
        config = zenoh_config("router", listen=[router.endpoint])
        with await asyncio.to_thread(zenoh.open, config):
            await reader.wait_connected(10)
            with pytest.raises(TimeoutError):
                await take(watch, 1, 2.0)
        router.restart()
        async with open_session(session_config()) as writer:
            await writer.confirm(FACT, AT, fact(2))
        assert await take_until_value(watch, 2) == [2]


async def test_a_slow_reader_gets_only_the_latest_of_a_stream(session_config):
    async with (
        open_session(session_config()) as reader,
        open_session(session_config()) as writer,
        reader.watch(SIM_SENSES) as watch,
    ):
        for number in range(1, 51):
            writer.put(SIM_SENSES, SimRobotAddress("r1"), _senses(float(number)))

        async def newest_is_there() -> bool:
            return any(change.value.time_s == 50.0 for change in watch._ready.values())

        await until(newest_is_there)
        assert len(watch._ready) == 1


async def test_tokens_come_and_go_and_survive_the_watchers_lost_link(router, session_config):
    a, b = AliveAddress("r1", "a"), AliveAddress("r2", "b")
    async with (
        open_session(session_config()) as planner,
        open_session(session_config()) as one,
        open_session(session_config()) as two,
        one.token(ROBOT_ALIVE, a),
        planner.watch_tokens(ROBOT_ALIVE, 0.3) as watch,
    ):
        await watch.synced()
        assert [(c.address, c.alive) for c in await take(watch, 1)] == [(a, True)]
        async with two.token(ROBOT_ALIVE, b):
            assert [(c.address, c.alive) for c in await take(watch, 1)] == [(b, True)]
        assert [(c.address, c.alive) for c in await take(watch, 1)] == [(b, False)]
        router.restart()
        with pytest.raises(TimeoutError):
            await take(watch, 1, 4.0)


async def test_a_frozen_router_is_noticed_and_nobody_is_declared_lost(router, session_config):
    a = AliveAddress("r1", "a")
    async with (
        open_session(session_config(lease_s=1.0)) as planner,
        open_session(session_config()) as worker,
        worker.token(ROBOT_ALIVE, a),
        planner.watch_tokens(ROBOT_ALIVE, 0.2) as watch,
    ):
        assert (await take(watch, 1))[0].alive
        router.freeze()
        await until(lambda: _not_connected(planner))
        router.thaw()
        await planner.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"), 20)
        with pytest.raises(TimeoutError):
            await take(watch, 1, 3.0)


async def test_a_token_lost_while_the_watcher_was_cut_off_is_reported(router, session_config):
    a = AliveAddress("r1", "a")
    async with (
        open_session(session_config()) as planner,
        planner.watch_tokens(ROBOT_ALIVE, 0.3) as watch,
    ):
        async with open_session(session_config()) as worker, worker.token(ROBOT_ALIVE, a):
            assert (await take(watch, 1))[0].alive
            router.kill()
            await until(lambda: _not_connected(planner))
        router.restart()
        [change] = await take(watch, 1)
        assert (change.address, change.alive) == (a, False)


async def test_more_tokens_than_a_channel_holds(session_config):
    async with (
        open_session(session_config()) as planner,
        open_session(session_config()) as worker,
        planner.watch_tokens(ROBOT_ALIVE, 0.3) as watch,
    ):
        async with AsyncExitStack() as stack:
            for number in range(300):
                address = AliveAddress(f"r{number}", "a")
                await stack.enter_async_context(worker.token(ROBOT_ALIVE, address))
            assert len({c.address for c in await take(watch, 300) if c.alive}) == 300
        assert len({c.address for c in await take(watch, 300) if not c.alive}) == 300


def _call(name: str) -> MotionCall:
    return MotionCall(call=name, incarnation="i1")


def _senses(time_s: float) -> Senses:
    return Senses(robot="r1", time_s=time_s, pose_m_rad=(0.0, 0.0, 0.0), place=None)


async def _ask_whoever_comes(client, address, call="c1"):
    """Ask until the other session's declaration has come through the router."""
    async with asyncio.timeout(10):
        while True:
            try:
                return await client.query(SIM_MOTION, address, _call(call))
            except NoReply as error:
                if "nobody serves" not in str(error):
                    raise


async def test_questions_are_served_several_at_a_time(session_config):
    all_in = asyncio.Barrier(5)

    async def handler(address: SimRobotAddress, call: MotionCall) -> MotionOutcome:
        await all_in.wait()
        return MotionOutcome(
            state=MotionState.SUCCEEDED, senses=_senses(1.0), reason=f"{address.robot} {call.call}"
        )

    async with (
        open_session(session_config()) as server,
        open_session(session_config()) as client,
        server.serve(SIM_MOTION, handler),
    ):
        answers = await asyncio.gather(
            *(_ask_whoever_comes(client, SimRobotAddress("r1"), f"c{n}") for n in range(5))
        )
        assert sorted(answer.reason for answer in answers) == [f"r1 c{n}" for n in range(5)]


async def test_a_failing_slow_or_absent_server_is_no_answer_with_a_sentence(session_config):
    async def handler(address: SimRobotAddress, call: MotionCall) -> MotionOutcome:
        if call.call == "slow":
            await asyncio.Event().wait()
        raise ValueError("the arm is stuck")

    r1 = SimRobotAddress("r1")
    async with (
        open_session(session_config(component="sim")) as server,
        open_session(session_config()) as client,
    ):
        with pytest.raises(NoReply, match="nobody serves sim/robots/r1/motion"):
            await client.query(SIM_MOTION, r1, _call("c1"))
        async with server.serve(SIM_MOTION, handler, robot="r1"):
            with pytest.raises(NoReply, match="sim failed: the arm is stuck"):
                await _ask_whoever_comes(client, r1)
            with pytest.raises(NoReply, match="nobody serves sim/robots/r2/motion"):
                await client.query(SIM_MOTION, SimRobotAddress("r2"), _call("c1"))
            with pytest.raises(NoReply, match=r"did not answer within 0\.3 s"):
                await client.query(SIM_MOTION, r1, _call("slow"), 0.3)
            waiting = asyncio.create_task(client.query(SIM_MOTION, r1, _call("slow"), 30))
            done, _ = await asyncio.wait({waiting}, timeout=0.2)
            assert not done
        with pytest.raises(NoReply, match="sim is going away"):
            await asyncio.wait_for(waiting, 5)


BAD = [
    (b"{", "application/json", "is not a Fact"),
    (b"\xff\xfe", "application/json;robotfleet/fact/1", "is not a Fact"),
    (b'{"subject": 3}', "application/json;robotfleet/fact/1", "Expected `str`, got `int`"),
    (b"{}", "application/json;robotfleet/goal_spec/1", "this key carries 'robotfleet/fact/1'"),
    (b"{}", "application/json;robotfleet/fact/2", "version 2 of fact"),
    (b"[" * 100_000, "application/json", "is not a Fact"),
]


async def test_bad_values_are_reported_once_and_stop_nothing(router, session_config):
    keyexpr = FACT.build(AT)
    config = zenoh_config("client", connect=[router.endpoint], namespace="robotfleet")
    async with (
        open_session(session_config(component="planner")) as session,
        session.watch(FACT) as watch,
        session.watch(REJECT) as rejects,
    ):
        await watch.synced()
        await rejects.synced()
        with await asyncio.to_thread(zenoh.open, config) as foreign:
            for count, (data, encoding, reason) in enumerate(BAD, start=1):
                foreign.put(keyexpr, data, encoding=encoding)
                [change] = await take(rejects, 1)
                assert change.value.keyexpr == keyexpr
                assert reason in change.value.reason
                assert change.value.count == count
                assert change.value.component == "planner"
            assert await session.list(FACT) == {}
            with pytest.raises(UndecodablePayload):
                await session.get(FACT, AT)
            foreign.put("world/facts/k\u00fcche/at", b"{}")
            [change] = await take(rejects, 1)
            assert "is not a fact key" in change.value.reason
        for _ in range(3):  # what two listings lack counts as deleted; this key never was one
            await watch._selections[0].relist()
        await session.confirm(FACT, AT, fact(3))
        assert (await take(watch, 1))[0].value == fact(3)
        assert len(await session.list(REJECT)) == 2
