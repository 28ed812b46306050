"""What tasks take out of a robot's battery, and whether it has that.

The energy of a task is its duration times what the robot draws meanwhile: on its way what it draws
driving, else what it draws working. One function says so for allocation, checker, repair and
dispatch. Facts say a charge in steps, so that the least of a step counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from fleet.core.model.derived import stays_at
from fleet.core.model.durations import only_moves
from fleet.core.model.parameter_types import OBJECT, PLACE
from fleet.core.model.skills import Action, SkillModel
from fleet.core.model.world import WorldModel
from keyexpr_schema.facts import AT, CHARGE, FactKey, Value
from keyexpr_schema.payloads.robots import CHARGE_STEP, FULL, Battery

TRAFFIC = 1.3
"""How much more than predicted a task may take out of the battery: for traffic and for retries."""


QUEUEING = 0.25
"""Of the reserve, how much no task takes: it is for waiting until a charger is free."""


class Charging(NamedTuple):
    """A way to fill a robot's battery: its skill, by what, and where that is."""

    skill: SkillModel
    args: dict[str, str]
    charger: str
    place: str


def battery_of(world: WorldModel, robot: str) -> Battery | None:
    """What a robot has; `None`: it has none, and never runs out."""
    spec = world.robots.get(robot)
    return None if spec is None else spec.battery


def percent_at_least(said: Value) -> float:
    """The least that a fact's charge can be [%]; what nobody knows counts as full."""
    if isinstance(said, bool) or not isinstance(said, int | float):
        said = FULL
    return max(0.0, min(said, FULL) - CHARGE_STEP / 2)


def left_wh(world: WorldModel, robot: str) -> float | None:
    """What a robot's battery has at least; `None`: it has none."""
    battery = battery_of(world, robot)
    if battery is None:
        return None
    return battery.energy_wh(percent_at_least(world.value(CHARGE, robot)))


def charging_s(world: WorldModel, robot: str) -> float:
    """How long it takes to fill a robot's battery, once it is at a charger [s]."""
    battery = battery_of(world, robot)
    if battery is None:
        return 0.0
    return battery.charging_s(percent_at_least(world.value(CHARGE, robot)))


def full_wh(battery: Battery) -> float:
    """What counts as full."""
    return battery.energy_wh(percent_at_least(FULL))


def energy_wh(world: WorldModel, action: Action, origin: Value, robot: str) -> float:
    """What an action takes out of a robot's battery, with the way to it from `origin`."""
    battery = battery_of(world, robot)
    if battery is None:
        return 0.0
    whole_s = world.duration_s(action, origin, robot)
    to = action.skill.travel_to
    way_s = 0.0 if to is None else min(whole_s, world.travel_s(robot, origin, action.args[to]))
    if only_moves(action.skill):
        way_s = whole_s
    if action.skill.recharges:
        whole_s = way_s
    joules = battery.driving_w * way_s + battery.working_w * (whole_s - way_s)
    return TRAFFIC * joules / 3600.0


def chargings(world: WorldModel, robot: str) -> tuple[Charging, ...]:
    """The ways in which a robot can be charged, wherever it is now."""
    if ("chargings", robot) not in world.asked:
        world.asked["chargings", robot] = tuple(_chargings(world, robot))
    found: tuple[Charging, ...] = world.asked["chargings", robot]
    return found


def _chargings(world: WorldModel, robot: str) -> Iterator[Charging]:
    spec = world.robots.get(robot)
    if spec is None or spec.battery is None:
        return
    for name in spec.skills:
        skill = world.skills.get(name)
        if skill is None or not skill.recharges:
            continue
        others = [each for each in skill.parameters if each != skill.actor_parameter]
        things = [each for each in others if skill.types[each].bases == (OBJECT,)]
        places = [each for each in others if skill.types[each].bases == (PLACE,)]
        if len(others) != 2 or len(things) != 1 or len(places) != 1:
            continue
        for charger in world.of_type(skill.types[things[0]]):
            place = world.value(AT, charger) or stays_at(charger, world)
            if isinstance(place, str) and place in world.places and not world.kept_by(robot, place):
                args = {skill.actor_parameter: robot, things[0]: charger, places[0]: place}
                yield Charging(skill, args, charger, place)


def to_charger_wh(world: WorldModel, robot: str, origin: Value) -> float:
    """What the way to the nearest charger takes; 0 where there is none to go to."""
    ways_s = (drive_s(world, robot, origin, each.place) for each in chargings(world, robot))
    return driving_wh(world, robot, min(ways_s, default=0.0))


def drive_s(world: WorldModel, robot: str, origin: Value, to: str) -> float:
    """How long a robot takes to get somewhere [s]; not at all where it is already."""
    if origin == to:
        return 0.0
    skills = (world.skills.get(name) for name in world.robots[robot].skills)
    moves = (world.work_s(robot, skill) for skill in skills if skill and only_moves(skill))
    return min(moves, default=0.0) + world.travel_s(robot, origin, to)


def place_after(action: Action, origin: Value) -> Value:
    """Where an action leaves its robot, which came from `origin`."""
    here = FactKey(AT, action.actor)
    return next((value for variable, value in action.after if variable == here), origin)


def needs_wh(world: WorldModel, action: Action, origin: Value, robot: str) -> float:
    """As `energy_wh`, with the way to where it is done also if another task is the one to drive."""
    if action.skill.travel_to is not None or action.place is None or origin == action.place:
        return energy_wh(world, action, origin, robot)
    way_wh = driving_wh(world, robot, drive_s(world, robot, origin, str(action.place)))
    return way_wh + energy_wh(world, action, action.place, robot)


def driving_wh(world: WorldModel, robot: str, way_s: float) -> float:
    """What so long a way takes."""
    battery = battery_of(world, robot)
    return 0.0 if battery is None else TRAFFIC * battery.driving_w * way_s / 3600.0


class Turn(NamedTuple):
    """Where a robot charges next, and when it begins there and is full [s from now]."""

    charging: Charging
    begins_s: float
    full_s: float


def soonest(
    world: WorldModel,
    robot: str,
    origin: Value,
    from_s: float,
    taken: Mapping[str, Sequence[tuple[float, float]]],
) -> Turn | None:
    """Where a robot is full soonest that drives there from `origin` at a time, and of those the
    nearest. `taken` says, by charger, from when to when others are at it [s from now]."""
    takes_s = charging_s(world, robot)
    turns: list[tuple[float, Turn]] = []
    for each in chargings(world, robot):
        way_s = drive_s(world, robot, origin, each.place)
        begins_s = from_s + way_s
        for since_s, until_s in sorted(taken.get(each.charger, ())):
            if since_s < begins_s + takes_s and begins_s < until_s:
                begins_s = until_s
        turns.append((way_s, Turn(each, begins_s, begins_s + takes_s)))
    best = min(turns, key=lambda row: (row[1].full_s, row[0]), default=None)
    return None if best is None else best[1]
