"""What a planner that starts finds on the keys, and what of it is out of date."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Collection, Iterator
from typing import Any

from fleet.core.effects import Publish, Retract, effects_of
from fleet.core.events import At, PriorStateLoaded
from fleet.core.standing import is_put
from fleet.core.state import State
from fleet.service.event_translation import WATCHED
from keyexpr_schema.facts import FactKey
from keyexpr_schema.ids import is_name
from keyexpr_schema.key import Address, Key
from keyexpr_schema.keyspace import (
    CLOSURE,
    DURATIONS,
    FACT,
    GOAL_SPEC,
    GOAL_STATUS,
    HOLD,
    OBJECT,
    ORDER,
    PLACE,
    PLAN_SPEC,
    PLAN_STATUS,
    ROBOT_SPEC,
    SCHEDULE_SPEC,
    SCHEDULE_STATUS,
    STATEMENT,
    STATEMENT_STATUS,
    STOP,
    STOP_RELEASE,
    TASK_RECORD,
)
from keyexpr_schema.payloads.closures import ClosureAddress
from keyexpr_schema.payloads.goals import GoalAddress, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import HoldAddress
from keyexpr_schema.payloads.robots import RobotAddress
from keyexpr_schema.payloads.schedules import ScheduleAddress
from keyexpr_schema.payloads.stops import StopAddress, StopReleaseAddress
from keyexpr_schema.payloads.world import (
    FactAddress,
    ObjectAddress,
    PlaceAddress,
    StatementAddress,
)
from keyexpr_schema.transport.session import Change, Session, TokenWatch, Watch

OWN: tuple[Key[Any, Any], ...] = (TASK_RECORD, PLAN_SPEC, PLAN_STATUS, GOAL_STATUS, SCHEDULE_STATUS)
"""What the planner writes, but for its orders."""


def open_plans(state: State) -> list[str]:
    """The plans whose reports still matter."""
    return [plan for plan, entry in state.plans.items() if not entry.ended or entry.outstanding()]


def known_keys(
    state: State, unconfirmed: Collection[FactKey]
) -> Iterator[tuple[Key[Any, Any], Address]]:
    """The keys that a state has its names and facts from: one that is gone was deleted.

    Facts that the planner concluded, and perhaps never published, were perhaps never on their key.
    What an earlier version let be called like a value (`101`) has no key any more, and stays.
    """
    put = (goal for goal in state.goals if is_put(state, goal))
    yield from ((GOAL_SPEC, GoalAddress(goal)) for goal in put)
    yield from ((SCHEDULE_SPEC, ScheduleAddress(name)) for name in state.schedules)
    statements = {**state.statements, **state.statement_states}
    yield from ((STATEMENT, StatementAddress(name)) for name in statements)
    yield from ((PLACE, PlaceAddress(place)) for place in filter(is_name, state.places))
    yield from ((OBJECT, ObjectAddress(thing)) for thing in filter(is_name, state.objects))
    yield from ((ROBOT_SPEC, RobotAddress(robot)) for robot in filter(is_name, state.robots))
    yield from ((HOLD, HoldAddress(hold)) for hold in state.holds)
    yield from ((CLOSURE, ClosureAddress(closure)) for closure in state.closures)
    yield from ((STOP, StopAddress(stop)) for stop in state.stops)
    for stop, robots in state.released.items():
        yield from ((STOP_RELEASE, StopReleaseAddress(stop, robot)) for robot in robots)
    yield from ((FACT, FactAddress.of(key)) for key in state.facts if key not in unconfirmed)


def in_order(changes: list[Change[Any, Any]]) -> list[Change[Any, Any]]:
    """What is stored, in the order that costs least: names before the sentences that use them."""
    rank = {key.name: number for number, key in enumerate(WATCHED)}
    return sorted(changes, key=lambda change: rank.get(change.key.name, -1))


async def prior_state(session: Session, at: At) -> PriorStateLoaded:
    """Without a journal: names that an earlier planner gave are not given again, what it ordered is
    cancelled, and what it learned is not forgotten."""
    plans = await session.list(PLAN_STATUS)
    orders = await session.list(ORDER)
    durations = await session.list(DURATIONS)
    goals = (await session.list(GOAL_STATUS)).values()
    statements = await session.list(STATEMENT_STATUS)
    return PriorStateLoaded(
        plans=tuple(address.plan for address in plans),
        orders=tuple(orders.values()),
        statements=tuple(statements.values()),
        durations=tuple(durations.values()),
        goals=tuple(goal for goal in goals if _has_done_something(goal)),
        **at,
    )


def _has_done_something(goal: GoalStatus) -> bool:
    """Whether a goal that stands has made others, or let times pass."""
    return goal.state is GoalState.STANDING and bool(goal.runs or goal.next_s is not None)


async def stale_documents(
    session: Session, state: State, is_over: Callable[[Address], bool], *, all_of_them: bool
) -> list[Retract]:
    """Documents of the planner in the store that the state does not have, and of nothing that is
    over: that keeps its keys for a while.

    Orders, whatever happened: nobody would ever follow them up, and there are no more of them than
    there is work under way. All others only where the journal is lost: with a journal there are
    none, it remembers what is to be deleted until that is confirmed.
    """
    wanted = {
        effect.key.build(effect.address)
        for effect in effects_of(state)
        if isinstance(effect, Publish)
    }
    return [
        Retract(key, address)
        for key in (ORDER, *(OWN if all_of_them else ()))
        for address in await session.list(key)
        if key.build(address) not in wanted and (key is ORDER or not is_over(address))
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


def outdated(state: State, change: Any, concluded: Collection[FactKey]) -> bool:
    """Whether a stored fact is older than what the planner `concluded` of it, and may not have
    published; where the store says when it received it, the core knows that itself."""
    own = state.concluded.get(change.address.key)
    return (
        not change.received
        and change.address.key in concluded
        and own is not None
        and change.value is not None
        and change.value.time_s < own.time_s
    )
