"""What lies, at the start of a mission, where none of its robots' hands gets to."""

from __future__ import annotations

import math

import msgspec

from keyexpr_schema.facts import IS_OPEN
from keyexpr_schema.payloads.robots import PoseMRad
from sim.files.mission_file import Mission
from sim.mujoco_world.base_motions import REACH_MARGIN_M
from sim.mujoco_world.description import FixedBase, load_description
from sim.navigation.spots import Spots


def out_of_reach(mission: Mission) -> tuple[str, ...]:
    """A sentence for each object that no robot of the mission can pick up where it lies, once what
    it is in is open.

    Of a mission without a robot that picks things up there is nothing to say. What stands in the
    way besides furniture (other robots, other objects) is not looked at.

    Raises:
        BadFile: a robot's model is missing or wrong.
    """
    hands = []
    fixed: dict[str, PoseMRad] = {}
    for robot in mission.robots:
        about = load_description(robot.spec.model, robot.folder).description
        if "pick" in robot.spec.skills and about.arm is not None:
            least, greatest = about.arm.reach_m
            reach_m = (least + REACH_MARGIN_M, greatest - REACH_MARGIN_M)
            hands.append((robot.spec.robot, about.clearance_m, reach_m))
            if isinstance(about.base, FixedBase):
                fixed[robot.spec.robot] = robot.start_m_rad
    if not hands:
        return ()
    spots = Spots(mission.world)
    unreachable = []
    opened = msgspec.structs.replace(
        mission.world, states={thing: {IS_OPEN: True} for thing in mission.world.fixtures.movers}
    )
    for name, entry in mission.world.object_entries.items():
        point = opened.start_point_m(name)
        if any(
            reach_m[0] <= math.dist(fixed[robot][:2], point[:2]) <= reach_m[1]
            if robot in fixed
            else spots.stances(point, radius_m, reach_m)
            for robot, radius_m, reach_m in hands
        ):
            continue
        robot_name, radius_m, reach_m = hands[0]
        where = f"{'on' if entry.on else 'in'} {entry.carrier} at {list(entry.at_m)}"
        unreachable.append(
            f"{name} lies {where}, where no hand gets to: "
            f"for {robot_name}, {spots.why_not(point, radius_m, reach_m)}"
        )
    return tuple(unreachable)
