"""Whether a robot's battery is enough for what it is to do.

Between any two tasks a robot can be sent to charge. So where it can, a task is too much for it
only if neither what is left nor a full battery, with the way from a charger, is enough for it and
for the way to one; where it cannot, what is left has to do for all of its tasks.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

from fleet.core.model.energy import (
    QUEUEING,
    TRAFFIC,
    battery_of,
    chargings,
    drive_s,
    energy_wh,
    full_wh,
    left_wh,
    needs_wh,
    place_after,
    to_charger_wh,
)
from fleet.core.model.skills import Action
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, Value


def shortfall(
    world: WorldModel, robot: str, action: Action, origin: Value, has_wh: float | None = None
) -> str | None:
    """Why a robot's charge, or one of `has_wh`, is not enough for an action and for the way to a
    charger after it, in a sentence; `None`: it is."""
    has_wh = left_wh(world, robot) if has_wh is None else has_wh
    if has_wh is None:
        return None
    battery = battery_of(world, robot)
    assert battery is not None
    needs_wh = energy_wh(world, action, origin, robot)
    back_wh = to_charger_wh(world, robot, place_after(action, origin))
    back_wh += QUEUEING * battery.reserve_wh if chargings(world, robot) else 0.0
    if needs_wh + back_wh <= has_wh:
        return None
    return short_of(robot, has_wh, action.skill.name, needs_wh, back_wh)


class Short(NamedTuple):
    """That a robot's battery is not enough for a task, with a sentence that says so."""

    task: str
    sentence: str


def first_short(
    world: WorldModel, robot: str, actions: Sequence[tuple[str, Action]]
) -> Short | None:
    """The first of a robot's tasks, in their order, that its battery is not enough for though it
    charges between them wherever it can; `None`: it is enough for all. `actions` are by task, of
    one that has no name yet by ""."""
    battery = battery_of(world, robot)
    if battery is None or _is_ample(world, robot, actions):
        return None
    ways, full, left = chargings(world, robot), full_wh(battery), left_wh(world, robot) or 0.0
    kept = QUEUEING * battery.reserve_wh if ways else 0.0
    here = world.value(AT, robot)
    for task, action in actions:
        name = f"{task} ({action.skill.name})" if task else action.skill.name
        after = place_after(action, here if action.place is None else action.place)
        back = to_charger_wh(world, robot, after) + kept
        needs = needs_wh(world, action, here, robot)
        if ways and left < needs + back and not action.skill.recharges:
            left, needs = full, min(needs_wh(world, action, way.place, robot) for way in ways)
        if left < needs + back and ways and not action.skill.recharges:
            holds = f"{robot}'s battery holds {battery.capacity_wh:g} Wh"
            takes = f"{name} takes {needs:.3g} Wh with the way to it"
            return Short(task, f"{holds}, and {takes}, and {back:.3g} Wh to get to a charger after")
        if left < needs and not ways:
            return Short(task, short_of(robot, left, name, needs, 0.0))
        left, here = full if action.skill.recharges else left - needs, after
    return None


def lasts(world: WorldModel, robot: str) -> bool:
    """Whether a robot's battery is enough for any single task of its own skills, wherever it is."""
    battery = battery_of(world, robot)
    if battery is None:
        return True
    has_wh = full_wh(battery) if chargings(world, robot) else left_wh(world, robot)
    return _most_wh(world, robot) <= (has_wh or 0.0)


def all_last(world: WorldModel) -> bool:
    """Whether that is so of every robot."""
    if "all_last" not in world.asked:
        world.asked["all_last"] = all(lasts(world, robot) for robot in world.robots)
    return bool(world.asked["all_last"])


def _is_ample(world: WorldModel, robot: str, actions: Sequence[tuple[str, Action]]) -> bool:
    """Whether it need not be looked at which tasks these are."""
    own = world.robots[robot].skills
    if any(action.skill.name not in own for _, action in actions):  # a program is of any length
        return False
    if chargings(world, robot):
        return lasts(world, robot)
    return _most_wh(world, robot) * len(actions) <= (left_wh(world, robot) or 0.0)


def _most_wh(world: WorldModel, robot: str) -> float:
    """What no single task takes more than, the way to it and from it to a charger included."""
    known = ("most_wh", robot)
    if known not in world.asked:
        world.asked[known] = _worked_out_most_wh(world, robot)
    found: float = world.asked[known]
    return found


def _worked_out_most_wh(world: WorldModel, robot: str) -> float:
    battery, ways = world.robots[robot].battery, chargings(world, robot)
    assert battery is not None
    here = world.value(AT, robot)
    if not ways and here not in world.places:
        return inf
    from_: list[Value] = [way.place for way in ways] or [here]
    ways_s = (min(drive_s(world, robot, one, to) for one in from_) for to in world.places)
    skills = (world.skills.get(name) for name in world.robots[robot].skills)
    works_s = (world.work_s(robot, each) for each in skills if each and not each.recharges)
    kept = QUEUEING * battery.reserve_wh if ways else 0.0
    # There and back; or, where there is no charger, from place to place by way of where it is.
    driving_j = 2.0 * battery.driving_w * max(ways_s, default=0.0)
    return kept + TRAFFIC * (driving_j + battery.working_w * max(works_s, default=0.0)) / 3600.0


def short_of(robot: str, has_wh: float, task: str, needs_wh: float, back_wh: float) -> str:
    """The sentence that a robot's charge is not enough."""
    back = f" and {back_wh:.3g} Wh to get to a charger" if back_wh else ""
    return f"{robot} has {has_wh:.3g} Wh, and {task} needs {needs_wh:.3g} Wh{back}; charge first"
