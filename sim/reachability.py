"""What none of a mission's robots gets to from where it starts: places, chargers, things."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import msgspec

from keyexpr_schema.facts import IS_OPEN
from keyexpr_schema.payloads.robots import PoseMRad
from sim.files.mission_file import Mission
from sim.mujoco_world.base_motions import REACH_MARGIN_M
from sim.mujoco_world.charging import DOCKED_M
from sim.mujoco_world.description import FixedBase, load_description
from sim.navigation.spots import Spots


class _Hand(NamedTuple):
    """`fixed_m_rad`: where the robot stands, if it does not drive."""

    robot: str
    radius_m: float
    reach_m: tuple[float, float]
    fixed_m_rad: PoseMRad | None


class _Driver(NamedTuple):
    robot: str
    radius_m: float
    start_m: tuple[float, float]
    charges: bool


def out_of_reach(mission: Mission) -> tuple[str, ...]:
    """A sentence for each place and charger that no robot of the mission can drive to, and each
    object that none can pick up where it lies, once what it is in is open.

    What stands in the way besides furniture (other robots, other objects) is not looked at.

    Raises:
        BadFile: a robot's model is missing or wrong.
    """
    hands, drivers = [], []
    for robot in mission.robots:
        about = load_description(robot.spec.model, robot.folder).description
        fixed = isinstance(about.base, FixedBase)
        name, start = robot.spec.robot, robot.start_m_rad
        if not fixed:
            charges = robot.spec.battery is not None
            drivers.append(_Driver(name, about.clearance_m, start[:2], charges))
        if "pick" in robot.spec.skills and about.arm is not None:
            least, greatest = about.arm.reach_m
            reach_m = (least + REACH_MARGIN_M, greatest - REACH_MARGIN_M)
            hands.append(_Hand(name, about.clearance_m, reach_m, start if fixed else None))
    spots = Spots(mission.world)
    return (
        *_places(mission, spots, drivers),
        *_chargers(mission, spots, [each for each in drivers if each.charges]),
        *_things(mission, spots, hands),
    )


def _places(mission: Mission, spots: Spots, drivers: list[_Driver]) -> Iterator[str]:
    parts = spots.lattice.parts
    here = {parts[n] for each in drivers for n in spots.ways_out(each.start_m, each.radius_m)}
    for name, nodes in spots.waiting.items():
        if drivers and nodes and not any(parts[node] in here for node in nodes):
            yield (
                f"no robot gets from where it starts to {name}: is a door lacking, or does "
                "something stand in one?"
            )


def _chargers(mission: Mission, spots: Spots, drivers: list[_Driver]) -> Iterator[str]:
    for name, fixture in mission.world.fixtures.chargers.items():
        assert fixture.dock_m is not None
        point = fixture.point_m(fixture.dock_m)
        docks = (
            spots.stances(
                point,
                each.radius_m,
                (each.radius_m + DOCKED_M[0], each.radius_m + DOCKED_M[1]),
                fixture.inward_rad,
            )
            for each in drivers
        )
        if drivers and not any(docks):
            yield f"no robot gets to {name}, a charger: leave 0.6 m of floor before its front"


def _things(mission: Mission, spots: Spots, hands: list[_Hand]) -> Iterator[str]:
    if not hands:
        return
    opened = msgspec.structs.replace(
        mission.world, states={thing: {IS_OPEN: True} for thing in mission.world.fixtures.movers}
    )
    for name, entry in mission.world.object_entries.items():
        point = opened.start_point_m(name)
        if any(
            hand.reach_m[0] <= math.dist(hand.fixed_m_rad[:2], point[:2]) <= hand.reach_m[1]
            if hand.fixed_m_rad is not None
            else spots.stances(point, hand.radius_m, hand.reach_m)
            for hand in hands
        ):
            continue
        robot, radius_m, reach_m, _ = hands[0]
        where = f"{'on' if entry.on else 'in'} {entry.carrier} at {list(entry.at_m)}"
        yield (
            f"{name} lies {where}, where no hand gets to: "
            f"for {robot}, {spots.why_not(point, radius_m, reach_m)}"
        )
