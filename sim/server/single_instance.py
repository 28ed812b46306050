"""Whether another simulated world runs in the realm already."""

from __future__ import annotations

import asyncio
from contextlib import suppress

from keyexpr_schema.keyspace import SIM_CLOCK, SIM_SCENE
from keyexpr_schema.transport.session import Session
from sim.errors import WorldRuns

CLOCK_S = 0.6
"""How long to listen for the other's clock [s, wall]; it ticks twenty times a second."""


async def ensure_single_world(session: Session) -> None:
    """Return when no other simulation is heard; where none ever was, at once.

    Two that start at the same moment in a new realm do not hear each other here.

    Raises:
        WorldRuns: one is. Both would move a robot of the same name for each call of its worker.
    """
    if not await session.list(SIM_SCENE):
        return
    async with session.watch(SIM_CLOCK) as watch:
        with suppress(TimeoutError):
            async with asyncio.timeout(CLOCK_S):
                await anext(watch)
                raise WorldRuns(
                    f"a simulated world runs in realm {session.config.realm} already: end that "
                    "one, or use another --realm"
                )
