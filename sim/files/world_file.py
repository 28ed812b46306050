"""Loads a world file and checks that what it says can be.

What is wrong is a `BadFile` with one sentence that names the file, the place in it, what is wrong
and what would be right.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from keyexpr_schema.errors import InvalidId
from keyexpr_schema.facts import IS_ON, IS_OPEN
from keyexpr_schema.ids import check_name
from keyexpr_schema.yaml_reader import YamlFile
from sim.errors import BadFile, there_are
from sim.files.footprints import check_doors, check_room, check_things
from sim.files.world_schema import FLOOR, PlaceEntry, Rectangle, WorldFile
from sim.files.yaml_file import find_file, read_entries

LARGEST_AREA_M2 = 30_000
"""Loading takes half a minute and half a gigabyte then (`benchmarks/bench_world_loading.py`)."""


def load_world(name: str | Path) -> WorldFile:
    """The world file given by path or name (see `config_file`), checked."""
    world, written = read_entries(find_file("worlds", name), WorldFile, "world file")
    for field, entries in (("furniture", world.furniture), ("people", world.people)):
        for entry in entries:
            _check_name(written, f"{field}.{entry}", entry)
    _check_world(written, world)
    return world


def _check_world(file: YamlFile, world: WorldFile) -> None:
    def wrong(where: str, what: str) -> BadFile:
        return BadFile(f"{file.at(where)}: {what}")

    places = world.place_entries
    if not world.place_entries:
        raise wrong("places", "there are none; name at least one")
    width, depth = world.size_m
    if width * depth > LARGEST_AREA_M2:
        raise wrong(
            "size_m",
            f"{width:g} m by {depth:g} m is more than the {LARGEST_AREA_M2:,} square metres that a "
            "world may have; lengths are in metres: is this in decimetres?",
        )
    for name, place in world.place_entries.items():
        _check_name(file, f"places.{name}", name)
        _check_part(file, world, name, place)
        _check_region(file, world, f"places.{name}.region_m", place.region_m)
    for number, wall in enumerate(world.walls):
        if math.dist(wall.from_m, wall.to_m) < world.wall_thickness_m:
            raise wrong(f"walls[{number}]", "it is shorter than it is thick")
    for name, door in world.doors.items():
        for place_name in door.between:
            if place_name not in world.place_entries:
                raise wrong(
                    f"doors.{name}.between",
                    f"there is no place {place_name!r}; {there_are(places, place_name)}",
                )
    for name, zone in world.zones.items():
        _check_region(file, world, f"zones.{name}.region_m", zone.region_m)
    for field, regions in (("doors", world.doors), ("zones", world.zones)):
        for name in regions:
            if name in world.place_entries or (field == "zones" and name in world.doors):
                raise wrong(
                    f"{field}.{name}", "a place or a door has this name already; give it another"
                )
    for name, item in world.furniture.items():
        if item.place not in world.place_entries:
            raise wrong(
                f"furniture.{name}.place",
                f"there is no place {item.place!r}; {there_are(places, item.place)}",
            )
        if item.place not in world.places_around(world.place_at(*item.center_m)):
            raise wrong(
                f"furniture.{name}.center_m", f"{list(item.center_m)} is not in {item.place!r}"
            )
    for name, kind in world.object_kinds.items():
        needed = {
            "cylinder": ("radius_m", "height_m"),
            "bowl": ("radius_m", "height_m"),
            "sphere": ("radius_m",),
            "box": ("size_m",),
            "open_box": ("size_m",),
        }
        for field in needed[kind.shape]:
            if getattr(kind, field) is None:
                raise wrong(f"object_kinds.{name}", f"a {kind.shape} needs `{field}`")
        _check_parents(file, world, name)
    _check_fixtures(file, world)
    check_doors(file, world)
    check_objects(file, world)


def _check_region(
    file: YamlFile, world: WorldFile, where: str, region_m: Iterable[Rectangle]
) -> None:
    """That rectangles are such, and inside the building."""
    width, depth = world.size_m
    for a, b, c, d in region_m:
        if not (0 <= a < c <= width and 0 <= b < d <= depth):
            raise BadFile(
                f"{file.at(where)}: [{a}, {b}, {c}, {d}] is not [x_min, y_min, x_max, y_max] "
                f"inside the building (x 0 to {width}, y 0 to {depth})"
            )


def _check_parents(file: YamlFile, world: WorldFile, name: str) -> None:
    """That a kind is a case of kinds that are there, and not of itself."""
    where, kinds = file.at(f"object_kinds.{name}.is"), world.object_kinds
    ahead, seen = [*kinds[name].parents], set[str]()
    for parent in ahead:
        if parent not in kinds:
            raise BadFile(
                f"{where}: there is no kind {parent!r}; {there_are(kinds, parent)}, "
                "and words that are no kind are `categories`"
            )
    while ahead:
        parent = ahead.pop()
        if parent == name:
            raise BadFile(f"{where}: {name} would be a case of itself")
        if parent in kinds and parent not in seen:
            seen.add(parent)
            ahead += kinds[parent].parents


def _check_part(file: YamlFile, world: WorldFile, name: str, place: PlaceEntry) -> None:
    """That a place is part of another one that is there, around it, and no part of it."""
    where, whole = file.at(f"places.{name}.part_of"), place.part_of
    if whole is None:
        return
    if whole not in world.place_entries:
        others = [other for other in world.place_entries if other != name]
        raise BadFile(
            f"{where}: there is no place {whole!r}; {there_are(others, whole, 'no others')}"
        )
    seen, here = [name], world.place_entries[whole].part_of
    while here in world.place_entries and here not in seen and whole != name:
        seen.append(here)
        here = world.place_entries[here].part_of
    if whole == name or here == name:
        raise BadFile(f"{where}: {name} would be a part of itself")
    for a, b, c, d in place.region_m:
        if not world.place_entries[whole].contains((a + c) / 2, (b + d) / 2):
            raise BadFile(f"{where}: the middle of [{a}, {b}, {c}, {d}] is not in {whole!r}")


def _check_fixtures(file: YamlFile, world: WorldFile) -> None:
    """Furniture that has room for what its kind is made of, and people who stand somewhere."""
    for name, item in world.furniture.items():
        where = file.at(f"furniture.{name}")
        least = LEAST_M.get(item.kind, (0.0, 0.0, 0.0))
        if any(size < small for size, small in zip(item.size_m, least, strict=True)):
            raise BadFile(
                f"{where}.size_m: {list(item.size_m)} is too small for a {item.kind}; "
                f"it needs {list(least)} at least"
            )
        if item.kind in ("cupboard", "fridge") and item.size_m[2] - item.plinth_m < 0.35:
            raise BadFile(
                f"{where}.plinth_m: {item.plinth_m} leaves {item.size_m[2] - item.plinth_m:.2f} m "
                "inside; a hand needs 0.35 m"
            )
        if item.process is not None and not (item.switch or item.kind in ("lamp", "switch")):
            raise BadFile(f"{where}.process: nothing starts it; add `switch: true`")
    for name, person in world.people.items():
        where = file.at(f"people.{name}")
        if world.place_at(*person.at_m) is None:
            raise BadFile(f"{where}.at_m: {list(person.at_m)} is in none of the places")
    taken = [*world.place_entries]
    for name in dict.fromkeys([*world.furniture, *world.people, *world.fixture_of]):
        if name in taken or (name in world.people and name in world.furniture):
            raise BadFile(
                f"{file.at(f'furniture.{name}')}: a place or a person has this name already; "
                "give it another"
            )


LEAST_M: dict[str, tuple[float, float, float]] = {
    "cupboard": (0.4, 0.3, 0.4),
    "fridge": (0.4, 0.3, 0.4),
    "drawers": (0.3, 0.3, 0.3),
    "shelf": (0.3, 0.2, 0.2),
    "sink": (0.5, 0.4, 0.5),
    "sofa": (0.6, 0.5, 0.3),
    "bed": (0.6, 1.0, 0.2),
    "lamp": (0.1, 0.1, 1.3),
    "charger": (0.1, 0.1, 0.2),
}
"""Length, width and height that a kind of furniture needs at least."""


def check_objects(file: YamlFile, world: WorldFile) -> None:
    """Check where the objects of `world` lie, as `file` says it.

    Raises:
        BadFile: one lies where it cannot.
    """
    for name, entry in world.object_entries.items():
        _check_name(file, f"objects.{name}", name)
        where = file.at(f"objects.{name}")
        if name in world.place_entries:
            raise BadFile(f"{where}: a place has this name already; give the object another")
        if entry.kind not in world.object_kinds:
            raise BadFile(
                f"{where}.kind: there is no kind {entry.kind!r}; "
                f"{there_are(world.object_kinds, entry.kind, 'none in object_kinds')}"
            )
        if entry.home is not None and entry.home not in world.place_entries:
            raise BadFile(
                f"{where}.home: there is no place {entry.home!r}; "
                f"{there_are(world.place_entries, entry.home)}"
            )
        if bool(entry.on) == bool(entry.inside):
            raise BadFile(f"{where}: say either `on` or `in`: what it is on, or in")
        carrier = entry.carrier
        if carrier == FLOOR:
            if world.place_at(*entry.at_m) is None:
                raise BadFile(f"{where}.at_m: {list(entry.at_m)} is in none of the places")
            continue
        field = "on" if entry.on else "in"
        half = _half_m(world, name, carrier)
        if half is None:
            raise BadFile(
                f"{where}.{field}: there is no table {carrier!r}; "
                f"{there_are(_carriers(world, name), carrier)}"
            )
        if any(abs(at) > most for at, most in zip(entry.at_m, half, strict=True)):
            raise BadFile(
                f"{where}.at_m: {list(entry.at_m)} is not {field} {carrier}, which reaches "
                f"{round(half[0], 3)} m in x and {round(half[1], 3)} m in y from its centre"
            )
        check_room(file, world, name)
    check_things(file, world)
    _check_states(file, world)


def _check_states(file: YamlFile, world: WorldFile) -> None:
    known = {*world.object_entries, *world.fixture_of}
    for name, states in world.states.items():
        if name not in known:
            raise BadFile(f"{file.at(f'states.{name}')}: there is no such thing in this world")
        for state, thing in ((IS_OPEN, world.fixtures.movers), (IS_ON, world.fixtures.buttons)):
            if state in states and name not in thing:
                raise BadFile(
                    f"{file.at(f'states.{name}.{state}')}: it does not {_DOES[state]}; "
                    f"{there_are(thing, name)}"
                )
        for state, value in states.items():
            if value is None or value == "unknown":
                raise BadFile(
                    f"{file.at(f'states.{name}.{state}')}: say how it is at the start, or leave it "
                    "out: the simulated world knows everything"
                )
        for state in (IS_OPEN, IS_ON):
            if not isinstance(states.get(state, True), bool):
                raise BadFile(f"{file.at(f'states.{name}.{state}')}: say true or false")


_DOES = {IS_OPEN: "open", IS_ON: "have a switch"}


def _half_m(world: WorldFile, name: str, carrier: str) -> tuple[float, float] | None:
    """Half of the room that there is on or in a carrier, (x, y); `None` if it carries nothing."""
    if carrier in world.fixtures.carriers:
        x, y, _ = world.fixtures.carriers[carrier][1].size_m
        return (x / 2, y / 2)
    if carrier in _carriers(world, name):
        x, y, _ = world.kind_of(carrier).extent_m
        return (x / 2, y / 2)
    return None


def _carriers(world: WorldFile, name: str) -> list[str]:
    """Everything that an object could be on or in: furniture, and the objects before it."""
    found = list(world.fixtures.carriers)
    for other, entry in world.object_entries.items():
        if other == name:
            break
        kind = world.object_kinds.get(entry.kind)
        if kind is not None and kind.carries:
            found.append(other)
    return [*found, FLOOR]


def _check_name(file: YamlFile, where: str, name: str) -> None:
    try:
        check_name(name)
    except InvalidId as error:
        raise BadFile(f"{file.at(where)}: {error}") from None
