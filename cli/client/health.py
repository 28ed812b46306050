"""How the fleet itself is, apart from what it does: who is there, and what is wrong with whom."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, replace
from time import time
from typing import TYPE_CHECKING

from cli.client.planner_requests import planner_status
from cli.client.presence import planner_alive, robots_alive
from keyexpr_schema.errors import ForeignKey, SchemaError, UndecodablePayload
from keyexpr_schema.key_lookup import key_of
from keyexpr_schema.keyspace import (
    DIAGNOSTIC,
    PLANNER_ALIVE,
    ROBOT_ALIVE,
    UNDECODABLE,
)
from keyexpr_schema.payloads.system import Diagnostic, UndecodableValue

if TYPE_CHECKING:
    from keyexpr_schema.payloads.robots import AliveAddress
    from keyexpr_schema.payloads.system import PlannerStatus
    from keyexpr_schema.transport.session import Session, TokenChange

ASK_S = 3.0
LOOK_AGAIN_S = 3.0


@dataclass(frozen=True)
class Health:
    """Who is connected, and what is wrong.

    `connected` are the robots whose worker is there; `planner` is what the latest one said of
    itself, whether or not it is there (`planning`).
    """

    connected: frozenset[str] = frozenset()
    planning: bool = False
    planner: PlannerStatus | None = None
    diagnostics: tuple[Diagnostic, ...] = ()
    undecodable: tuple[UndecodableValue, ...] = ()


async def health(session: Session) -> Health:
    """How the fleet is now."""
    # Where nobody is, each waits for a moment.
    planning, connected = await asyncio.gather(planner_alive(session), robots_alive(session))
    return await _looked(session, Health(frozenset(connected), planning))


async def diagnostics(session: Session) -> tuple[Diagnostic, ...]:
    """What components say is wrong with them now, and the router's store when it is asked."""
    found = (await session.list(DIAGNOSTIC)).values()
    store = await session.store_troubles()
    said = {"store": store.failing, "limits": store.refusing, "rates": store.slowing}
    return (
        *found,
        *(
            Diagnostic(component="router", check=check, sentence=sentence, since_s=time())
            for check, sentence in said.items()
            if sentence is not None
        ),
    )


class Followed:
    """The health of a fleet, kept up to date; `now` is that of the last look."""

    def __init__(self, found: Health) -> None:
        self.now = found


@asynccontextmanager
async def health_followed(
    session: Session,
    on_robot: Callable[[TokenChange[AliveAddress]], None] = lambda change: None,
) -> AsyncIterator[Followed]:
    """The health of the fleet, kept up to date in the background.

    `on_robot` hears of workers that come and go, beginning with those that are there. While there
    is no router what was known last stays.
    """
    followed = Followed(await health(session))
    async with AsyncExitStack() as stack:
        robots = await stack.enter_async_context(session.watch_tokens(ROBOT_ALIVE))
        planners = await stack.enter_async_context(session.watch_tokens(PLANNER_ALIVE))

        async def see_robots() -> None:
            async for change in robots:
                on_robot(change)
                connected = frozenset(address.robot for address in robots.alive)
                followed.now = replace(followed.now, connected=connected)

        async def see_planners() -> None:
            async for _ in planners:
                followed.now = replace(followed.now, planning=bool(planners.alive))

        async def look() -> None:
            while True:
                await asyncio.sleep(LOOK_AGAIN_S)
                with suppress(SchemaError):
                    found = await _looked(session, followed.now)
                    now = followed.now
                    followed.now = replace(found, connected=now.connected, planning=now.planning)

        tasks = [asyncio.create_task(each) for each in (see_robots(), see_planners(), look())]
        try:
            yield followed
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.wait(tasks)


async def _looked(session: Session, found: Health) -> Health:
    values = (await session.list(UNDECODABLE)).values()
    return replace(
        found,
        planner=await planner_status(session),
        diagnostics=await diagnostics(session),
        undecodable=tuple(await _still_undecodable(session, values)),
    )


async def _still_undecodable(
    session: Session, values: Iterable[UndecodableValue]
) -> list[UndecodableValue]:
    """Those whose key still has a value that does not decode, or the one that was of no use.

    The report stays on its key when the bad value is replaced or deleted. What is not stored, and
    what was put on a key that nobody can have, cannot be looked at again and stays listed.
    """
    from keyexpr_schema.transport.undecodable import digest_of

    left = []
    for value in values:
        try:
            key = key_of(value.keyexpr)
            if key.stored:
                now = await session.get(key, key.parse(value.keyexpr), ASK_S)
                if now is None or value.digest != digest_of(key.encode(now)):
                    continue
        except (ForeignKey, UndecodablePayload):
            pass
        left.append(value)
    return left
