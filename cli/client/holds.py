"""Pauses and drains: put, ended, and what they hold in words."""

from __future__ import annotations

import secrets
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from msgspec.structs import replace

from cli.errors import Unknown, check_known
from keyexpr_schema.keyspace import HOLD, PLAN_STATUS, ROBOT_SPEC
from keyexpr_schema.payloads.holds import Hold, HoldAddress, HoldKind
from keyexpr_schema.payloads.plans import ENDED_PLANS

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session


@dataclass(frozen=True)
class PutHolds:
    """The pauses or drains that were asked for; `stood`: the names of those that stood already."""

    holds: list[Hold]
    stood: frozenset[str]

    def __str__(self) -> str:
        return "\n".join(
            in_words(hold) + (", as it was already" if hold.hold in self.stood else "")
            for hold in self.holds
        )


async def check_names(session: Session, robots: Sequence[str], plans: Sequence[str]) -> None:
    """Do nothing if these robots are registered, and these plans have not ended.

    Raises:
        Unknown: one is not; the message lists those there are.
    """
    if robots:
        registered = [address.robot for address in await session.list(ROBOT_SPEC)]
        for robot in robots:
            check_known("robot", robot, registered)
    if plans:
        statuses = (await session.list(PLAN_STATUS)).items()
        going_on = [a.plan for a, status in statuses if status.state not in ENDED_PLANS]
        await check_no_robots(session, [plan for plan in plans if plan not in going_on])
        for plan in plans:
            check_known("ongoing plan", plan, going_on)


async def check_no_robots(session: Session, plans: Sequence[str]) -> None:
    """Raise `Unknown` where a robot is named, and a plan is meant."""
    registered = [address.robot for address in await session.list(ROBOT_SPEC)] if plans else ()
    for name in plans:
        if name in registered:
            raise Unknown(f"{name} is a robot, and plans are named so: say --robot {name}")


async def put_holds(
    session: Session,
    kind: HoldKind,
    robots: Sequence[str],
    plans: Sequence[str],
    by: str,
    reason: str,
    *,
    schedules: Sequence[str] = (),
    interrupt: bool = False,
) -> PutHolds:
    """Store pauses or drains, confirmed: one for each name, so that each ends by itself; of a
    pause without names, one of the whole fleet. None that would say what one that stands says."""
    each = (("robots", robots), ("plans", plans), ("schedules", schedules))
    named = [{what: (name,)} for what, names in each for name in dict.fromkeys(names)]
    holds = [
        Hold(
            hold=f"{kind.value}-{secrets.token_hex(4)}",
            kind=kind,
            interrupt=interrupt,
            by=by,
            reason=reason,
            wall_time_s=time.time(),
            **what,
        )
        for what in named or [{}]
    ]
    await _forget_of_ended_plans(session)
    standing = {_said(hold): hold for hold in (await session.list(HOLD)).values()}
    stood = frozenset(standing[_said(hold)].hold for hold in holds if _said(hold) in standing)
    holds = [standing.get(_said(hold), hold) for hold in holds]
    for hold in holds:
        if hold.hold not in stood:
            await session.confirm_new(HOLD, HoldAddress(hold.hold), hold)
    return PutHolds(holds, stood)


def _said(hold: Hold) -> Hold:
    """What it says, whatever its name is and whenever it was given."""
    return replace(hold, hold="", wall_time_s=0.0)


async def _forget_of_ended_plans(session: Session) -> None:
    """Delete the pauses of plans that are over: nobody would ever end them."""
    stored = (await session.list(HOLD)).items()
    if held := {address: hold for address, hold in stored if hold.plans}:
        status = (await session.list(PLAN_STATUS)).values()
        going_on = {each.plan for each in status if each.state not in ENDED_PLANS}
        for address, hold in held.items():
            if going_on.isdisjoint(hold.plans):
                await session.delete(HOLD, address)


async def still_paused(session: Session, names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """By each of these robots and plans, the pauses of the whole fleet, in words."""
    found = [in_words(hold) for hold in (await session.list(HOLD)).values() if hold.of_all]
    return dict.fromkeys(names, tuple(found)) if found else {}


async def end_holds(
    session: Session,
    kind: HoldKind,
    robots: Sequence[str] = (),
    plans: Sequence[str] = (),
    schedules: Sequence[str] = (),
) -> list[Hold]:
    """End those of just these names; with none named, those of the whole fleet."""
    named = {*robots}, {*plans}, {*schedules}
    ended = []
    for address, hold in (await session.list(HOLD)).items():
        held = zip(named, (hold.robots, hold.plans, hold.schedules), strict=True)
        meant = any(n & {*h} for n, h in held) if any(named) else hold.of_all
        if hold.kind is kind and meant:
            await session.delete(HOLD, address)
            ended.append(hold)
    return ended


def in_words(hold: Hold) -> str:
    """`hsr: paused by ana (cleaning)`."""
    return f"{', '.join((*hold.robots, *hold.plans, *hold.schedules)) or 'the whole fleet'}: {hold}"


def how_to_end(hold: Hold) -> str:
    """The command that ends it."""
    if hold.schedules:
        return f"robotctl schedule resume {' '.join(hold.schedules)}"
    if hold.kind is HoldKind.DRAIN:
        return f"robotctl return {' '.join(hold.robots)}"
    named = [*(f"--robot {robot}" for robot in hold.robots), *hold.plans]
    return f"robotctl resume {' '.join(named) or '--all'}"
