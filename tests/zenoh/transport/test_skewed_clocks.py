"""A host whose clock is off takes no part, and says so, instead of writing what nobody believes."""

from __future__ import annotations

import asyncio
import time
from types import SimpleNamespace

import pytest

from fleet.service.router_process import with_port
from fleet.stores.sqlite import SqliteStore
from keyexpr_schema.errors import ClockSkewed, Unconfirmed
from keyexpr_schema.keyspace import GOAL_SPEC
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.transport.router import run_router
from keyexpr_schema.transport.session import SessionConfig, open_session
from tests.support.polling import DEADLINE_S, until
from tests.support.robotctl import Robotctl
from tests.support.session_values import goal


async def test_commands_are_refused_and_daemons_wait(tmp_path, monkeypatch, caplog):
    """The router's host is ten minutes ahead, until its clock is set right."""
    monkeypatch.setattr("keyexpr_schema.transport.clock_skew.WRONG_AGAIN_S", 0.05)
    monkeypatch.setattr("keyexpr_schema.transport.clock_skew.AGAIN_S", 0.05)
    there = SimpleNamespace(ahead_s=600.0)
    clock = SimpleNamespace(time=lambda: time.time() + there.ahead_s)
    monkeypatch.setattr("keyexpr_schema.transport.store.questions.time", clock)
    endpoint = with_port("tcp/127.0.0.1:0")
    with SqliteStore(tmp_path) as store:
        async with run_router((endpoint,), store=store):
            said = (
                "the clock of this host is 10 min behind that of the router's host, and may be 0.4"
            )
            with pytest.raises(ClockSkewed, match=said):
                async with open_session(SessionConfig((endpoint,))):
                    pass

            async def daemon() -> None:
                config = SessionConfig((endpoint,), connect_timeout_s=None)
                async with open_session(config) as session:
                    await session.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"))
                    opened.set()
                    there.ahead_s = -600.0
                    await until(lambda: session.clock.latest and session.clock.latest.too_much)

            opened = asyncio.Event()
            running = asyncio.create_task(daemon())
            await until(lambda: any(said in r.getMessage() for r in caplog.records))
            assert not opened.is_set()
            there.ahead_s = 0.0
            await asyncio.wait_for(running, DEADLINE_S)

            robotctl = Robotctl(endpoint, tmp_path)
            for ahead_s in (600.0, -600.0):
                there.ahead_s = ahead_s
                refused = await robotctl.soon("goal", "delete", "g1")
                assert (refused.code, refused.out) == (1, "")
                assert refused.err.startswith("Error: the clock of this host is 10 min ")
            assert store.select("robotfleet/goals/g1/spec")
    assert any("10 min ahead of" in record.getMessage() for record in caplog.records)


async def test_what_was_stamped_ahead_is_written_again_once_the_clock_is_right(
    session_config, monkeypatch
):
    """The host's clock was ten minutes ahead, and Zenoh's hybrid clock stays there."""
    monkeypatch.setattr("keyexpr_schema.transport.clock_skew.WRONG_AGAIN_S", 0.05)
    monkeypatch.setattr("keyexpr_schema.transport.clock_skew.AGAIN_S", 0.05)
    address = GoalAddress("g1")
    async with (
        open_session(session_config(connect_timeout_s=None)) as session,
        session.watch(GOAL_SPEC) as watch,
    ):
        stamps = session.link.stamps
        stamps.begin_anew(time.time() + 600.0)
        with pytest.raises(Unconfirmed, match="the clock of this host was ahead when it was put"):
            await session.confirm(GOAL_SPEC, address, goal("g1", "ahead"), DEADLINE_S)
        assert stamps.now_s() < time.time() + 1.0
        await session.confirm(GOAL_SPEC, address, goal("g1", "right"), DEADLINE_S)
        assert await session.get(GOAL_SPEC, address) == goal("g1", "right")
        async with asyncio.timeout(DEADLINE_S):
            while (await anext(watch)).value != goal("g1", "right"):
                pass
