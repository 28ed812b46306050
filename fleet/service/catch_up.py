"""What a planner that starts finds on the keys, and what of it is out of date."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Any

from fleet.core.effects import Publish, Retract, effects_of
from fleet.core.events import At, PriorStateLoaded
from fleet.core.state import State
from keyexpr_schema.key import Key
from keyexpr_schema.keyspace import (
    ANSWER,
    DURATIONS,
    GOAL_STATUS,
    ORDER,
    PLAN_SPEC,
    PLAN_STATUS,
    STATEMENT_STATUS,
    TASK_RECORD,
)
from keyexpr_schema.transport.session import Session, TokenWatch, Watch

OWN: tuple[Key[Any, Any], ...] = (ORDER, TASK_RECORD, PLAN_SPEC, PLAN_STATUS, GOAL_STATUS)


async def prior_state(session: Session, at: At) -> PriorStateLoaded:
    """Without a journal: what an earlier planner answered and ended is not done again, and what it
    learned is not forgotten."""
    answers = await session.list(ANSWER)
    goals = await session.list(GOAL_STATUS)
    plans = await session.list(PLAN_STATUS)
    durations = await session.list(DURATIONS)
    statements = await session.list(STATEMENT_STATUS)
    return PriorStateLoaded(
        answers=tuple(answers.values()),
        goals=tuple(goals.values()),
        plans=tuple(address.plan for address in plans),
        statements=tuple(statements.values()),
        durations=tuple(durations.values()),
        **at,
    )


async def stale_documents(session: Session, state: State) -> list[Retract]:
    """Documents of the planner in the store that the state does not have.

    A planner that was killed between its journal and a deletion leaves such; one that lost its
    journal leaves its orders, which nobody would ever follow up.
    """
    wanted = {
        effect.key.build(effect.address)
        for effect in effects_of(state)
        if isinstance(effect, Publish)
    }
    return [
        Retract(key, address)
        for key in OWN
        for address in await session.list(key, timeout_s=60.0)
        if key.build(address) not in wanted
        and (key is ORDER or getattr(address, "plan", None) not in state.past_plans)
    ]


async def until_synced(watch: Watch | TokenWatch[Any]) -> AsyncIterator[Any]:
    """What a watch brings until all that is stored has come, and nothing more lies ready."""
    synced = asyncio.ensure_future(watch.synced())
    while True:
        item = asyncio.ensure_future(anext(watch))
        await asyncio.wait((item, synced), return_when=asyncio.FIRST_COMPLETED)
        if not item.done():
            # One more turn of the loop: what lay ready when the watch was in sync is still taken.
            await asyncio.sleep(0)
            if not item.done():
                item.cancel()
                await asyncio.gather(item, return_exceptions=True)
                return
        yield item.result()
