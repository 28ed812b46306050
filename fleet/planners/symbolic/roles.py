"""Roles: what each robot of an action sequence has to be, does, and is left with.

A sequence is found with certain robots; whoever is able, and is as the sequence takes its robot to
be, can stand in for one of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fleet.core.model.eligibility import is_particular, lacks
from fleet.core.model.formulas.text import formula_text
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from fleet.planners.deordering import ActionSequence
from keyexpr_schema.facts import AT, HOLDING, FactKey, Value


class Part(NamedTuple):
    """A robot of a sequence: robots of different parts of a joined one are different."""

    robot: str
    part: int


@dataclass(frozen=True)
class Role:
    """One robot of a sequence; `able` are those that could stand in for it.

    `needs` are relations that must have a value of it at the start, and `brings` are things that
    must be with it. `loads` is the most that is in its basket at a time, of what the sequence
    moves, and `leaves` what of it is there in the end.
    """

    who: Part
    able: frozenset[str]
    needs: Mapping[str, Value]
    brings: frozenset[str]
    loads: int
    leaves: frozenset[str]
    starts_at: str | None
    """Where its first way leads, if that is what it begins with."""
    particular: bool
    """Whether a formula speaks of the robot, so that others need not do."""


@dataclass(frozen=True)
class Step:
    """An action, and whose roles its participants are."""

    action: Action
    parts: tuple[Part, ...]


class Roles:
    """Tells the roles of sequences; what was found out of one is kept."""

    def __init__(self, world: WorldModel) -> None:
        self._world = world
        self._able: dict[object, frozenset[str]] = {}
        self._known: dict[int, tuple[ActionSequence, tuple[Role, ...]]] = {}

    def of(self, sequence: ActionSequence) -> tuple[Role, ...]:
        """Its roles, in the order in which they take part."""
        if id(sequence) not in self._known:
            self._known[id(sequence)] = sequence, tuple(self._roles(sequence))
        return self._known[id(sequence)][1]

    def _roles(self, sequence: ActionSequence) -> Iterator[Role]:
        rows = list(steps(sequence))
        for who in dict.fromkeys(part for step in rows for part in step.parts):
            mine = [step for step in rows if who in step.parts]
            particular = any(
                who.robot in re.findall(r"\w+", formula_text(formula))
                for step in mine
                for formula in step.action.conditions
            )
            able = self._able_robots(who, mine, sequence)
            yield Role(who, able, *_states(who, rows, mine), particular)

    def _able_robots(
        self, who: Part, mine: Iterable[Step], sequence: ActionSequence
    ) -> frozenset[str]:
        if who.robot in sequence.named:
            return frozenset({who.robot})
        able: frozenset[str] | None = None
        for step in mine:
            skill = step.action.skill
            parameter = skill.robot_parameters[step.parts.index(who)]
            one = self._able_for(step.action, parameter)
            able = one if able is None else able & one
        return able or frozenset()

    def _able_for(self, action: Action, parameter: str) -> frozenset[str]:
        """Asked once of actions that ask the same of their robot."""
        world, skill = self._world, action.skill
        needs = skill.needs.get(parameter, ())
        measured = (
            world.measure(need.measure, action.args[need.of])
            for need in needs
            if need.measure is not None and need.of is not None
        )
        key: tuple[object, ...] = skill.name, parameter, *measured
        if is_particular(world, skill):
            key = *key, *sorted(action.args.items())
        if key not in self._able:
            rows = (r for r in world.team if not lacks(world, r, action, parameter))
            self._able[key] = frozenset(rows)
        return self._able[key]


def steps(sequence: ActionSequence) -> Iterator[Step]:
    """Its actions, with the roles of their participants."""
    for action, origin in sequence.with_origins:
        yield Step(
            action,
            tuple(
                Part(robot, 0 if robot in sequence.shared else origin.part)
                for robot in action.participants
            ),
        )


def _states(
    who: Part, rows: Sequence[Step], mine: Sequence[Step]
) -> tuple[dict[str, Value], frozenset[str], int, frozenset[str], str | None]:
    """What the role needs and brings, loads and leaves, and where it begins."""
    needs: dict[str, Value] = {}
    brings: set[str] = set()
    written: set[FactKey] = set()
    here: set[str] = set()
    held: Value = None
    most = 0
    for step in rows:
        action = step.action
        is_mine = who in step.parts
        for (relation, subject), value in action.before:
            if FactKey(relation, subject) in written:
                continue
            if is_mine and subject == who.robot:
                needs.setdefault(relation, value)
            elif is_mine and relation == AT and value == who.robot:
                brings.add(subject)
                here.add(subject)
        for (relation, subject), value in action.after:
            if is_mine or subject != who.robot:
                written.add(FactKey(relation, subject))
            if is_mine and subject == who.robot and relation == HOLDING:
                held = value
            if relation == AT and subject != who.robot:
                here.discard(subject)
                if is_mine and value == who.robot:
                    here.add(subject)
        most = max(most, len(here - {held}))
    first = mine[0].action
    to = first.skill.travel_to
    starts_at = first.args[to] if to is not None and first.actor == who.robot else None
    return needs, frozenset(brings), most, frozenset(here - {held}), starts_at
