"""Reads missions: a world, what the planner believes of it, sentences, and what must come true."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Literal as OneOf

import msgspec
from msgspec.structs import replace

from benchmarks.planning.expectations import Expectation, parse_expectation
from fleet.core.model.skills import SkillModel
from fleet.service.skill_models import load_all_skills
from keyexpr_schema.facts import AT, FactKey, Literal, Value, parse_literal
from keyexpr_schema.ids import Id
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.robots import PoseMRad, RobotSpec
from keyexpr_schema.payloads.world import Fact, Place
from keyexpr_schema.yaml_reader import YamlFile
from sim.errors import BadFile
from sim.files.furniture_schema import FurnitureEntry
from sim.files.robot_file import load_robot
from sim.files.world_file import check_objects, load_world
from sim.files.world_payloads import place_payloads
from sim.files.world_schema import ObjectEntry, ObjectKind, WorldFile
from sim.files.yaml_file import FileEntry, read_entries
from sim.states import ThingStates

HERE = Path(__file__).parent
CLASSES = ("simple", "compound", "complex", "vague", "apartment")
Outcome = OneOf["done", "refused", "given-up"]
"""`refused`: nothing may be done; `given-up`: tried in vain. Both want a sentence that says why."""


class GoalEntry(FileEntry, frozen=True):
    """A goal that says more than a sentence: conditions such as `at(cup_1 or cup_2) = kitchen`."""

    text: str
    conditions: tuple[str, ...] = ()
    always: tuple[str, ...] = ()
    never: tuple[str, ...] = ()


class MoveEntry(FileEntry, frozen=True):
    """Somebody puts a thing on or in another one after so many seconds."""

    at_s: float
    to: str


class MissionEntry(FileEntry, frozen=True):
    """One mission as it is written down.

    The planner believes what is so of every object's place and support, but for those in `unknown`
    and those that it believes elsewhere (`believed`), and of every state that it is not told
    otherwise (`told`, facts). `placed` puts objects elsewhere than the world file: `[what carries
    it, x_m, y_m]`; `states` are how things really are. Objects in `missing` exist in sentences
    only; of those that are `absent` nobody speaks either. `speaker` says the goals; robots are
    `without` some skills.

    What goes wrong: motions that fail for certain (`failures`, counted by robot and kind), robots
    that die after some seconds and are unregistered a minute later (`dies`), things that somebody
    moves (`moves`).

    `final` must hold at the end, `stages` one after the other on the way there, `always` at every
    moment, `never` at none. What neither names must not have been moved or changed, but for
    `may_change`. Reasons must contain the words of `says`.
    """

    mission: str
    setting: str
    robots: tuple[str, ...]
    goals: tuple[str | GoalEntry, ...]
    speaker: str | None = None
    without: dict[str, tuple[str, ...]] = {}
    placed: dict[str, tuple[str, float, float]] = {}
    states: dict[str, dict[str, Value]] = {}
    absent: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()
    believed: dict[str, str] = {}
    told: tuple[str, ...] = ()
    statements: tuple[str, ...] = ()
    failures: dict[str, dict[str, tuple[int, ...]]] = {}
    dies: dict[str, float] = {}
    moves: dict[str, MoveEntry] = {}
    final: tuple[str, ...] = ()
    stages: tuple[tuple[str, ...], ...] = ()
    always: tuple[str, ...] = ()
    never: tuple[str, ...] = ()
    may_change: tuple[str, ...] = ()
    outcome: Outcome = "done"
    says: tuple[str, ...] = ()


class _File(FileEntry, frozen=True):
    missions: tuple[MissionEntry, ...]


class _RobotEntry(FileEntry, frozen=True):
    spec: str
    at_m: tuple[float, float]


class _Setting(FileEntry, frozen=True):
    """A world file and what there is besides; a skill file, whose skills all robots with a hand
    have."""

    world: str
    robots: dict[str, _RobotEntry]
    skills: str | None = None
    furniture: dict[Id, FurnitureEntry] = {}
    object_kinds: dict[Id, ObjectKind] = {}
    objects: dict[Id, ObjectEntry] = {}
    states: dict[Id, dict[Id, Value]] = {}


class _Settings(FileEntry, frozen=True):
    settings: dict[str, _Setting]


class _Household(msgspec.Struct, frozen=True, kw_only=True):
    """A setting, read."""

    world: WorldFile
    places: tuple[Place, ...]
    robots: dict[str, tuple[RobotSpec, PoseMRad]]
    skills: dict[str, SkillModel]


class Mission(msgspec.Struct, frozen=True, kw_only=True):
    """A mission, ready to be run; `world` holds every object that anybody speaks of."""

    entry: MissionEntry
    kind: str
    world: WorldFile
    places: tuple[Place, ...]
    skills: dict[str, SkillModel]
    robots: tuple[tuple[RobotSpec, PoseMRad], ...]
    goals: tuple[Goal, ...]
    told: tuple[Fact, ...]
    final: tuple[Expectation, ...]
    stages: tuple[tuple[Expectation, ...], ...]
    always: tuple[Expectation, ...]
    never: tuple[Expectation, ...]

    @property
    def name(self) -> str:
        """The mission's id."""
        return self.entry.mission

    def existing_world(self) -> WorldFile:
        """The world without what only exists in sentences."""
        there = {
            name: entry
            for name, entry in self.world.object_entries.items()
            if name not in self.entry.missing
        }
        return replace(self.world, object_entries=there)

    def start_of(self, thing: str) -> str | None:
        """The place in which an object lies at the start."""
        return self.world.place_at(*self.world.start_point_m(thing)[:2])

    def believed_places(self) -> dict[str, str]:
        """Where the planner believes objects to be at first."""
        known = {
            thing: self.entry.believed.get(thing) or self.start_of(thing)
            for thing in self.world.object_entries
            if thing not in self.entry.unknown and thing not in self.entry.missing
        }
        return {thing: place for thing, place in known.items() if place is not None}

    def start_carrier(self, thing: str) -> str:
        """What an object is on or in at the start."""
        return self.world.object_entries[thing].carrier

    def believed_states(self) -> tuple[Fact, ...]:
        """What the planner believes of states and people at first: what is so, or is told."""
        states = ThingStates(self.existing_world())
        known: dict[FactKey, Value] = {
            FactKey(AT, person): self.world.place_at(*there.at_m)
            for person, there in self.world.people.items()
            if person not in self.entry.unknown
        }
        known |= {
            FactKey(state, subject): value
            for subject in (*self.world.fixture_of, *self.world.states)
            for state, value in states.of(subject).items()
        }
        told = {fact.key for fact in self.told}
        as_it_is = [
            Fact.of(Literal(variable, value), "person")
            for variable, value in known.items()
            if variable not in told
        ]
        return (*as_it_is, *self.told)

    def believed_supports(self) -> dict[str, str]:
        """What it believes to support those objects whose place it believes rightly."""
        return {
            thing: self.start_carrier(thing)
            for thing, place in self.believed_places().items()
            if place == self.start_of(thing)
        }


def load_missions(only: str | None = None) -> tuple[Mission, ...]:
    """All missions (of one class), in the order of the files.

    Raises:
        BadFile: one sentence that names the file and what is wrong in it.
    """
    return tuple(m for kind in CLASSES if only in (None, kind) for m in _missions_of(kind))


@cache
def _missions_of(kind: str) -> tuple[Mission, ...]:
    path = HERE / "missions" / f"{kind}.yaml"
    entries, file = read_entries(path, _File, "file of missions")
    return tuple(_mission(entry, kind, file) for entry in entries.missions)


@cache
def _setting(name: str) -> _Household:
    path = HERE / "settings" / "settings.yaml"
    entries, file = read_entries(path, _Settings, "file of settings")
    settings = entries.settings
    if name not in settings:
        raise BadFile(f"{path}: there is no setting {name!r}; there are {', '.join(settings)}")
    found = settings[name]
    world = load_world(path.parent / found.world)
    world = replace(
        world,
        furniture={**world.furniture, **found.furniture},
        object_kinds={**world.object_kinds, **found.object_kinds},
        object_entries={**found.objects, **world.object_entries},
        states={**world.states, **found.states},
    )
    check_objects(file, world)
    household = load_all_skills()
    skill_files = () if found.skills is None else (path.parent / found.skills,)
    skills = load_all_skills(skill_files)
    added = tuple(skills.keys() - household.keys())
    return _Household(
        world=world,
        places=place_payloads(world),
        robots={
            robot: (_robot(path.parent, robot, entry, added), (*entry.at_m, math.pi / 2))
            for robot, entry in found.robots.items()
        },
        skills=skills,
    )


def _robot(folder: Path, name: str, entry: _RobotEntry, added: tuple[str, ...]) -> RobotSpec:
    spec = load_robot(folder / entry.spec)
    able = sorted(added) if "grip" in spec.capabilities else ()
    return replace(spec, robot=name, skills=(*spec.skills, *able))


def _mission(entry: MissionEntry, kind: str, file: YamlFile) -> Mission:
    household = _setting(entry.setting)
    where = f"{file}: {entry.mission}"
    objects = dict(household.world.object_entries)
    named = (*entry.placed, *entry.missing, *entry.unknown, *entry.believed, *entry.moves)
    for name in (*named, *entry.may_change):
        if name not in {*objects, *household.world.fixture_of}:
            raise BadFile(f"{where}: there is no object {name!r}; there are {', '.join(objects)}")
    for thing, (carrier, x_m, y_m) in entry.placed.items():
        objects[thing] = replace(objects[thing], on=carrier, inside="", at_m=(x_m, y_m))
    for thing in entry.absent:
        if objects.pop(thing, None) is None:
            raise BadFile(f"{where}: there is no object {thing!r} to be absent")
    for robot in (*entry.robots, *entry.without, *entry.dies, *entry.failures):
        if robot not in household.robots:
            known = ", ".join(household.robots)
            raise BadFile(f"{where}: there is no robot {robot!r}; there are {known}")
    states = {
        thing: {**household.world.states.get(thing, {}), **entry.states.get(thing, {})}
        for thing in (*household.world.states, *entry.states)
        if thing not in entry.absent
    }
    world = replace(household.world, object_entries=objects, states=states)
    if entry.placed or entry.absent or entry.states:
        check_objects(file, world)
    names = (*objects, *world.fixture_of, *world.place_entries, *entry.robots)

    def phrases(texts: Iterable[str]) -> tuple[Expectation, ...]:
        return tuple(parse_expectation(text, names, where) for text in texts)

    made = Mission(
        entry=entry,
        kind=kind,
        world=world,
        places=household.places,
        skills=household.skills,
        robots=tuple(
            (_without(spec, entry.without.get(spec.robot, ())), start)
            for spec, start in map(household.robots.__getitem__, entry.robots)
        ),
        goals=tuple(
            _goal(number, goal, entry.speaker, where) for number, goal in enumerate(entry.goals, 1)
        ),
        told=tuple(
            Fact(subject=key.subject, relation=key.relation, value=value, source="person")
            for text in entry.told
            for key, value in [_literal(text, where)]
        ),
        final=phrases(entry.final),
        stages=tuple(map(phrases, entry.stages)),
        always=phrases(entry.always),
        never=phrases(entry.never),
    )
    if entry.outcome == "done" and not made.final:
        raise BadFile(f"{where}: it must say what is true at the end (`final`)")
    return made


def _without(spec: RobotSpec, skills: tuple[str, ...]) -> RobotSpec:
    return replace(spec, skills=tuple(name for name in spec.skills if name not in skills))


def _goal(number: int, entry: str | GoalEntry, speaker: str | None, where: str) -> Goal:
    if isinstance(entry, str):
        entry = GoalEntry(text=entry)

    def conditions(texts: tuple[str, ...]) -> tuple[Condition, ...]:
        return tuple(_condition(text, where) for text in texts)

    return Goal(
        goal=f"goal_{number}",
        text=entry.text,
        ordinal=number,
        speaker=speaker,
        conditions=conditions(entry.conditions),
        always=conditions(entry.always),
        never=conditions(entry.never),
    )


def _condition(text: str, where: str) -> Condition:
    """`at(cup_1 or cup_2) = kitchen`."""
    relation, _, rest = text.partition("(")
    subjects, _, value = rest.partition(")")
    several = tuple(subjects.split(" or "))
    (key, meant) = _literal(f"{relation}({several[0]}){value}", where)
    return Condition(
        relation=key.relation,
        subject=key.subject,
        value=meant,
        any_of=several if len(several) > 1 else (),
    )


def _literal(text: str, where: str) -> Literal:
    found = parse_literal(text)
    if found is None:
        raise BadFile(f"{where}: {text!r} must look like `at(cup_1) = kitchen`")
    return found
