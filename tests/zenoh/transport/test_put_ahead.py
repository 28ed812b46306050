"""What is to be confirmed does not wait until what was put before it is."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence

import pytest

from keyexpr_schema.keyspace import GOAL_SPEC, STORE_STAMPS
from keyexpr_schema.payloads.goals import GoalAddress
from keyexpr_schema.payloads.system import StoreAddress
from keyexpr_schema.transport.link import Link, Put, Replies
from keyexpr_schema.transport.session import Session, open_session
from keyexpr_schema.transport.store.writes import TOGETHER
from tests.support.polling import DEADLINE_S, until
from tests.support.session_values import goal


class Watched:
    """What goes down the links of this process: `put` with a question or `ahead` of the next, and
    how often it was `asked` what came of it, answered once that is allowed."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.put: list[str] = []
        self.ahead: list[str] = []
        self.asked = 0
        self.loses = ""
        self.answered = asyncio.Event()
        query, together = Link.query, Link.send_together

        async def held(link: Link, keyexpr: str, *args: object, **kwargs: object) -> Replies:
            stamps = keyexpr == STORE_STAMPS.build(StoreAddress())
            if stamps:
                self.asked += 1
                self.put += [each.keyexpr for each in kwargs["after"]]  # type: ignore[attr-defined]
            replies = await query(link, keyexpr, *args, **kwargs)  # type: ignore[arg-type]
            if stamps:
                await self.answered.wait()
            return replies

        def seen(link: Link, puts: Sequence[Put]) -> None:
            self.put += [each.keyexpr for each in puts]
            self.ahead += [each.keyexpr for each in puts]
            together(link, [each for each in puts if each.keyexpr != self.loses])

        monkeypatch.setattr(Link, "query", held)
        monkeypatch.setattr(Link, "send_together", seen)


def confirmed(session: Session, name: str) -> asyncio.Task[None]:
    return asyncio.create_task(
        session.confirm(GOAL_SPEC, GoalAddress(name), goal(name), DEADLINE_S)
    )


def keyexprs(*names: str) -> list[str]:
    return [GOAL_SPEC.build(GoalAddress(name)) for name in names]


async def test_what_comes_while_a_question_is_under_way_is_put_at_once(session_config, monkeypatch):
    """It is seen before that is answered, and the next question confirms it. A session has no more
    under way than the store lets anybody have at once."""
    names = [f"g{number}" for number in range(2 * TOGETHER)]
    async with (
        open_session(session_config()) as session,
        open_session(session_config()) as other,
        other.watch(GOAL_SPEC) as watch,
    ):
        await watch.synced()
        link = Watched(monkeypatch)
        first = confirmed(session, "first")
        assert (await anext(watch)).address.goal == "first"
        others = [confirmed(session, name) for name in names]
        seen = [(await anext(watch)).address.goal for _ in range(TOGETHER - 1)]
        assert seen == names[: TOGETHER - 1]
        assert not first.done()
        assert link.ahead == keyexprs(*seen)
        link.answered.set()
        await asyncio.gather(first, *others)
        assert link.put == keyexprs("first", *names)
        assert link.asked == 3
        monkeypatch.undo()


async def test_what_was_put_ahead_and_lost_is_put_again(session_config, monkeypatch):
    async with open_session(session_config()) as session:
        link = Watched(monkeypatch)
        (link.loses,) = keyexprs("lost")
        first = confirmed(session, "first")
        await until(lambda: link.asked)
        lost = confirmed(session, "lost")
        await until(lambda: link.ahead == [link.loses])
        link.answered.set()
        await asyncio.gather(first, lost)
        monkeypatch.undo()
        assert link.put == [*keyexprs("first"), link.loses, link.loses]
        found = await session.list(GOAL_SPEC)
        assert {each.goal for each in found} == {"first", "lost"}
