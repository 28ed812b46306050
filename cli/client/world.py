"""Publishes objects and places, of a world file or one by one; each write is confirmed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from msgspec.structs import replace

from cli.client.names import check_free, claim_name, next_number
from cli.errors import BadArgument, check_known
from keyexpr_schema.ids import check_id, check_name
from keyexpr_schema.key import Address, Key
from keyexpr_schema.keyspace import FACT, OBJECT, PLACE, REGION, STATEMENT
from keyexpr_schema.payloads.closures import Rectangle, Region, RegionAddress
from keyexpr_schema.payloads.world import Object, ObjectAddress, Place, PlaceAddress

if TYPE_CHECKING:
    from keyexpr_schema.transport.session import Session


async def put_world(
    session: Session,
    places: Iterable[Place],
    objects: Iterable[Object],
    regions: Iterable[Region] = (),
    by: str = "",
) -> None:
    """Store places, objects, doors and zones, confirmed; `by` somebody, else by whose session it
    is."""
    by = by or session.config.by
    for region in regions:
        await session.confirm(REGION, RegionAddress(region.region), region)
    for place in places:
        await session.confirm(PLACE, PlaceAddress(place.place), replace(place, by=by))
    for thing in objects:
        await session.confirm(OBJECT, ObjectAddress(thing.object), replace(thing, by=by))


async def put_object(
    session: Session,
    name: str,
    kind: str,
    label: str | None,
    aliases: tuple[str, ...],
    home: str | None,
    mass_kg: float | None,
    features: tuple[str, ...] = (),
    part_of: str | None = None,
    fixed: bool = False,
) -> Object:
    """Store an object, confirmed; of one that is known, what is not said now stays as it was.

    A new one is the next of its kind: with cup 1 and cup 2 there, it is cup 3. `fixed`: it does not
    move.

    Raises:
        BadArgument: the name stands for a place or a robot, or it would be a part of itself.
        Unknown: its home is no place or object, or what it is a part of is no object.
        InvalidId: the name or the kind cannot be one.
    """
    check_name(name, "object")
    check_id(kind, "kind")
    await claim_name(session, name, "object")
    places = [address.place for address in await session.list(PLACE)]
    await check_free(session, name, "object")
    objects = {a.object: thing for a, thing in (await session.list(OBJECT)).items()}
    if home is not None:
        check_known("place or object", home, [*places, *objects])
    if part_of is not None:
        check_known("object", part_of, objects)
        if part_of == name:
            raise BadArgument(f"{name} cannot be a part of itself")
    old = objects.get(name)
    number = None if old is None or old.kind != kind else old.ordinal
    if number is None:
        highest = max((o.ordinal for o in objects.values() if o.kind == kind), default=0)
        number = await next_number(session, "objects", kind, highest)

    def changed(now: Object | None) -> Object:
        if now is None or now.kind != kind:
            if now is not None and now != old:
                raise BadArgument(
                    f"somebody else has just stored {name} as a {now.kind}; choose another name"
                )
            now = Object(object=name, kind=kind, label=_in_words(name), ordinal=number)
        return replace(
            now,
            label=label or now.label,
            aliases=aliases or now.aliases,
            home=home or now.home,
            mass_kg=now.mass_kg if mass_kg is None else mass_kg,
            features=features or now.features,
            part_of=part_of or now.part_of,
            movable=now.movable and not fixed,
            by=session.config.by,
        )

    return await session.update(OBJECT, ObjectAddress(name), changed)


async def put_place(
    session: Session,
    name: str,
    label: str | None,
    aliases: tuple[str, ...],
    regions: Iterable[str],
    distances: Iterable[str],
) -> Place:
    """Store a place, confirmed; of one that is known, what is not said now stays as it was.

    A distance counts both ways, so the other place is put with it, too.

    Raises:
        BadArgument: the name stands for an object or a robot, or a region or distance is none.
        Unknown: a distance is to no place.
        InvalidId: the name cannot be one.
    """
    check_name(name, "place")
    region_m = tuple(_region(written) for written in regions)
    travel_m = dict(_distance(written) for written in distances)
    await claim_name(session, name, "place")
    places = {a.place: place for a, place in (await session.list(PLACE)).items()}
    for other in travel_m:
        check_known("place", other, [p for p in places if p != name])
    await check_free(session, name, "place")

    def changed(now: Place | None) -> Place:
        now = now or Place(place=name, label=_in_words(name))
        return replace(
            now,
            label=label or now.label,
            aliases=aliases or now.aliases,
            region_m=region_m or now.region_m,
            travel_m={**now.travel_m, **travel_m},
            by=session.config.by,
        )

    place = await session.update(PLACE, PlaceAddress(name), changed)
    for other, metres in travel_m.items():
        back = _with_distance(places[other], name, metres, session.config.by)
        await session.update(PLACE, PlaceAddress(other), back)
    return place


async def named_in_world(
    session: Session, words: Sequence[str]
) -> list[tuple[Key[Any, Any], Address, str]]:
    """What these words name: key and address of each, and what it is called.

    A word is the name of a statement, an object or a place, or a fact as `at(cup_1)`. Two words of
    which the first is no name are one fact, `at cup_1`.

    Raises:
        Unknown: one of them names nothing.
    """
    facts = {str(address.key): address for address in await session.list(FACT)}
    statements = {a.statement: a for a in await session.list(STATEMENT)}
    objects = {a.object: a for a in await session.list(OBJECT)}
    places = {a.place: a for a in await session.list(PLACE)}
    names = {*statements, *objects, *places}
    if len(words) == 2 and words[0] not in names and "(" not in words[0]:
        words = [f"{words[0]}({words[1]})"]
    found: list[tuple[Key[Any, Any], Address, str]] = []
    for word in dict.fromkeys(words):
        if "(" in word:
            check_known("fact", word, facts, "see `robotctl world add --fact`")
            found.append((FACT, facts[word], word))
            continue
        check_known(
            "statement, object or place",
            word,
            names,
            "load a world with `robotctl world load FILE`",
        )
        if word in statements:
            found.append((STATEMENT, statements[word], f"statement {word}"))
        elif word in objects:
            found.append((OBJECT, objects[word], f"object {word}"))
        else:
            found.append((PLACE, places[word], f"place {word}"))
    return found


def _with_distance(
    before: Place, to: str, metres: float, by: str
) -> Callable[[Place | None], Place]:
    def changed(now: Place | None) -> Place:
        now = now or before
        return replace(now, travel_m={**now.travel_m, to: metres}, by=by)

    return changed


def _in_words(name: str) -> str:
    return name.replace("_", " ").replace("-", " ")


def parse_rectangle(written: str) -> Rectangle | None:
    """`0,0,2.5,4` as `(x_min, y_min, x_max, y_max)` [m, world frame]; `None` if it is none."""
    try:
        x_min, y_min, x_max, y_max = (float(part) for part in written.split(","))
    except ValueError:
        return None
    if x_min < x_max and y_min < y_max and math.isfinite(x_max - x_min + y_max - y_min):
        return x_min, y_min, x_max, y_max
    return None


def _region(written: str) -> Rectangle:
    if (rectangle := parse_rectangle(written)) is None:
        raise BadArgument(
            f"region {written!r} is not X_MIN,Y_MIN,X_MAX,Y_MAX in metres, such as 0,0,2.5,4"
        )
    return rectangle


def _distance(written: str) -> tuple[str, float]:
    """`kitchen=2.5` as `("kitchen", 2.5)` [m]."""
    place, _, number = written.partition("=")
    try:
        metres = float(number)
    except ValueError:
        metres = math.nan
    if not (place and 0.0 <= metres < math.inf):
        raise BadArgument(f"distance {written!r} is not PLACE=METRES, such as kitchen=2.5")
    return place, metres
