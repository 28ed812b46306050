"""A world as it is registered on keys. Where movable things are is not registered."""

from __future__ import annotations

import math
from collections.abc import Iterable

import msgspec

from keyexpr_schema.payloads.closures import Rectangle, Region, RegionKind
from keyexpr_schema.payloads.world import Feature, Object, Place, Way
from sim.files.fixtures import Fixture
from sim.files.place_ways import place_ways
from sim.files.solids import Solid, doorways
from sim.files.world_schema import WorldFile

_KINDS = {"drawers": "dresser", "block": "furniture"}
"""What a piece of furniture is called that has another name in files."""
_NUMERALS = ("first", "second", "third", "fourth", "fifth", "sixth")


def place_payloads(world: WorldFile) -> tuple[Place, ...]:
    """The places, with their surfaces, and the ways and driven distances between them."""
    ways = place_ways(world)
    return tuple(
        Place(
            place=name,
            label=entry.label,
            aliases=entry.aliases,
            region_m=entry.region_m,
            surfaces=world.surfaces(name),
            travel_m=_shortest(ways[name]),
            ways=ways[name],
            part_of=entry.part_of,
        )
        for name, entry in world.place_entries.items()
    )


def _shortest(ways: Iterable[Way]) -> dict[str, float]:
    """The driven distance to each place, m."""
    found: dict[str, float] = {}
    for way in ways:
        found[way.to] = min(way.length_m, found.get(way.to, math.inf))
    return found


def region_payloads(world: WorldFile) -> tuple[Region, ...]:
    """Doors and zones: what else can be closed, besides places."""
    doors = (
        Region(
            region=name,
            kind=RegionKind.DOOR,
            label=name.replace("_", " "),
            region_m=(_around(opening),),
            between=world.doors[name].between,
        )
        for name, opening in doorways(world).items()
    )
    zones = (
        Region(
            region=name,
            kind=RegionKind.ZONE,
            label=zone.label or name.replace("_", " "),
            region_m=zone.region_m,
        )
        for name, zone in world.zones.items()
    )
    return (*doors, *zones)


def _around(opening: Solid) -> Rectangle:
    """The upright rectangle around an opening in a wall."""
    (x, y), (long, deep) = opening.center_m, opening.half_m
    c, s = abs(math.cos(opening.yaw_rad)), abs(math.sin(opening.yaw_rad))
    half_x, half_y = c * long + s * deep, s * long + c * deep
    return (x - half_x, y - half_y, x + half_x, y + half_y)


def object_payloads(world: WorldFile) -> tuple[Object, ...]:
    """The things: what they are, and not where. Movable ones first, then furniture and people."""
    counts: dict[str, int] = {}

    def ordinal(kind: str) -> int:
        counts[kind] = counts.get(kind, 0) + 1
        return counts[kind]

    found = []
    for name, entry in world.object_entries.items():
        kind = world.kind_of(name)
        features = (Feature.CONTAINS.value,) if kind.hollow else ()
        found.append(
            Object(
                object=name,
                kind=entry.kind,
                label=entry.label or name.replace("_", " "),
                ordinal=ordinal(entry.kind),
                aliases=entry.aliases,
                mass_kg=kind.mass_kg,
                home=entry.home,
                categories=_categories(world, entry.kind),
                uses=kind.uses,
                features=tuple(dict.fromkeys((*features, *kind.features))),
                room=kind.room,
                properties={**kind.properties, **entry.properties},
            )
        )
    for fixture in world.fixtures.by_name.values():
        for thing in (_fixture(world, fixture), *_parts(world, fixture)):
            found.append(msgspec.structs.replace(thing, ordinal=ordinal(thing.kind)))
    return tuple(found)


def _fixture(world: WorldFile, fixture: Fixture) -> Object:
    name = fixture.name
    if name in world.people:
        person = world.people[name]
        return Object(
            object=name,
            kind="person",
            label=person.label or name.replace("_", " "),
            aliases=person.aliases,
            movable=False,
            home=world.place_at(*person.at_m),
            features=(Feature.PERSON.value,),
            room=1,
        )
    entry = world.furniture[name]
    kind = entry.called or _KINDS.get(entry.kind, entry.kind)
    return Object(
        object=name,
        kind=kind,
        label=entry.label or name.replace("_", " "),
        aliases=entry.aliases,
        movable=False,
        home=entry.place,
        categories=tuple(dict.fromkeys((*entry.categories, "furniture"))),
        features=(*features_of(fixture, name), *entry.features),
        room=entry.room,
        properties=entry.properties,
    )


def _parts(world: WorldFile, fixture: Fixture) -> list[Object]:
    names = dict.fromkeys(carrier.thing for carrier in fixture.all_carriers)
    names.pop(fixture.name, None)
    entry = world.furniture.get(fixture.name)
    found = []
    for number, name in enumerate(names):
        assert entry is not None  # people have no parts
        whole = entry.label or fixture.name.replace("_", " ")
        kind = "drawer" if fixture.mover(name) is not None else "board"
        found.append(
            Object(
                object=name,
                kind=kind,
                label=f"{_NUMERALS[number]} {kind} of the {whole}",
                movable=False,
                home=entry.place,
                features=features_of(fixture, name),
                part_of=fixture.name,
                blocked_by=fixture.drawers_above(name),
            )
        )
    return found


def features_of(fixture: Fixture, thing: str) -> tuple[str, ...]:
    """What a fixture, or a part of it, is good for."""
    features = [
        Feature.CONTAINS if carrier.inside else Feature.SUPPORTS
        for carrier in fixture.all_carriers
        if carrier.thing == thing
    ]
    if fixture.mover(thing) is not None:
        features.append(Feature.OPENABLE)
    if fixture.button is not None and fixture.button.thing == thing:
        features.append(Feature.SWITCHABLE)
    return tuple(feature.value for feature in features)


def _categories(world: WorldFile, kind: str) -> tuple[str, ...]:
    """Its own, and the kinds that it is a case of, with theirs."""
    found: dict[str, None] = {}
    ahead = [kind]
    while ahead:
        entry = world.object_kinds.get(ahead.pop(0))
        if entry is None:
            continue
        found.update(dict.fromkeys(entry.categories))
        ahead += [parent for parent in entry.parents if parent not in found]
        found.update(dict.fromkeys(entry.parents))
    return tuple(found)
