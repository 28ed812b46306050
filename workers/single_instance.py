"""Whether another worker of the same robot is there already.

One journal cannot be open twice, but a second worker may be started with another data folder, or
on another host. It would take every order, too, and each attempt would be made twice.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress

from keyexpr_schema.keyspace import ROBOT_ALIVE
from keyexpr_schema.payloads.robots import AliveAddress
from keyexpr_schema.transport.session import Session
from workers.errors import RobotTaken

GONE_S = 4.0
"""How long the token of a worker that is dead can stay [s]: its lease of 2 s, and as much again."""


async def ensure_single_worker(session: Session, robot: str) -> None:
    """Return when no worker of `robot` is connected; one that was killed just now soon is not.

    Two workers that start at the same moment do not see each other here.

    Raises:
        RobotTaken: one still is after `GONE_S`.
    """
    others: set[AliveAddress] = set()
    async with session.watch_tokens(ROBOT_ALIVE, robot=robot) as watch:

        async def follow() -> None:
            async for change in watch:
                (others.add if change.alive else others.discard)(change.address)
                if not others:
                    return

        following = asyncio.create_task(follow())
        try:
            await watch.synced()
            await asyncio.sleep(0)  # what lies ready reaches `others`
            if others:
                with suppress(TimeoutError):
                    async with asyncio.timeout(GONE_S):
                        await asyncio.shield(following)
        finally:
            following.cancel()
            await asyncio.gather(following, return_exceptions=True)
    if others:
        names = ", ".join(sorted(other.incarnation for other in others))
        raise RobotTaken(
            f"a worker of {robot} is connected already ({names}): two would both carry out each "
            "order; stop that one first"
        )
