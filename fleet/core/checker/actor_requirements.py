"""What an actor needs of the robot that will be it, and which robots can be it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import dataclass, field
from typing import NamedTuple

from fleet.core.model.derived import holds
from fleet.core.model.eligibility import is_particular, mark, unable
from fleet.core.model.endurance import first_short
from fleet.core.model.formulas.nodes import Formula, grounded
from fleet.core.model.formulas.text import formula_text
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel, known_value, room_left
from keyexpr_schema.facts import FactKey, Literal, Value, render_value

Left = tuple[str, Value]
"""A relation and its value, as an actor leaves them of its robot."""


class Asked(NamedTuple):
    """A formula before a task about one actor, decided by what `relations` are of its robot at the
    start: `holds` says whether it does in every order."""

    formula: Formula
    task: str
    actor: str
    relations: tuple[str, ...]
    holds: Callable[[Asked, Mapping[str, Value]], bool]


@dataclass
class Requirement:
    """What a robot must bring to be an actor: roles to fill, facts that hold of it at the start."""

    roles: list[tuple[Action, str]] = field(default_factory=list)
    tasks: list[tuple[str, Action]] = field(default_factory=list)
    """What it does itself, by task, in an order of the plan's."""
    facts: dict[str, tuple[Value, str]] = field(default_factory=dict)
    """By relation: the value needed, and the task that needs it first."""
    valued: dict[FactKey, str] = field(default_factory=dict)
    """Variables whose value at the start must be this robot, and the task that needs it first."""
    asked: list[Asked] = field(default_factory=list)
    """Formulas that hold or not by which robot it is."""
    space: int = 0
    """Room needed in its basket, in objects."""
    pinned_to: str | None = None
    among: frozenset[str] | None = None
    """The robots that may be the actor at all, where goals say so."""


class _Asks(NamedTuple):
    """Which list of robots comes into question for an actor, and what must hold of its robot."""

    fitting: int
    facts: frozenset[Left]


class Candidates:
    """Which robots of the team can be which actors.

    A robot can be an actor if it can play its roles, and if what the actor needs of it holds now or
    is left so by another actor that the robot can be first: a robot with a full hand can pick once
    it has put down what it carries. That goes for states such as an empty hand, not for things and
    places: what one actor picked, another one cannot count on holding. Whether the robot really
    becomes that other actor, the check of the allocated plan has to say.
    """

    def __init__(
        self,
        requirements: Mapping[str, Requirement],
        leaves: Mapping[str, Set[Left]],
        world: WorldModel,
    ) -> None:
        """`leaves` has for every actor the facts that it leaves of its robot."""
        self._requirements, self._world = requirements, world
        self._batteries = any(world.robots[robot].battery is not None for robot in world.team)
        alike: dict[object, list[str]] = {}
        for robot in world.team:
            spec = world.robots[robot]
            kind = spec.skills, tuple(spec.offers.items()), spec.battery, mark(world, robot)
            alike.setdefault(kind, []).append(robot)
        self._kinds = list(alike.values())
        self._room: dict[str, float] = {}
        self._answers: dict[tuple[Asked, tuple[Value, ...]], bool] = {}
        self._playable: dict[tuple[object, ...], list[str]] = {}
        fitting = {actor: self._fitting(each) for actor, each in requirements.items()}
        asks = {
            actor: _Asks(
                id(fitting[actor]),
                frozenset((name, row[0]) for name, row in each.facts.items()),
            )
            for actor, each in requirements.items()
        }
        first = {asked: actor for actor, asked in reversed(asks.items())}
        """What many actors ask alike is answered once."""
        unmet = {
            asked: {
                robot: list(self._unmet(robot, requirements[actor])) for robot in fitting[actor]
            }
            for asked, actor in first.items()
        }
        offered: dict[str, set[Left]] = {robot: set() for robot in world.team}
        for asked, left in {(asks[actor], frozenset(leaves.get(actor, ()))) for actor in asks}:
            states = {
                (relation, value)
                for relation, value in left
                if not isinstance(value, str) or world.kind_of(value) is None
            }
            for robot, missing in unmet[asked].items() if states else ():
                if not missing:
                    offered[robot] |= states
        able = {
            asked: tuple(
                robot
                for robot, missing in rows.items()
                if all(
                    (name, value) in offered[robot]
                    for name, value in asked.facts
                    if name in missing
                )
            )
            for asked, rows in unmet.items()
        }
        self.able: dict[str, tuple[str, ...]] = {actor: able[asks[actor]] for actor in asks}

    def reasons(self, actor: str) -> Iterator[str]:
        """Why each robot of the team that cannot be the actor cannot."""
        requirement = self._requirements[actor]
        among = requirement.among
        team = self._world.team if among is None else sorted(among)
        for robot in team:
            if robot in self.able[actor]:
                continue
            if robot not in self._world.available:
                yield f"{robot}, who shall do it, is not connected"
                continue
            if (reason := self._unfit(robot, requirement)) is not None:
                yield reason
                continue
            for relation in self._unmet(robot, requirement):
                value, task = requirement.facts[relation]
                has = known_value(FactKey(relation, robot), self._world.facts, self._world)
                needed = Literal(FactKey(relation, robot), value)
                yield f"{task} needs {needed}, and it is {render_value(has)}"
                break

    def _fitting(self, requirement: Requirement) -> list[str]:
        """Robots that could be the actor, if all else were as it needs it."""
        able = self._able_to_play(requirement)
        if requirement.pinned_to is not None:
            able = [requirement.pinned_to] if requirement.pinned_to in able else []
        if requirement.among is not None:
            able = [robot for robot in able if robot in requirement.among]
        if self._batteries:
            fit = [r for r in able if first_short(self._world, r, requirement.tasks) is None]
            able = able if len(fit) == len(able) else fit
        if requirement.valued or requirement.asked or requirement.space > 0:
            able = [robot for robot in able if self._unfit(robot, requirement) is None]
        return able

    def _able_to_play(self, requirement: Requirement) -> list[str]:
        """Asked once of robots that are alike, for roles that ask the same of them."""
        key = tuple(self._asks(action, parameter) for action, parameter in requirement.roles)
        if key not in self._playable:
            able = {
                robot
                for kind in self._kinds
                if not any(unable(self._world, kind[0], *role) for role in requirement.roles)
                for robot in kind
            }
            self._playable[key] = [robot for robot in self._world.team if robot in able]
        return self._playable[key]

    def _asks(self, action: Action, parameter: str) -> tuple[object, ...]:
        measured = (
            self._world.measure(need.measure, action.args[need.of])
            for need in action.skill.needs.get(parameter, ())
            if need.measure is not None and need.of is not None
        )
        if is_particular(self._world, action.skill):
            return action.skill.name, parameter, *sorted(action.args.items())
        return action.skill.name, parameter, *measured

    def _unfit(self, robot: str, requirement: Requirement) -> str | None:
        """Why the robot could not be the actor whatever had happened before."""
        if requirement.pinned_to not in (None, robot):
            return f"the plan wants {requirement.pinned_to} and not {robot}"
        for action, parameter in requirement.roles:
            if reason := unable(self._world, robot, action, parameter):
                return reason
        if (short := first_short(self._world, robot, requirement.tasks)) is not None:
            return short.sentence
        for variable, task in requirement.valued.items():
            if (has := known_value(variable, self._world.facts, self._world)) != robot:
                return f"{task} needs {variable} = {robot}, and it is {has}"
        for asked in requirement.asked:
            if not self._is_answered(asked, robot):
                formula = formula_text(grounded(asked.formula, {asked.actor: robot}))
                return f"{asked.task} needs {formula}, which need not hold"
        if requirement.space > 0:
            if robot not in self._room:
                self._room[robot] = room_left(robot, self._world.facts, self._world)
            room = self._room[robot]
            if room < requirement.space:
                needed = f"{requirement.space} are needed"
                return f"{robot}'s basket has room for {room} more and {needed}"
        return None

    def _is_answered(self, asked: Asked, robot: str) -> bool:
        values = {name: self._value_of(FactKey(name, robot)) for name in asked.relations}
        key = asked, tuple(values.values())
        if key not in self._answers:
            self._answers[key] = asked.holds(asked, values)
        return self._answers[key]

    def _unmet(self, robot: str, requirement: Requirement) -> Iterator[str]:
        """Relations that do not hold of the robot now as the actor needs them."""
        for relation, (value, _) in requirement.facts.items():
            if not holds(Literal(FactKey(relation, robot), value), self._value_of, self._world):
                yield relation

    def _value_of(self, variable: FactKey) -> Value:
        return known_value(variable, self._world.facts, self._world)
