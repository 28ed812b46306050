"""A session opens, closes and says what is missing, whatever routers do."""

from __future__ import annotations

import asyncio
import gc
import re
import subprocess
import sys
import threading

import pytest

from keyexpr_schema.errors import BadEndpoint, NoReply, Unconfirmed, Unreachable
from keyexpr_schema.keyspace import GOAL_SPEC, SIM_MOTION
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.simulation import SimRobotAddress
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import goal, motion_call, not_connected


async def test_without_a_router_opening_fails_with_one_sentence():
    with pytest.raises(Unreachable, match=r"no router answers at tcp/127.0.0.1:9: start one with"):
        async with asyncio.timeout(DEADLINE_S), open_session(SessionConfig(("tcp/127.0.0.1:9",))):
            pass


@pytest.mark.parametrize("endpoint", ["nonsense", "127.0.0.1:7447", "tcp/no-such-host.invalid:1"])
async def test_an_endpoint_that_is_none_is_one_sentence(endpoint):
    with pytest.raises((BadEndpoint, Unreachable), match=re.escape(endpoint)):
        async with open_session(SessionConfig(endpoints=(endpoint,), connect_timeout_s=1.0)):
            pass


async def test_without_its_router_everything_says_so(router, session_config):
    async with open_session(session_config()) as session:
        router.kill()
        await until(lambda: not_connected(session))
        with pytest.raises(Unreachable, match=r"no router answers at tcp/.* for 0\.3 s: start one"):
            await session.get(GOAL_SPEC, GoalAddress("g1"), 0.3)
        with pytest.raises(Unreachable):
            await session.list(GOAL_SPEC, 0.3)
        with pytest.raises(Unreachable):
            await session.wait_connected(0.2)
        with pytest.raises(Unconfirmed, match=r"goals/g1/spec was not confirmed .* no router"):
            await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"), 0.3)
        with pytest.raises(NoReply, match="no router answers"):
            await session.query(SIM_MOTION, SimRobotAddress("r1"), motion_call("c1"))
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
    assert await asyncio.wait_for(task, DEADLINE_S)


async def test_cancelling_an_open_that_waits_leaves_nothing_behind(router, session_config):
    router.kill()

    async def opened() -> None:
        async with open_session(session_config(connect_timeout_s=None)):
            pass

    told: list[object] = []
    asyncio.get_running_loop().set_exception_handler(lambda _, about: told.append(about))
    task = asyncio.create_task(opened())
    done, _ = await asyncio.wait({task}, timeout=0.3)
    assert not done
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    # What goes on in a thread fails later, and asyncio tells nobody of that.
    await until(lambda: not [each for each in threading.enumerate() if each.name == "zenoh_0"])
    await asyncio.to_thread(gc.collect)
    assert told == []


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
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=DEADLINE_S
    )
    assert result.returncode == 1
    assert result.stderr.strip().endswith("RuntimeError: something broke")


async def test_a_session_opens_to_the_next_router_where_the_first_is_gone(router):
    for endpoints in (("tcp/127.0.0.1:9", router.endpoint), (router.endpoint, "tcp/127.0.0.1:9")):
        async with open_session(SessionConfig(endpoints, connect_timeout_s=DEADLINE_S)) as session:
            assert session.connected
    config = SessionConfig(("tcp/127.0.0.1:9", router.endpoint), connect_timeout_s=None)
    async with asyncio.timeout(DEADLINE_S), open_session(config) as session:
        assert session.connected
