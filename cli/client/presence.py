"""Who is there right now, by liveliness tokens."""

from __future__ import annotations

import asyncio
from contextlib import AbstractAsyncContextManager
from typing import TYPE_CHECKING

from keyexpr_schema.errors import Unreachable
from keyexpr_schema.key import A
from keyexpr_schema.keyspace import PLANNER_ALIVE, RECORDER_ALIVE, ROBOT_ALIVE, SIM_ALIVE

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session, TokenWatch

SYNC_S = 3.0
"""Longest time for the router to list the tokens it knows."""
SECOND_LOOK_S = 0.5
"""A link that is new may show no token at first although there are some."""


async def planner_alive(session: Session) -> bool:
    """Whether a planner is connected."""
    return bool(await planners_alive(session))


async def planners_alive(session: Session) -> set[str]:
    """The runs (incarnations) of planners that are connected."""
    return {address.incarnation for address in await _present(session.watch_tokens(PLANNER_ALIVE))}


async def robots_alive(session: Session) -> set[str]:
    """The robots whose workers are connected."""
    return {address.robot for address in await _present(session.watch_tokens(ROBOT_ALIVE))}


async def robot_alive(session: Session, robot: str) -> bool:
    """Whether a robot's worker is connected."""
    return bool(await _present(session.watch_tokens(ROBOT_ALIVE, robot=robot)))


async def recorders_alive(session: Session) -> set[str]:
    """The runs of recorders that are connected."""
    return {address.incarnation for address in await _present(session.watch_tokens(RECORDER_ALIVE))}


async def sims_alive(session: Session) -> set[str]:
    """The runs of simulated worlds that are connected."""
    return {address.incarnation for address in await _present(session.watch_tokens(SIM_ALIVE))}


async def _present(tokens: AbstractAsyncContextManager[TokenWatch[A]]) -> set[A]:
    seen: set[A] = set()
    anyone = asyncio.Event()
    async with tokens as watch:

        async def collect() -> None:
            async for change in watch:
                (seen.add if change.alive else seen.discard)(change.address)
                anyone.set()

        collecting = asyncio.create_task(collect())
        try:
            async with asyncio.timeout(SYNC_S):
                await watch.synced()
        except TimeoutError:
            raise Unreachable(
                f"the router did not say within {SYNC_S:g} s who is connected"
            ) from None
        else:
            try:
                async with asyncio.timeout(SECOND_LOOK_S):
                    await anyone.wait()
            except TimeoutError:
                pass
        finally:
            collecting.cancel()
            await asyncio.wait([collecting])
    return seen
