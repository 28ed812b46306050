"""The world as a lower bound sees it: robots of one class are one, and what is left open is free.

A class stands wherever any of its robots does, gets along by the quickest way over any places, and
takes a skill's time at the least. Effects that depend on something may always come about.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from itertools import product
from math import inf
from typing import NamedTuple

from fleet.core.model import derived
from fleet.core.model.skills import SkillModel
from fleet.core.model.world import WorldModel
from fleet.planners.symbolic.engine.relevance import Row, rows_of
from fleet.planners.symbolic.engine.travel import Travel, can_be_put_off
from keyexpr_schema.facts import AT, HOLDING, NOTHING, FactKey, Literal, Value

ANYTHING = "?thing"
"""As a value: any thing, it is not looked at which."""
Binding = dict[str, str]


class Step(NamedTuple):
    """A way to make a literal true: an effect of a skill with some of its parameters."""

    row: Row
    binding: Binding


class RelaxedWorld:
    """`members` are robots by the one that stands for their class; `rows` effects by relation."""

    def __init__(self, world: WorldModel) -> None:
        self.world = world
        self.members: dict[str, list[str]] = defaultdict(list)
        first: dict[object, str] = {}
        for robot in world.team:
            spec = world.robots[robot]
            key = spec.model, spec.skills, tuple(sorted(spec.offers.items()))
            self.members[first.setdefault(key, robot)].append(robot)
        self._travel = Travel(world, dict(world.facts))
        self._free = self._travel.free(self.members)
        self._ways: dict[tuple[str, str], Mapping[str, float]] = {}
        self._moved: dict[str, bool] = {}
        self._now: dict[str, tuple[str, ...]] = {}
        self.rows: dict[str, list[Row]] = defaultdict(list)
        self.loose_s: dict[str, float] = {}
        """By relation: the quickest skill of which it is open what it makes of that [s]."""
        self._jump_s = inf
        """The quickest skill that is no drive and leaves a robot somewhere."""
        for row in (row for skill in world.skills.values() for row in rows_of(skill)):
            if can_be_put_off(row.skill):
                continue
            quickest_s = self.quickest_s(row.skill)
            if row.skill.conditional:
                self.loose_s[row.relation] = min(self.loose_s.get(row.relation, inf), quickest_s)
            if not row.adds and not row.each:
                self.rows[row.relation].append(row)
            if row.relation == AT and row.kind_of(row.variable.subject) == "robot":
                self._jump_s = min(self._jump_s, quickest_s)

    @cached_property
    def hands(self) -> int:
        """How many robots can do anything with things."""
        rows = (row for rows in self.rows.values() for row in rows)
        handling = {row.skill.name for row in rows if thing_of(row) is not None}
        robots = self.world.team
        return sum(not handling.isdisjoint(self.world.robots[robot].skills) for robot in robots)

    @cached_property
    def hands_put(self) -> bool:
        """Whether a hand never lets go of something without changing where that is."""
        return all(
            any(other.relation == AT and thing_of(other) for other in rows_of(row.skill))
            for row in self.rows[HOLDING]
            if row.value == NOTHING
        )

    def quickest_s(self, skill: SkillModel) -> float:
        """What the skill takes the quickest robot that has it, without ways [s]."""
        able = (r for r in self.members if skill.name in self.world.robots[r].skills)
        return min((self.world.work_s(robot, skill) for robot in able), default=inf)

    # Where robots get to.

    def approach_s(self, robot: str, place: str) -> float:
        """From where the nearest robot of the class stands; nothing where that is unknown [s]."""
        where = (self.world.value(AT, member) for member in self.members[robot])
        return min(
            self.way_s(robot, str(here), place) if here in self.world.places else 0.0
            for here in where
        )

    def way_s(self, robot: str, origin: str, target: str) -> float:
        """By the quickest way over any other places [s]; nothing for who does not drive freely."""
        if origin == target or robot not in self._free or target not in self.world.places:
            return 0.0
        key = robot, origin
        if key not in self._ways:
            self._ways[key] = self._ways_from(robot, origin)
        return min(self._ways[key][target], self._jump_s)

    def _ways_from(self, robot: str, origin: str) -> Mapping[str, float]:
        """The quickest ways to all places (Dijkstra 1959); within a place there is none to go."""
        leg_s, left = self._travel.way_s, set(self.world.places)
        found_s = dict.fromkeys(left, inf) | {origin: 0.0}
        while left:
            here = min(left, key=found_s.__getitem__)
            left.remove(here)
            near = self._together[here]
            for place in left:
                further_s = 0.0 if place in near else leg_s[robot, here, place]
                found_s[place] = min(found_s[place], found_s[here] + further_s)
        return found_s

    @cached_property
    def _together(self) -> Mapping[str, set[str]]:
        """Places that are part of a place, or that it is part of."""
        return {
            place: {*self.places_in(place), *self._around(place)} for place in self.world.places
        }

    def places_in(self, place: str) -> tuple[str, ...]:
        """A place and all places that are part of it."""
        return tuple(name for name in self.world.places if place in self._around(name))

    def _around(self, place: str) -> Iterator[str]:
        seen: set[str] = set()
        here: str | None = place
        while here is not None and here not in seen:
            yield here
            seen.add(here)
            known = self.world.places.get(here)
            here = None if known is None else known.part_of

    # What holds, and what can make it so.

    def holds(self, literal: Literal) -> bool:
        """Whether it holds, of any of the robots that count as one."""
        (relation, subject), value = literal
        facts = self.world.facts.get
        subjects = self.members.get(subject, [subject])
        values = self.members.get(value, [value]) if isinstance(value, str) else [value]
        return any(
            derived.holds(Literal(FactKey(relation, s), v), facts, self.world)
            for s, v in product(subjects, values)
        )

    def comes_along(self, thing: str) -> bool:
        """Whether it is with a robot or on a thing that can be moved, or may be anywhere."""
        facts = self.world.facts.get
        around = derived.carriers(thing, facts, self.world, aboard=True)
        return not derived.is_located(thing, facts, self.world) or any(
            name in self.world.robots or self.moves(name) for name in around
        )

    def _around_now(self, name: str) -> tuple[str, ...]:
        if name not in self.world.objects:
            return ()
        if name not in self._now:
            self._now[name] = tuple(derived.carriers(name, self.world.facts.get, self.world))
        return self._now[name]

    def moves(self, name: str) -> bool:
        """Whether anything can change where a thing is."""
        if name not in self._moved:
            kinds = (row.kind_of(row.variable.subject) for row in self.rows[AT])
            self._moved[name] = name in self.world.objects and any(
                kind is not None and self._fits(kind, name) for kind in kinds
            )
        return self._moved[name]

    def steps(self, literal: Literal) -> Iterator[Step]:
        """The effects that make a literal true, with the parameters that this fixes."""
        (relation, subject), value = literal
        for row in self.rows[relation]:
            binding: Binding = {}
            terms = ((row.variable.subject, subject), (row.value, value))
            if all(self._unified(row, term, name, binding) for term, name in terms):
                yield Step(row, binding)

    def _unified(self, row: Row, term: Value, name: Value, binding: Binding) -> bool:
        kind = row.kind_of(term)
        if kind is None:
            return term == name
        if name == ANYTHING:
            return kind not in ("robot", "place")
        if not isinstance(name, str) or not self._fits(kind, name):
            return False
        return binding.setdefault(str(term), name) == name

    def filled(self, skill: SkillModel, binding: Binding) -> Iterator[Binding]:
        """With every class of robots that is able, and every place where they may stand; things
        are left open."""
        stood_in = {
            value
            for (relation, subject), value in skill.before
            if relation == AT and subject in skill.robot_parameters
        }
        # Where its things are now is the likeliest: what is found first rules out most others.
        here = {place for name in binding.values() for place in self._around_now(name)}
        names: dict[str, Iterable[str]] = {}
        for name, kind in skill.parameters.items():
            if name in binding:
                names[name] = (binding[name],)
            elif kind == "robot":
                names[name] = self.members
            elif kind == "place" and name in stood_in:
                names[name] = sorted(self.world.places, key=lambda p: p not in here)
        for values in product(*names.values()):
            made = dict(zip(names, values, strict=True))
            if all(self._able(skill, name, made) for name in skill.robot_parameters):
                yield made

    def _able(self, skill: SkillModel, parameter: str, binding: Binding) -> bool:
        spec = self.world.robots[binding[parameter]]
        if parameter == skill.actor_parameter and skill.name not in spec.skills:
            return False
        for need in skill.needs.get(parameter, ()):
            has = spec.offers.get(need.capability)
            if has is None:
                return False
            if need.measure is None or need.of not in binding:
                continue
            if self.world.measure(need.measure, binding[str(need.of)]) > has:
                return False
        return True

    def _fits(self, kind: str, name: str) -> bool:
        return name in self.members if kind == "robot" else name in self.world.of_type(kind)


def thing_of(row: Row) -> str | None:
    """The parameter for the thing that a row of effects is about, if it is about one."""
    term: Value = row.value if row.relation == HOLDING else row.variable.subject
    return str(term) if row.kind_of(term) not in (None, "robot", "place") else None


def takes(row: Row) -> bool:
    """Whether a hand holds the thing afterwards that the row is about."""
    return any(
        other.relation == HOLDING and other.value == thing_of(row) for other in rows_of(row.skill)
    )
