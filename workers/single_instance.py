"""Whether another worker of the same robot is there already.

One journal cannot be open twice, but a second worker may be started with another data folder, or
on another host. It would take every order, too, and each attempt would be made twice.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress

from keyexpr_schema.keyspace import ROBOT_ALIVE
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
    async with session.watch_tokens(ROBOT_ALIVE, robot=robot) as watch:
        await watch.synced()
        with suppress(TimeoutError):
            async with asyncio.timeout(GONE_S):
                while watch.alive:
                    await anext(watch)
        others = watch.alive
    if others:
        names = ", ".join(sorted(other.incarnation for other in others))
        raise RobotTaken(
            f"a worker of {robot} is connected already ({names}): two would both carry out each "
            "order; stop that one first"
        )
