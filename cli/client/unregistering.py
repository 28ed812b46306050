"""Takes robots out of the fleet for good: their work is cancelled and given to others first."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterable
from typing import TYPE_CHECKING

import msgspec
from msgspec.structs import replace

from cli.client.holds import put_holds
from cli.client.presence import planner_alive, robots_alive
from cli.client.publish import fleet_time_s
from cli.errors import Refused
from keyexpr_schema.facts import AT, HOLDING, NOTHING
from keyexpr_schema.keyspace import FACT, HOLD, ORDER, ROBOT_SPEC, ROBOT_STATE
from keyexpr_schema.payloads.holds import HoldKind
from keyexpr_schema.payloads.robots import RobotActivity, RobotAddress
from keyexpr_schema.payloads.world import PERSON_SOURCE

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

LOOK_S = 0.2
"""Between two looks at whether it rests [s, wall]."""
_AT_REST = frozenset({RobotActivity.IDLE, RobotActivity.STOPPED})


class Forgotten(msgspec.Struct, frozen=True, kw_only=True):
    """A robot that is no more: what it had with it, and why it may still be moving."""

    unregistered: str
    carried: tuple[str, ...] = ()
    unconfirmed: str | None = None


async def unregister(
    session: Session, robot: str, by: str, why: str, wait_s: float, force: bool
) -> Forgotten:
    """Have a robot's work cancelled and done by others, wait up to `wait_s` [s] until it rests, and
    forget it: with `force` also if it carries something, or has not said that it rests.

    Raises:
        Refused: it carries something, or has not said so; then it stays, drained.
    """
    _check_empty(robot, await _carried(session, robot), force, "")
    reason = f"it is being unregistered{f': {why}' if why else ''}"
    await put_holds(session, HoldKind.DRAIN, [robot], [], by, reason, interrupt=True)
    stays = f"; it stays drained, and `robotctl return {robot}` puts it back"
    unconfirmed = await _until_at_rest(session, robot, wait_s)
    if unconfirmed is not None and not force:
        raise Refused(
            f"NOT CONFIRMED: {robot}: {unconfirmed}{stays}; --force forgets it all the same"
        )
    carried = await _carried(session, robot)
    _check_empty(robot, carried, force, stays)
    await _forget(session, robot, by)
    return Forgotten(unregistered=robot, carried=carried, unconfirmed=unconfirmed)


def _check_empty(robot: str, carried: Iterable[str], force: bool, stays: str) -> None:
    if (things := " and ".join(carried)) and not force:
        how = f"`robotctl drain {robot}` has it deliver that first"
        raise Refused(
            f"{robot} has {things} with it{stays or f'; {how}'}, or say --force, and nobody knows "
            f"where {things} is from then on"
        )


async def _carried(session: Session, robot: str) -> tuple[str, ...]:
    """What a robot has in its hand and basket, by the facts and by its own word."""
    found: dict[str, None] = {}
    for fact in (await session.list(FACT)).values():
        if (fact.relation, fact.value) == (AT, robot):
            found[fact.subject] = None
        if fact.key == (HOLDING, robot) and fact.value not in (None, NOTHING):
            found[str(fact.value)] = None
    state = await session.get(ROBOT_STATE, RobotAddress(robot))
    if state is not None:
        held = [state.holding] if state.holding not in (None, NOTHING) else []
        found.update(dict.fromkeys([*held, *state.basket]))
    return tuple(found)


async def _until_at_rest(session: Session, robot: str, wait_s: float) -> str | None:
    """Wait until a robot has no order and says that it rests; what it has not said by then."""
    connected = robot in await robots_alive(session)
    deadline_s = time.monotonic() + wait_s
    while True:
        orders = list((await session.list(ORDER, robot=robot)).values())
        state = await session.get(ROBOT_STATE, RobotAddress(robot))
        rests = state is None or state.activity in _AT_REST or state.stops
        if not orders and (not connected or rests):
            return None
        if time.monotonic() >= deadline_s:
            break
        await asyncio.sleep(LOOK_S)
    named = " and ".join(sorted(f"{order.plan}/{order.task}" for order in orders))
    if not named:
        return "its worker has not said that it rests"
    if not await planner_alive(session):
        return f"no planner is running that would cancel {named}"
    if not connected:
        return f"its worker is not connected, and may still carry out {named}"
    return f"its worker has not said that it leaves off {named}"


async def _forget(session: Session, robot: str, by: str) -> None:
    """Delete what is stored of a robot, and say that nobody knows where what it has is. A planner
    deletes its orders when it hears that the robot is no more."""
    now_s = await fleet_time_s(session)
    await session.delete(ROBOT_SPEC, RobotAddress(robot))
    for address, fact in (await session.list(FACT)).items():
        if fact.subject == robot:
            await session.delete(FACT, address)
        elif (fact.relation, fact.value) == (AT, robot):
            lost = replace(fact, value=None, source=PERSON_SOURCE, time_s=now_s, by=by)
            await session.confirm(FACT, address, lost)
    await session.delete(ROBOT_STATE, RobotAddress(robot))
    for of, hold in (await session.list(HOLD)).items():
        if hold.robots == (robot,):
            await session.delete(HOLD, of)
        elif robot in hold.robots:
            rest = tuple(other for other in hold.robots if other != robot)
            await session.confirm(HOLD, of, replace(hold, robots=rest, by=by))
