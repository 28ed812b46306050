"""What the planner believes of the world at one moment: a frozen snapshot, and questions to it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from typing import Any

import msgspec

from fleet.core.model.derived import Inventory, holds, stays_at, written
from fleet.core.model.durations import only_moves, pace, work_s
from fleet.core.model.parameter_types import ParameterType, names_of, parse_type
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.ways import open_ways_m
from keyexpr_schema.facts import AT, HOLDING, IN, NOTHING, ON, FactKey, Value
from keyexpr_schema.payloads.closures import Closure, shut
from keyexpr_schema.payloads.durations import Durations
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.robots import RobotSpec
from keyexpr_schema.payloads.world import Fact, Object, Place

TRAVEL_SPEED_M_S = 0.5
"""Speed assumed for a robot whose spec gives none, m/s; a slow walk indoors."""
UNKNOWN_TRAVEL_M = 5.0
"""Distance assumed where the map has none, m; about one room to the next."""


Call = tuple[str, tuple[tuple[str, str], ...]]
"""A skill and its arguments, with robots in place of actors: what makes two tasks the same."""


def call_of(skill: str, args: Mapping[str, str]) -> Call:
    """What a task does."""
    return skill, tuple(sorted(args.items()))


class Hopeless(msgspec.Struct, frozen=True):
    """A call that failed, and would again as its worker says, though no fact is against it."""

    skill: str
    args: dict[str, str]
    robot: str
    reason: str


@dataclass(eq=False)
class _WorkedOut:
    """What follows from what there is and how fast robots are, whatever is believed of it: worlds
    that are alike in that share it.

    Plans are compared by thousands of ways, each in a world of other facts.
    """

    basis: tuple[object, ...]
    travels_s: dict[tuple[str, Value, str], float] = field(default_factory=dict)
    of_type: dict[str, tuple[str, ...]] = field(default_factory=dict)
    open_m: dict[tuple[str, str], dict[str, float]] = field(default_factory=dict)
    """Ways that closures leave open, by model of robot and place."""

    def is_of(self, basis: tuple[object, ...]) -> bool:
        """Whether it was worked out of the very same."""
        return all(one is other for one, other in zip(self.basis, basis, strict=True))


@dataclass(frozen=True)
class WorldModel:
    """Places, objects and robots that exist, and the facts believed of them.

    `available` names the robots whose workers are connected now; only those get work. `durations`
    are those learned, by type of robot; skill models and top speeds hold for the others. `hopeless`
    are calls that are not to be tried again, `closures` say where robots do not drive.
    """

    skills: Mapping[str, SkillModel]
    places: Mapping[str, Place] = field(default_factory=dict)
    objects: Mapping[str, Object] = field(default_factory=dict)
    robots: Mapping[str, RobotSpec] = field(default_factory=dict)
    available: Collection[str] = frozenset()
    facts: Mapping[FactKey, Value] = field(default_factory=dict)
    durations: Mapping[str, Durations] = field(default_factory=dict)
    hopeless: tuple[Hopeless, ...] = ()
    closures: tuple[Closure, ...] = ()
    taken_s: Mapping[str, float] = field(default_factory=dict)
    """Chargers that others are at, or on the way to, and how long that takes yet [s]."""
    asked: dict[object, Any] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Answers about this very world, kept by those who work them out."""
    _worked_out: _WorkedOut | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        basis = self.places, self.objects, self.robots, self.durations, self.closures
        if self._worked_out is None or not self._worked_out.is_of(basis):
            object.__setattr__(self, "_worked_out", _WorkedOut(basis))

    @classmethod
    def of(
        cls,
        skills: Mapping[str, SkillModel],
        places: Iterable[Place],
        objects: Iterable[Object],
        robots: Iterable[RobotSpec],
        facts: Iterable[Fact],
        available: Iterable[str] | None = None,
        durations: Mapping[str, Durations] | None = None,
    ) -> WorldModel:
        """A model from payloads; without `available` every robot is taken to be connected.

        Of several facts about where a thing is, at a place, on or in a thing, the newest counts.
        """
        specs = {spec.robot: spec for spec in robots}
        world = cls(
            skills=skills,
            places={place.place: place for place in places},
            objects={thing.object: thing for thing in objects},
            robots=specs,
            available=frozenset(specs if available is None else available),
            durations=durations or {},
        )
        # One that does not say when it was said is said now; of the same moment the finer one.
        said = sorted(facts, key=lambda f: (f.time_s == 0.0, f.time_s, f.relation in (ON, IN)))
        literals = (written(fact.literal, world) for fact in said)
        return replace(world, facts={literal.variable: literal.value for literal in literals})

    def value(self, relation: str, subject: str) -> Value:
        """The believed value of a variable; `None` is unknown."""
        return self.facts.get(FactKey(relation, subject))

    def kind_of(self, name: str) -> str | None:
        """`robot`, `object` or `place`, or `None` for a name that stands for nothing."""
        if name in self.robots:
            return "robot"
        if name in self.objects:
            return "object"
        return "place" if name in self.places else None

    def is_of_type(self, name: str, type_: ParameterType) -> bool:
        """Whether a name may stand where that type is asked for; not if nothing has the name."""
        return type_.admits(self.kind_of(name), self.objects.get(name))

    def of_type(self, type_: ParameterType | str) -> tuple[str, ...]:
        """Every name that may stand where that type is asked for, in a fixed order."""
        text, known = str(type_), self._known.of_type
        if text not in known:
            kind = parse_type(type_) if isinstance(type_, str) else type_
            things = self.objects.values()
            known[text] = names_of(kind, self.robots, self.places, things)
        return known[text]

    @property
    def _known(self) -> _WorkedOut:
        assert self._worked_out is not None
        return self._worked_out

    @cached_property
    def team(self) -> tuple[str, ...]:
        """The robots that can get work now, in a fixed order."""
        return tuple(sorted(robot for robot in self.robots if robot in self.available))

    def things_at(self, carrier: str) -> tuple[str, ...]:
        """Things that are believed to be carried by it directly."""
        return self._things_at.get(carrier, ())

    @cached_property
    def _things_at(self) -> dict[Value, tuple[str, ...]]:
        found: dict[Value, tuple[str, ...]] = {}
        for thing in self.objects:
            carrier = self.facts.get(FactKey(AT, thing))
            found[carrier] = (*found.get(carrier, ()), thing)
        return found

    @cached_property
    def _hopeless(self) -> dict[Call, Hopeless]:
        return {call_of(known.skill, known.args): known for known in self.hopeless}

    def ways_open(self, robot: str) -> object:
        """What sets a robot's ways apart from those of others of its kind: the closures that it is
        kept back by, or the places that they leave it; `None` if nothing is closed to it."""
        closed, here = self._shut(robot), self.value(AT, robot)
        if not closed:
            return None
        if not isinstance(here, str) or here not in self.places:
            return closed
        return frozenset(self._open_m(robot, here))

    def capability(self, robot: str, name: str) -> float | None:
        """The parameter of a robot's capability, or `None` if it lacks it."""
        return self.robots[robot].offers.get(name)

    def failed_at(self, skill: str, args: Mapping[str, str]) -> Hopeless | None:
        """That a call is not to be tried again."""
        return self._hopeless.get(call_of(skill, args)) if self.hopeless else None

    def kept_from(self, robot: str, target: str) -> str | None:
        """Why closures keep a robot from a place; `None` if they do not."""
        closed = self.kept_by(robot, target)
        because = "; ".join(map(str, closed))
        return f"{robot} does not get to {target}: {because}" if closed else None

    def kept_by(self, robot: str, target: str) -> tuple[Closure, ...]:
        """The closures that keep a robot from a place; none if they do not.

        From where it stands, or if nobody knows where that is, from anywhere.
        """
        closed = self._shut(robot)
        here = self.value(AT, robot)
        if not closed or target not in self.places or here == target:
            return ()
        if on_target := tuple(closure for closure in closed if target in closure.names):
            return on_target
        if not isinstance(here, str) or here not in self.places:
            return ()
        return () if target in self._open_m(robot, here) else closed

    def _shut(self, robot: str) -> tuple[Closure, ...]:
        return shut(self.closures, self.robots[robot].model) if self.closures else ()

    def _open_m(self, robot: str, origin: str) -> dict[str, float]:
        """Driven distances [m] from a place, by ways that are open to a robot."""
        key, known = (self.robots[robot].model, origin), self._known.open_m
        if key not in known:
            names = {name for closure in self._shut(robot) for name in closure.names}
            known[key] = open_ways_m(self.places, names, origin)
        return known[key]

    def measure(self, what: str, name: str) -> float:
        """The mass of an object [kg], or the height of the highest surface in a place [m]."""
        if what == "mass":
            return self.objects[name].mass_kg if name in self.objects else 0.0
        place = self.places.get(name)
        return max((surface.z_m for surface in place.surfaces), default=0.0) if place else 0.0

    def work_s(self, robot: str, skill: SkillModel) -> float:
        """Seconds that a skill takes a robot, without the way to it; to charge, from the reserve
        on."""
        battery = self.robots[robot].battery if robot in self.robots else None
        if battery is not None and skill.recharges:
            return skill.duration_s + battery.charging_s(battery.reserve_percent)
        return work_s(self._durations(robot), skill)

    def duration_s(self, action: Action, origin: Value, robot: str) -> float:
        """Seconds that a robot takes for an action, travel from `origin` to it included.

        None to get where it is already. At a charger that is taken it waits for as long as that is
        still so when it comes from where it is now.
        """
        to = action.skill.travel_to
        if to is not None and origin == action.args[to] and only_moves(action.skill):
            return 0.0
        travel_s = 0.0 if to is None else self.travel_s(robot, origin, action.args[to])
        if self.taken_s and action.skill.recharges:
            taken_s = max(self.taken_s.get(name, 0.0) for name in action.args.values())
            way_s = self.travel_s(robot, self.value(AT, robot), str(action.place))
            travel_s += max(0.0, taken_s - way_s)
        return self.work_s(robot, action.skill) + travel_s

    def travel_s(self, robot: str, origin: Value, target: str) -> float:
        """Seconds that a robot takes from one place to another; from anywhere if unknown."""
        key, known = (robot, origin, target), self._known.travels_s
        if key not in known:
            known[key] = pace(self._durations(robot)) * self.way_s(robot, origin, target)
        return known[key]

    def way_s(self, robot: str, origin: Value, target: str) -> float:
        """Seconds from one place to another at a robot's top speed; from anywhere if unknown."""
        speed = self.capability(robot, "drive") or TRAVEL_SPEED_M_S
        place = self.places.get(target)
        if place is None or origin == target:
            return 0.0
        if isinstance(origin, str) and origin in self.places:
            metres = self.places[origin].travel_m.get(target, UNKNOWN_TRAVEL_M)
            if self._shut(robot):  # around what is closed, where there is a way
                metres = self._open_m(robot, origin).get(target, metres)
        else:
            known = place.travel_m.values()
            metres = sum(known) / len(known) if known else UNKNOWN_TRAVEL_M
        return metres / speed

    def _durations(self, robot: str) -> Durations | None:
        spec = self.robots.get(robot)
        return None if spec is None else self.durations.get(spec.model)

    def holds(self, condition: Condition) -> bool:
        """Whether the facts say that the condition holds."""
        return condition_holds(self.facts, condition, self)

    def with_facts(self, facts: Mapping[FactKey, Value]) -> WorldModel:
        """The same world with some facts changed."""
        return replace(self, facts={**self.facts, **facts})


def condition_holds(facts: Mapping[FactKey, Value], condition: Condition, world: Inventory) -> bool:
    """Whether a goal's condition holds in `facts`; of several subjects one is enough, and where it
    is negated none may.

    `fleet.core.model.derived` says what that means for where things are.
    """
    found = any(holds(each, facts.get, world, aboard=True) for each in condition.literals)
    return found is not condition.negated


def known_value(variable: FactKey, facts: Mapping[FactKey, Value], world: WorldModel) -> Value:
    """The value of a variable in `facts`; the hand of a robot that has none holds nothing, and what
    does not move is where it belongs."""
    value = facts.get(variable)
    if value is None and variable.relation == AT:
        return stays_at(variable.subject, world)
    if value is None and variable.relation == HOLDING and variable.subject in world.robots:
        return None if world.capability(variable.subject, "grip") else NOTHING
    return value


def room_left(carrier: str, facts: Mapping[FactKey, Value], world: WorldModel) -> float:
    """How many more objects go on or into a thing, or into a robot's basket, where all is that its
    hand does not hold."""
    if (room := capacity(carrier, world)) == inf:
        return inf
    held = facts.get(FactKey(HOLDING, carrier))
    if facts is world.facts:
        there = world.things_at(carrier)
    else:
        there = tuple(t for t in world.objects if facts.get(FactKey(AT, t)) == carrier)
    return room - sum(1 for thing in there if thing != held)


def capacity(carrier: str, world: WorldModel) -> float:
    """How many objects a thing, or a robot's basket, takes; without a limit infinitely many."""
    if (thing := world.objects.get(carrier)) is not None:
        return inf if thing.room is None else thing.room
    return int(world.capability(carrier, "basket") or 0)
