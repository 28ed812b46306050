"""Tokens come and go; losing the own link is not the death of everybody else."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack

import pytest

from keyexpr_schema.keyspace import GOAL_SPEC, ROBOT_ALIVE
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.transport.link import Replies
from keyexpr_schema.transport.liveliness import LOOKS
from keyexpr_schema.transport.samples import Sample
from keyexpr_schema.transport.session import open_session
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import goal, not_connected, take
from tests.support.tokens import there


@pytest.fixture
def slow_reunion(monkeypatch):
    """However long the others take to come back on a busy machine."""
    monkeypatch.setattr("keyexpr_schema.transport.liveliness.REUNION_S", DEADLINE_S)


async def test_tokens_come_and_go_and_survive_the_watchers_lost_link(
    router, session_config, slow_reunion
):
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
        await there(planner, a)
        # Of what came before this nothing was told.
        async with two.token(ROBOT_ALIVE, b):
            assert [(c.address, c.alive) for c in await take(watch, 1)] == [(b, True)]
            assert watch.alive == {a, b}


async def test_a_frozen_router_is_noticed_and_nobody_is_declared_lost(
    router, session_config, slow_reunion
):
    a, b = AliveAddress("r1", "a"), AliveAddress("r2", "b")
    async with (
        open_session(session_config(lease_s=1.0)) as planner,
        open_session(session_config()) as worker,
        worker.token(ROBOT_ALIVE, a),
        planner.watch_tokens(ROBOT_ALIVE, 0.2) as watch,
    ):
        assert (await take(watch, 1))[0].alive
        router.freeze()
        await until(lambda: not_connected(planner))
        router.thaw()
        await planner.confirm(GOAL_SPEC, GoalAddress("g1"), goal("g1"), DEADLINE_S)
        await there(planner, a)
        async with worker.token(ROBOT_ALIVE, b):
            assert [(c.address, c.alive) for c in await take(watch, 1)] == [(b, True)]
            assert watch.alive == {a, b}


async def test_a_token_lost_while_the_watcher_was_cut_off_is_reported(router, session_config):
    a = AliveAddress("r1", "a")
    async with (
        open_session(session_config()) as planner,
        planner.watch_tokens(ROBOT_ALIVE, 0.3) as watch,
    ):
        async with open_session(session_config()) as worker, worker.token(ROBOT_ALIVE, a):
            assert (await take(watch, 1))[0].alive
            router.kill()
            await until(lambda: not_connected(planner))
        router.restart()
        [change] = await take(watch, 1)
        assert (change.address, change.alive) == (a, False)


async def test_a_token_that_goes_while_it_is_looked_for_stays_gone(
    router, session_config, monkeypatch
):
    """The answer that still has it comes after the word that it is withdrawn."""
    gone = asyncio.Event()
    a = AliveAddress("r1", "a")

    def heard(sample: Sample) -> None:
        if sample.deleted:
            gone.set()

    async with (
        open_session(session_config()) as planner,
        open_session(session_config()) as worker,
        AsyncExitStack() as working,
    ):
        await working.enter_async_context(worker.token(ROBOT_ALIVE, a))
        tokens = planner.link.tokens

        async def late(pattern: str, timeout_s: float) -> Replies:
            replies = await tokens(pattern, timeout_s)
            monkeypatch.undo()
            await working.aclose()
            await until(gone.is_set, "the word that the token is withdrawn")
            return replies

        await there(planner, a)
        monkeypatch.setattr(planner.link, "tokens", late)
        async with (
            planner.link.tokens_watched(ROBOT_ALIVE.pattern(), heard),
            planner.watch_tokens(ROBOT_ALIVE, 0.1) as watch,
        ):
            await watch.synced()
            await until(lambda: not watch.alive, "the token to count as lost")


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


async def test_a_token_that_nobody_was_told_of_is_found(session_config, monkeypatch):
    monkeypatch.setattr("keyexpr_schema.transport.liveliness.LOOK_S", 0.2)
    a = AliveAddress("r1", "a")
    async with open_session(session_config()) as planner, open_session(session_config()) as one:
        watched = planner.link.tokens_watched
        monkeypatch.setattr(
            planner.link, "tokens_watched", lambda pattern, _: watched(pattern, lambda _: None)
        )
        async with planner.watch_tokens(ROBOT_ALIVE, 0.3) as watch:
            await watch.synced()
            async with one.token(ROBOT_ALIVE, a):
                assert [(c.address, c.alive) for c in await take(watch, 1)] == [(a, True)]
            assert [(c.address, c.alive) for c in await take(watch, 1)] == [(a, False)]


async def test_a_token_that_some_answers_lack_is_not_lost(session_config, monkeypatch):
    monkeypatch.setattr("keyexpr_schema.transport.liveliness.LOOK_S", 0.05)
    a, b = AliveAddress("r1", "a"), AliveAddress("r2", "b")
    looks, shown = 0, [a]

    async def lacking(pattern: str, timeout_s: float) -> Replies:
        nonlocal looks
        looks += 1
        present = () if looks % LOOKS else shown
        return Replies([Sample(ROBOT_ALIVE.build(each), b"", "", 0, False) for each in present])

    async with (
        open_session(session_config()) as planner,
        open_session(session_config()) as one,
        AsyncExitStack() as working,
    ):
        await working.enter_async_context(one.token(ROBOT_ALIVE, a))
        await there(planner, a)
        monkeypatch.setattr(planner.link, "tokens", lacking)
        async with planner.watch_tokens(ROBOT_ALIVE, 0.05) as watch:
            assert [(c.address, c.alive) for c in await take(watch, 1)] == [(a, True)]
            await until(lambda: looks > 5 * LOOKS, "many looks")
            # Of what came before this nothing was told.
            shown.append(b)
            await working.enter_async_context(one.token(ROBOT_ALIVE, b))
            assert [(c.address, c.alive) for c in await take(watch, 1)] == [(b, True)]
            shown.clear()
            await working.aclose()
            gone = {(c.address, c.alive) for c in await take(watch, 2)}
            assert gone == {(a, False), (b, False)}
