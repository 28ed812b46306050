"""Of several runs for one robot one stays; nobody gives way to a run that is gone."""

from __future__ import annotations

from contextlib import asynccontextmanager

import pytest

from keyexpr_schema.keyspace import ROBOT_ALIVE
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.transport.link import Replies
from keyexpr_schema.transport.session import open_session
from tests.support.polling import until
from tests.support.tokens import there
from workers.errors import RobotTaken
from workers.only_run import OnlyRun

FIRST, SECOND = AliveAddress("hsr", "a"), AliveAddress("hsr", "b")


def run_of(session, own):
    return OnlyRun(session, ROBOT_ALIVE, own, RobotTaken, robot=own.robot)


async def test_the_later_of_two_that_are_there_gives_way(session_config):
    async with open_session(session_config()) as one, open_session(session_config()) as two:
        async with one.token(ROBOT_ALIVE, FIRST), two.token(ROBOT_ALIVE, SECOND):
            await there(two, FIRST)
            with pytest.raises(RobotTaken):
                await run_of(two, SECOND).settled()


async def test_nobody_gives_way_to_a_token_that_a_new_watch_is_shown_and_that_is_gone(
    session_config, monkeypatch
):
    """Zenoh shows it to a new subscriber, and to nobody who asks for tokens."""
    watches = []
    async with open_session(session_config()) as one, open_session(session_config()) as two:
        watch_tokens = two.watch_tokens

        @asynccontextmanager
        async def kept(*key, **fixed):
            async with watch_tokens(*key, **fixed) as watch:
                watches.append(watch)
                yield watch

        async def shows_nobody(pattern: str, timeout_s: float) -> Replies:
            await until(lambda: watches and FIRST in watches[0].alive, "the token to be shown")
            return Replies()

        monkeypatch.setattr(two, "watch_tokens", kept)
        monkeypatch.setattr(two.link, "tokens", shows_nobody)
        async with one.token(ROBOT_ALIVE, FIRST):
            await run_of(two, SECOND).settled()
