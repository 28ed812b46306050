"""What an actor needs of the robot that will be it, and which robots can be it."""

from __future__ import annotations

from dataclasses import dataclass, field

from fleet.core.skills import Action, Variable
from fleet.core.world_model import WorldModel, known_value, room_left
from keyexpr_schema.world import Value


@dataclass
class Requirement:
    """What a robot must bring to be an actor: roles to fill, facts that hold of it at the start."""

    roles: list[tuple[Action, str]] = field(default_factory=list)
    facts: dict[str, tuple[Value, str]] = field(default_factory=dict)
    """By relation: the value needed, and the task that needs it first."""
    valued: dict[Variable, str] = field(default_factory=dict)
    """Variables whose value at the start must be this robot, and the task that needs it first."""
    space: int = 0
    """Room needed in its basket, in objects."""
    pinned_to: str | None = None


def eligible(requirement: Requirement, world: WorldModel) -> tuple[dict[str, None], list[str]]:
    """Robots of the team that can be an actor (as an ordered set), and why each other cannot."""
    able: dict[str, None] = {}
    reasons: list[str] = []
    for robot in world.team:
        reason = _why_not(robot, requirement, world)
        if reason is None:
            able[robot] = None
        else:
            reasons.append(reason)
    return able, reasons


def _why_not(robot: str, requirement: Requirement, world: WorldModel) -> str | None:
    if requirement.pinned_to not in (None, robot):
        return f"the plan wants {requirement.pinned_to} and not {robot}"
    for action, parameter in requirement.roles:
        if reason := world.lacks(robot, action, parameter):
            return reason
    for relation, (value, task) in requirement.facts.items():
        has = known_value(Variable(relation, robot), world.facts, world)
        if has != value:
            told = "unknown" if has is None else has
            return f"{task} needs {relation}({robot}) = {value}, and it is {told}"
    for variable, task in requirement.valued.items():
        if (has := known_value(variable, world.facts, world)) != robot:
            return f"{task} needs {variable} = {robot}, and it is {has}"
    if requirement.space > 0:
        room = room_left(robot, world.facts, world)
        if room < requirement.space:
            return f"{robot}'s basket has room for {room} more and {requirement.space} are needed"
    return None
