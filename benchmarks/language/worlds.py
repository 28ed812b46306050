"""The worlds that the sentences are said in: what exists, what is believed of it, who speaks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from pathlib import Path

from keyexpr_schema.facts import AT, FactKey, Value
from keyexpr_schema.ids import Id
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Feature, Object, Place
from sim.errors import BadFile
from sim.files.mission_file import load_mission
from sim.files.world_payloads import object_payloads, place_payloads
from sim.files.yaml_file import FileEntry, read_entries

HERE = Path(__file__).parent / "worlds"
NOW = datetime.fromisoformat("2026-03-04T09:30:00+00:00")
"""When every sentence is said: a Wednesday, half past nine in the morning."""


class _Place(FileEntry, frozen=True):
    label: str
    aliases: tuple[str, ...] = ()
    part_of: Id | None = None


class _Robot(FileEntry, frozen=True):
    label: str
    skills: tuple[Id, ...]
    capabilities: dict[str, float]
    at: Id


class _Person(FileEntry, frozen=True):
    label: str
    at: Id
    aliases: tuple[str, ...] = ()
    categories: tuple[str, ...] = ()


class _Kind(FileEntry, frozen=True, rename={"parents": "is"}):
    parents: tuple[str, ...] = ()
    categories: tuple[str, ...] = ()
    uses: tuple[str, ...] = ()
    features: tuple[str, ...] = ()
    movable: bool = True


class _Thing(FileEntry, frozen=True, rename={"inside": "in"}):
    kind: str
    label: str = ""
    aliases: tuple[str, ...] = ()
    at: Id | None = None
    on: Id | None = None
    inside: Id | None = None
    home: Id | None = None
    properties: dict[str, Value] = {}
    states: dict[str, Value] = {}

    @property
    def carrier(self) -> str | None:
        """What carries it directly; `None`: nobody knows."""
        return self.at or self.on or self.inside


class _WorldFile(FileEntry, frozen=True):
    """A world of its own, or (`mission`) that of a mission file with what it has at its start."""

    world: Id
    speaker: Id
    mission: str | None = None
    skills: tuple[str, ...] = ()
    places: dict[Id, _Place] = {}
    robots: dict[Id, _Robot] = {}
    people: dict[Id, _Person] = {}
    kinds: dict[str, _Kind] = {}
    things: dict[Id, _Thing] = {}
    states: dict[Id, dict[str, Value]] = {}


@dataclass(frozen=True)
class World:
    """What exists by id, what is believed, which files say more of skills.

    `facts` have `at(x)` for what carries x directly, and states such as `clean(x)`. Attributes
    (`colour`, `size`, `owner`, …) are properties of objects.
    """

    name: str
    speaker: str
    places: Mapping[str, Place]
    objects: Mapping[str, Object]
    robots: Mapping[str, RobotSpec]
    facts: Mapping[FactKey, Value]
    skill_files: tuple[Path, ...]

    def carriers(self, name: str) -> tuple[str, ...]:
        """All that carries something, the direct carrier first, the place last."""
        found: list[str] = []
        here: str | None = name
        while here is not None and here not in found:
            if here != name:
                found.append(here)
            thing = self.objects.get(here)
            at = self.facts.get(FactKey(AT, here))
            whole = thing.part_of if thing is not None else None
            here = whole or (at if isinstance(at, str) else None)
        return tuple(found)

    @property
    def names(self) -> frozenset[str]:
        """Everything that a condition can be about."""
        return frozenset({*self.places, *self.objects, *self.robots})


def world_names() -> tuple[str, ...]:
    """The worlds there are."""
    return tuple(sorted(path.stem for path in HERE.glob("*.yaml") if path.stem != "skills"))


@cache
def load_language_world(name: str) -> World:
    """The world of that name.

    Raises:
        BadFile: one sentence that names the file and what is wrong in it.
    """
    path = HERE / f"{name}.yaml"
    file, _ = read_entries(path, _WorldFile, "world of sentences")
    if file.mission is not None:
        return _of_mission(file)
    objects = _objects(file)
    facts: dict[FactKey, Value] = {}
    for thing, entry in file.things.items():
        facts |= {FactKey(relation, thing): value for relation, value in entry.states.items()}
        if entry.carrier is not None:
            facts[FactKey(AT, thing)] = entry.carrier
    facts |= {FactKey(AT, person): entry.at for person, entry in file.people.items()}
    facts |= {FactKey(AT, robot): entry.at for robot, entry in file.robots.items()}
    for subject, states in file.states.items():
        facts |= {FactKey(relation, subject): value for relation, value in states.items()}
    world = World(
        name=file.world,
        speaker=file.speaker,
        places={
            name: Place(place=name, label=e.label, aliases=e.aliases, part_of=e.part_of)
            for name, e in file.places.items()
        },
        objects=objects,
        robots={
            name: RobotSpec(
                robot=name, model=name, label=e.label, skills=e.skills, capabilities=e.capabilities
            )
            for name, e in file.robots.items()
        },
        facts=facts,
        skill_files=tuple(HERE / skills for skills in file.skills),
    )
    _check(world, path)
    return world


def _objects(file: _WorldFile) -> dict[str, Object]:
    counts: dict[str, int] = {}
    found: dict[str, Object] = {}
    for name, entry in file.things.items():
        kind = file.kinds.get(entry.kind)
        if kind is None:
            raise BadFile(f"{file.world}: {name}: there is no kind {entry.kind!r}")
        parents = [file.kinds[parent] for parent in kind.parents]
        counts[entry.kind] = counts.get(entry.kind, 0) + 1
        found[name] = Object(
            object=name,
            kind=entry.kind,
            label=entry.label or name.replace("_", " "),
            ordinal=counts[entry.kind],
            aliases=entry.aliases,
            movable=kind.movable,
            home=entry.home if kind.movable else entry.carrier,
            categories=tuple(
                dict.fromkeys(
                    (*kind.categories, *kind.parents, *(c for p in parents for c in p.categories))
                )
            ),
            uses=tuple(dict.fromkeys((*kind.uses, *(use for p in parents for use in p.uses)))),
            features=tuple(
                dict.fromkeys((*kind.features, *(f for p in parents for f in p.features)))
            ),
            properties=entry.properties,
        )
    for name, person in file.people.items():
        found[name] = Object(
            object=name,
            kind="person",
            label=person.label,
            aliases=person.aliases,
            movable=False,
            home=person.at,
            categories=person.categories,
            features=(Feature.PERSON.value,),
            room=1,
        )
    return found


def _of_mission(file: _WorldFile) -> World:
    mission = load_mission(str(file.mission))
    world = mission.world
    objects = {thing.object: thing for thing in object_payloads(world)}
    facts: dict[FactKey, Value] = {
        FactKey(relation, subject): value
        for subject, states in world.states.items()
        for relation, value in states.items()
    }
    for name, thing in objects.items():
        lying = world.object_entries.get(name)
        carrier = (lying.on or lying.inside) if lying is not None else thing.home
        if carrier is not None and thing.part_of is None:
            facts[FactKey(AT, name)] = carrier
    for robot in mission.robots:
        facts[FactKey(AT, robot.spec.robot)] = world.place_at(*robot.start_m_rad[:2])
    return World(
        name=file.world,
        speaker=file.speaker,
        places={place.place: place for place in place_payloads(world)},
        objects=objects,
        robots={robot.spec.robot: robot.spec for robot in mission.robots},
        facts=facts,
        skill_files=(),
    )


def _check(world: World, path: Path) -> None:
    """Every name that the file mentions exists."""
    mentioned = {
        **{f"{key}": value for key, value in world.facts.items() if key.relation == AT},
        **{f"home of {thing.object}": thing.home for thing in world.objects.values()},
        **{f"{key} ": key.subject for key in world.facts},
    }
    for where, name in mentioned.items():
        if name is not None and name not in world.names:
            raise BadFile(f"{path}: {where}: there is no {name!r}")
