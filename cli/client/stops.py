"""Gives and lifts emergency stops, and watches who obeys them."""

from __future__ import annotations

import asyncio
import secrets
import time
from collections.abc import Callable, Container, Iterable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import msgspec

from cli.client.presence import robots_alive
from cli.errors import check_known
from keyexpr_schema.errors import Overtaken, Unconfirmed
from keyexpr_schema.keyspace import ROBOT_SPEC, ROBOT_STATE, STOP, STOP_RELEASE
from keyexpr_schema.payloads.stops import (
    Stop,
    StopAddress,
    StopRelease,
    StopReleaseAddress,
    holding,
)

STORE_S = 3.0
"""How long the store may take to confirm an emergency stop [s]; robots do not wait for that."""

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session


AWAY = "its worker is not connected"


class StopOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """What has become of an emergency stop; `unconfirmed`: why, by robot; `unstored`: why who is
    started later does not know of it."""

    stop: Stop
    confirmed: tuple[str, ...]
    unconfirmed: dict[str, str]
    unstored: str | None = None


def how_to_resume(stop: Stop) -> str:
    """The command that ends it."""
    return f"robotctl resume {' '.join(f'--robot {each}' for each in stop.robots) or '--all'}"


class Resumed(msgspec.Struct, frozen=True, kw_only=True):
    """The stops that were lifted, the robots that others hold no longer, by stop; `still_held`: the
    stops that hold a robot all the same, in words."""

    lifted: tuple[str, ...] = ()
    released: dict[str, tuple[str, ...]] = {}
    still_held: dict[str, tuple[str, ...]] = {}


async def give_stop(
    session: Session,
    robots: Sequence[str],
    by: str,
    reason: str,
    wait_s: float,
    on_confirmed: Callable[[str], None],
    on_away: Callable[[str], None] = lambda _: None,
) -> StopOutcome:
    """Stop `robots` (none named: all), and wait up to `wait_s` [s] for their word that they rest.

    Who is away is told before that.

    Raises:
        Unknown: one of `robots` is neither registered nor connected.
    """
    name = f"stop-{time.strftime('%Y%m%d-%H%M%S')}-{secrets.token_hex(3)}"
    stop = Stop(stop=name, robots=tuple(robots), by=by, reason=reason, wall_time_s=time.time())
    if robots:
        known = await _registered(session)
        for robot in robots:
            if robot not in known:  # nobody asks who is connected while somebody may be hurt
                check_known("robot", robot, sorted(known | await robots_alive(session)))
    async with session.watch(ROBOT_STATE) as watch:
        # Before anything else is asked: who drives a robot hears of it now, be it stored or not.
        try:
            await session.confirm(STOP, StopAddress(name), stop, STORE_S)
            unstored = None
        except (Unconfirmed, Overtaken) as error:
            unstored = str(error)
        connected = await robots_alive(session)
        waiting = set(robots) or connected | await _registered(session)
        for robot in sorted(waiting - connected):
            on_away(robot)
        confirmed: list[str] = []
        with suppress(TimeoutError):
            async with asyncio.timeout(wait_s):
                changes = aiter(watch)
                while waiting:
                    change = await anext(changes)
                    robot, state = change.address.robot, change.value
                    if robot in waiting and state is not None and name in state.stops:
                        waiting.discard(robot)
                        confirmed.append(robot)
                        on_confirmed(robot)
    why = {
        robot: "its worker has not said that it rests" if robot in connected else AWAY
        for robot in sorted(waiting)
    }
    return StopOutcome(stop=stop, confirmed=tuple(confirmed), unconfirmed=why, unstored=unstored)


async def standing_stops(session: Session) -> tuple[dict[str, Stop], set[tuple[str, str]]]:
    """The stops that stand, by name, and the pairs of stop and robot that were released."""
    stops = {address.stop: stop for address, stop in (await session.list(STOP)).items()}
    released = {(a.stop, a.robot) for a in await session.list(STOP_RELEASE)}
    return stops, released


async def lift_stops(session: Session, robots: Sequence[str], by: str) -> Resumed:
    """Lift every stop that stands now, for `robots` (none named: for all), and what robots rest by
    that is not stored. One that somebody gives meanwhile stays.

    Raises:
        Unknown: one of `robots` is not registered, and no stop names it.
    """
    stops, released = await standing_stops(session)
    stops |= await _unstored(session, stops)
    registered = await _registered(session)
    named = {robot for stop in stops.values() for robot in stop.robots}
    for robot in robots:
        check_known("robot", robot, sorted(registered | named))
    concerned = sorted(robots or registered | named)
    freed: dict[str, list[str]] = {}
    if robots:
        now_s = time.time()
        for robot in dict.fromkeys(robots):
            for stop in holding(robot, stops, released):
                freed.setdefault(stop.stop, []).append(robot)
                release = StopRelease(stop=stop.stop, robot=robot, by=by, wall_time_s=now_s)
                address = StopReleaseAddress(stop.stop, robot)
                await session.confirm(STOP_RELEASE, address, release)
                released.add((stop.stop, robot))
        over = [stop for stop in stops.values() if _holds_nobody(stop, released)]
    else:
        over = list(stops.values())
    await _delete(session, over, released)
    lifted = {stop.stop for stop in over}
    stops, released = await standing_stops(session)
    held = {
        robot: tuple(map(str, by_whom))
        for robot in concerned
        if (by_whom := holding(robot, stops, released))
    }
    others = {stop: tuple(names) for stop, names in freed.items() if stop not in lifted}
    return Resumed(lifted=tuple(sorted(lifted)), released=others, still_held=held)


async def _unstored(session: Session, stops: Container[str]) -> dict[str, Stop]:
    """The stops that robots say they rest by, and that are not stored: there was no room."""
    rests: dict[str, list[str]] = {}
    for state in (await session.list(ROBOT_STATE)).values():
        for stop in state.stops:
            if stop not in stops:
                rests.setdefault(stop, []).append(state.robot)
    return {stop: Stop(stop=stop, robots=tuple(robots)) for stop, robots in rests.items()}


async def _registered(session: Session) -> set[str]:
    return {address.robot for address in await session.list(ROBOT_SPEC)}


def _holds_nobody(stop: Stop, released: set[tuple[str, str]]) -> bool:
    """A stop of all goes on for robots that come later."""
    return bool(stop.robots) and not any(stop.holds(robot, released) for robot in stop.robots)


async def _delete(session: Session, stops: Iterable[Stop], released: set[tuple[str, str]]) -> None:
    for stop in stops:
        await session.delete(STOP, StopAddress(stop.stop))
        for of, robot in sorted(released):
            if of == stop.stop:
                await session.delete(STOP_RELEASE, StopReleaseAddress(of, robot))
