"""Whether a robot can have a part in an action at all: by its skills and capabilities, by what it
is not to try again, by closures, and by its battery."""

from __future__ import annotations

from fleet.core.model.endurance import all_last, first_short, lasts
from fleet.core.model.energy import left_wh
from fleet.core.model.shortfall import Shortfall
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT


def lacks(world: WorldModel, robot: str, action: Action, parameter: str) -> str | None:
    """Why a robot cannot stand for a robot `parameter` of the action, or `None` if it can."""
    why = unable(world, robot, action, parameter)
    if why is None and parameter == action.skill.actor_parameter:
        short = first_short(world, robot, (("", action),))
        return None if short is None else short.sentence
    return why


def unable(world: WorldModel, robot: str, action: Action, parameter: str) -> str | None:
    """The same, its battery aside."""
    spec, skill = world.robots[robot], action.skill
    if parameter == skill.actor_parameter:
        for name in skill.uses or (skill.name,):
            if name not in spec.skills:
                return f"{robot} does not have the skill {name}"
        if (known := world.failed_at(skill.name, {**action.args, parameter: robot})) is not None:
            return f"{robot} has failed at it, and would again: {known.reason}"
        to = skill.travel_to
        if to is not None and (why := world.kept_from(robot, action.args[to])) is not None:
            return why
    for need in skill.needs.get(parameter, ()):
        has = spec.offers.get(need.capability)
        if has is None:
            return f"{robot} has no {need.capability}"
        if need.measure is not None and need.of is not None:
            thing = action.args[need.of]
            least = world.measure(need.measure, thing)
            if least > has:
                return Shortfall(thing, need.measure, least, need.capability, {robot: has})
    return None


def is_particular(world: WorldModel, skill: SkillModel) -> bool:
    """Whether it depends on all that a call is about whether a robot can do it."""
    closed = bool(world.closures) and skill.travel_to is not None
    failed = any(known.skill == skill.name for known in world.hopeless)
    return closed or failed or not all_last(world)


def mark(world: WorldModel, robot: str) -> object:
    """What sets a robot apart from others of its kind; `None` if nothing does: that it is not to
    try something again, does not get everywhere, or has too small a battery for some things."""
    if any(known.robot == robot for known in world.hopeless):
        return robot
    ways = world.ways_open(robot)
    if lasts(world, robot):
        return ways
    return ways, world.value(AT, robot), left_wh(world, robot)
