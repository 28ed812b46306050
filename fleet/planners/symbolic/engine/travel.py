"""Navigation folded into costs: a robot that can drive is wherever an action needs it.

A skill that does nothing but change where its robot is, and asks for nothing, can be put off until
the robot must be somewhere. So the search has no drives as steps of their own: each step comes with
those that it needs, and what they cost.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import cache
from math import inf

from fleet.core.model.eligibility import lacks
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, FactKey, Value

Moves = dict[str, str]
"""Robots, and the places that they have to be in."""


def can_be_put_off(skill: SkillModel) -> bool:
    """Whether a skill does nothing but get its robot to a place, and can be done at any time."""
    asks = skill.before or skill.conditions or skill.space_in
    return skill.moves_to is not None and not asks and len(skill.parameters) == 2


class _Ways(dict[tuple[str, Value, str], float]):
    """Costs of ways that were asked for."""

    def __init__(self, way_s: Callable[[str, Value, str], float]) -> None:
        super().__init__()
        self._way_s = way_s

    def __missing__(self, key: tuple[str, Value, str]) -> float:
        self[key] = found = self._way_s(*key)
        return found


class Travel:
    """What it takes each robot to get from one place to another, by the best skill for it.

    `way_s[robot, origin, target]` is in seconds, charges included; nothing where it is there
    already. With no `origin` it is open where the robot begins: it has to be sent, from where it
    stands.
    """

    def __init__(self, world: WorldModel, facts: dict[FactKey, Value]) -> None:
        self._world = world
        self._facts = facts
        self._skills = [skill for skill in world.skills.values() if can_be_put_off(skill)]
        self.charges_s: dict[tuple[str, str], float] = {}
        """What a robot's way to a place costs more."""
        self.way_s = _Ways(self._way_s)
        self.action = cache(self._action)
        self.time_s = cache(self._time_s)

    def free(self, robots: Collection[str]) -> frozenset[str]:
        """Those robots that can drive."""
        return frozenset(
            robot
            for robot in robots
            if any(self.action(robot, place) is not None for place in self._world.places)
        )

    def charge(self, robot: str, place: str, charge_s: float) -> None:
        """Make a robot's way to a place cost so much more."""
        self.charges_s[robot, place] = self.charges_s.get((robot, place), 0.0) + charge_s
        self.way_s.clear()

    def _way_s(self, robot: str, origin: Value, target: str) -> float:
        if origin == target:
            return 0.0
        return self.time_s(robot, origin, target) + self.charges_s.get((robot, target), 0.0)

    def _time_s(self, robot: str, origin: Value, target: str) -> float:
        action = self.action(robot, target)
        if action is None:
            return inf
        stands = origin or self._facts.get(FactKey(AT, robot))
        return self._world.duration_s(action, stands, robot)

    def _action(self, robot: str, target: str) -> Action | None:
        """The quickest skill of a robot that leads to a place; `None` if none does."""
        found: list[tuple[float, str, Action]] = []
        for skill in self._skills:
            if not self._world.is_of_type(target, skill.types[str(skill.moves_to)]):
                continue
            action = skill.ground({skill.actor_parameter: robot, str(skill.moves_to): target})
            if lacks(self._world, robot, action, skill.actor_parameter) is None:
                found.append((self._world.work_s(robot, skill), skill.name, action))
        return min(found, key=lambda row: row[:2])[2] if found else None
