"""What is to be confirmed does not wait until what was put before it is."""

from __future__ import annotations

import asyncio

from keyexpr_schema.keyspace import GOAL_SPEC, STORE_STAMPS
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.system import StoreAddress
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.session import Session, open_session
from keyexpr_schema.transport.store.writes import TOGETHER
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import goal


async def test_what_comes_while_a_question_is_under_way_is_put_at_once(session_config, monkeypatch):
    """It is seen before that is answered, and the next question confirms it. A session has no more
    under way than the store lets anybody have at once."""
    asked, put = [], []
    answered = asyncio.Event()
    query, send = Link.query, Link._send

    async def held(self, keyexpr, *args, **kwargs):
        replies = await query(self, keyexpr, *args, **kwargs)
        if keyexpr == STORE_STAMPS.build(StoreAddress()):
            asked.append(keyexpr)
            await answered.wait()
        return replies

    def counted(self, each):
        put.append(each.keyexpr)
        send(self, each)

    names = [f"g{number}" for number in range(2 * TOGETHER)]
    async with (
        open_session(session_config()) as session,
        open_session(session_config()) as other,
        other.watch(GOAL_SPEC) as watch,
    ):
        await watch.synced()
        monkeypatch.setattr(Link, "query", held)
        monkeypatch.setattr(Link, "_send", counted)

        def confirmed(name: str) -> asyncio.Task[None]:
            return asyncio.create_task(
                session.confirm(GOAL_SPEC, GoalAddress(name), goal(name), DEADLINE_S)
            )

        first = confirmed("first")
        assert (await anext(watch)).address.goal == "first"
        others = [confirmed(name) for name in names]
        seen = [(await anext(watch)).address.goal for _ in range(TOGETHER - 1)]
        assert seen == names[: TOGETHER - 1]
        assert not first.done()
        await session.link.call(lambda: None)
        assert len(put) == TOGETHER
        answered.set()
        await asyncio.gather(first, *others)
        assert put == ["goals/first/spec", *(f"goals/{name}/spec" for name in names)]
        assert len(asked) == 3
        monkeypatch.undo()


async def test_what_was_put_ahead_and_lost_is_put_again(session_config, monkeypatch):
    answered, lost = asyncio.Event(), []
    query, send = Link.query, Link._send

    async def held(self, *args, **kwargs):
        replies = await query(self, *args, **kwargs)
        await answered.wait()
        return replies

    def losing(self, each):
        if each.keyexpr.startswith("goals/lost") and each.keyexpr not in lost:
            lost.append(each.keyexpr)
            answered_soon()
            return
        send(self, each)

    async with open_session(session_config()) as session:
        loop = asyncio.get_running_loop()
        answered_soon = lambda: loop.call_soon_threadsafe(answered.set)  # noqa: E731
        monkeypatch.setattr(Link, "query", held)
        monkeypatch.setattr(Link, "_send", losing)
        first = session.confirm(GOAL_SPEC, GoalAddress("first"), goal("first"), DEADLINE_S)
        await asyncio.gather(first, _later(session, "lost"))
        monkeypatch.undo()
        assert lost == ["goals/lost/spec"]
        assert {each.goal for each in await session.list(GOAL_SPEC)} == {"first", "lost"}


async def _later(session: Session, name: str) -> None:
    """Confirm a write that comes while another is asked for."""
    await until(lambda: session._store._writes._under_way)
    await session.confirm(GOAL_SPEC, GoalAddress(name), goal(name), DEADLINE_S)
