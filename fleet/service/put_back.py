"""What people and robots have put, and a store has lost: the planner knows it, and puts it back.

A store that was set back (its log was lost, a backup was put in its place, it was emptied) lacks
what was confirmed, and has not even a deletion of it. What somebody has deleted has one.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from fleet.core.effects import Publish
from fleet.core.standing import is_put
from fleet.core.state import State
from keyexpr_schema.key import Address, Key, Payload
from keyexpr_schema.keyspace import (
    CLOSURE,
    FACT,
    GOAL_SPEC,
    HOLD,
    OBJECT,
    PLACE,
    ROBOT_SPEC,
    SCHEDULE_SPEC,
    STATEMENT,
    STOP,
    STOP_RELEASE,
)
from keyexpr_schema.payloads.goals import Goal, GoalAddress
from keyexpr_schema.payloads.stops import StopRelease, StopReleaseAddress


@dataclass(frozen=True)
class PutBack(Publish):
    """Publishes what is known since `known_since_s` [Unix]: what was said since goes before it."""

    known_since_s: float


REMEMBERED_S = 6 * 86_400.0
"""A store remembers deletions a day longer: what it lacks after a longer absence may be deleted."""
NAMED = 5

log = logging.getLogger(__name__)


Lost = Sequence[tuple[Key[Any, Any], Address]]


def putting_back(
    state: Callable[[], State], carry_out: Callable[[Sequence[Publish]], None]
) -> Callable[[Lost], None] | None:
    """Has what a store has lost written again; `None`: the planner was away for so long that the
    store may have forgotten what was deleted meanwhile."""
    if time.time() - state().wall_time_s > REMEMBERED_S:
        return None

    def put_back(lost: Lost) -> None:
        carry_out(to_put_back(state(), lost))

    return put_back


def to_put_back(state: State, lost: Lost) -> list[Publish]:
    """What is to be written at keys of which a store knows nothing any more; says so."""
    found: list[Publish] = [
        PutBack(key, address, value, known_since_s=_since_s(state, key, address))
        for key, address in lost
        if (value := known_at(state, key, address)) is not None
    ]
    if found:
        names = [each.key.build(each.address) for each in found]
        more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
        log.warning(
            "the store has lost %d values that were confirmed (%s%s): they are written again",
            len(found),
            ", ".join(names[:NAMED]),
            more,
        )
    return found


def _since_s(state: State, key: Key[Any, Any], address: Any) -> float:
    """When the store received it first: its receipts begin with the time of day. Somebody may have
    said something else of a fact since the store was set back."""
    received = state.received.get(address.key, 0) if key is FACT else 0
    return received / 1e6 if received else time.time()


def _goal(state: State, address: GoalAddress) -> Goal | None:
    name = address.goal
    goal = state.goal_specs.get(name) or state.goals.get(name)
    return goal if goal is not None and is_put(state, name) else None


def _release(state: State, address: StopReleaseAddress) -> StopRelease | None:
    there = address.robot in state.released.get(address.stop, ())
    return StopRelease(stop=address.stop, robot=address.robot) if there else None


KNOWN: dict[Key[Any, Any], Callable[[State, Any], Payload | None]] = {
    FACT: lambda state, at: state.facts.get(at.key),
    GOAL_SPEC: _goal,
    SCHEDULE_SPEC: lambda state, at: state.schedules.get(at.schedule),
    STATEMENT: lambda state, at: state.statements.get(at.statement),
    PLACE: lambda state, at: state.places.get(at.place),
    OBJECT: lambda state, at: state.objects.get(at.object),
    ROBOT_SPEC: lambda state, at: state.robots.get(at.robot),
    HOLD: lambda state, at: state.holds.get(at.hold),
    CLOSURE: lambda state, at: state.closures.get(at.closure),
    STOP: lambda state, at: state.stops.get(at.stop),
    STOP_RELEASE: _release,
}
"""What the planner knows to have been put at a key that it only reads; nothing of what is asked
once, or told of what is under way. The table of keys lets it put just these (`Key.put_back`)."""


def known_at(state: State, key: Key[Any, Any], address: Any) -> Payload | None:
    """What is to be put there again, if anything is."""
    known = KNOWN.get(key)
    return None if known is None else known(state, address)
