"""Closures: put, ended, and what they are about."""

from __future__ import annotations

import secrets
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from msgspec.structs import replace

from cli.client.publish import fleet_time_s
from cli.errors import BadArgument, check_known
from cli.times import moment
from keyexpr_schema.keyspace import CLOSURE, PLACE, REGION, ROBOT_SPEC
from keyexpr_schema.payloads.closures import Closure, ClosureAddress, Rectangle
from keyexpr_schema.payloads.world import Place

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session

WHAT = "place, door or zone"


async def put_closures(
    session: Session,
    names: Sequence[str],
    boxes: Sequence[Rectangle],
    models: Sequence[str],
    by: str,
    reason: str,
    *,
    one_at_a_time: bool = False,
    for_s: float | None = None,
) -> list[Closure]:
    """Store closures, confirmed: one for each name, so that each ends by itself, and one for the
    boxes. They end by themselves `for_s` [s] from now on the fleet's clock.

    With a place goes what is part of it, with a box each place, door and zone that lies in it.

    Raises:
        Unknown: there is no such place, door or zone, or no robot of such a model.
        BadArgument: a place has no region, so that no driver knows where it is.
    """
    places = {a.place: place for a, place in (await session.list(PLACE)).items()}
    regions = {name: place.region_m for name, place in places.items()}
    regions |= {a.region: region.region_m for a, region in (await session.list(REGION)).items()}
    for name in names:
        check_known(WHAT, name, regions, "load a world file, or give --box")
        if not regions[name]:
            raise BadArgument(f"nobody knows where {name} is: it has no region, give --box")
    known = {spec.model for spec in (await session.list(ROBOT_SPEC)).values()}
    for model in models:
        check_known("model of a registered robot", model, known)
    now_s = None if for_s is None else await fleet_time_s(session)
    until_s = None if now_s is None or for_s is None else now_s + for_s
    given = Closure(
        closure="c",
        names=(),
        models=tuple(models),
        one_at_a_time=one_at_a_time,
        until_s=until_s,
        by=by,
        reason=reason,
        wall_time_s=time.time(),
    )
    found = [
        replace(given, names=(name, *_parts(name, places)), region_m=regions[name])
        for name in names
    ]
    if boxes:
        inside = tuple(sorted(name for name in regions if _covers(boxes, regions[name])))
        found.append(replace(given, names=inside, region_m=tuple(boxes)))
    found = [replace(each, closure=f"closure-{secrets.token_hex(4)}") for each in found]
    for closure in found:
        await session.confirm_new(CLOSURE, ClosureAddress(closure.closure), closure)
    return found


async def end_closures(session: Session, names: Sequence[str]) -> list[Closure]:
    """End the closures with these names, or of these places, doors and zones; with none named, all.
    Returns those whose time was not over.

    Raises:
        Unknown: nothing with one of the names is closed.
    """
    stored = await session.list(CLOSURE)
    timed = any(each.until_s is not None for each in stored.values())
    now_s = await fleet_time_s(session) if timed else 0.0
    standing = {a: each for a, each in stored.items() if not each.is_over(now_s)}
    ended = []
    for name in names:
        closed = {each.names[0] for each in standing.values() if each.names}
        check_known("closure", name, closed | {a.closure for a in standing})
    for address, closure in stored.items():
        if not names or {closure.closure, *closure.names[:1]} & set(names):
            await session.delete(CLOSURE, address)
            ended += [closure] if address in standing else []
    return ended


def in_words(closure: Closure) -> str:
    """`kitchen_door is closed by ana (wet), until today 17:00`."""
    until = "" if closure.until_s is None else f", until {moment(None, closure.until_s)}"
    return f"{closure}{until}"


def how_to_open(closure: Closure) -> str:
    """The command that ends it."""
    return f"robotctl world open {(*closure.names, closure.closure)[0]}"


def _parts(place: str, places: Mapping[str, Place]) -> list[str]:
    """The places that are part of this one, however indirectly."""
    found = [place]
    for whole in found:
        found += [p for p, each in places.items() if each.part_of == whole and p not in found]
    return found[1:]


def _covers(boxes: Sequence[Rectangle], region_m: Sequence[Rectangle]) -> bool:
    return bool(region_m) and all(
        any(a <= w and b <= x and y <= c and z <= d for a, b, c, d in boxes)
        for w, x, y, z in region_m
    )
