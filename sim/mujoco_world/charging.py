"""Charging: a robot docks before a charger's contacts, and stands there until it is full."""

from __future__ import annotations

from sim.mujoco_world.base_motions import stand_at
from sim.mujoco_world.motion import MotionContext, MotionFailed, MotionRun, Steps, face, stow

DOCKED_M = (-0.05, 0.10)
"""How far before its own rim a docked robot meets the contacts."""


def charge_at(context: MotionContext, run: MotionRun) -> Steps:
    """Dock at a charger until the battery is full."""
    charger, robot = run.motion.object, run.robot
    assert charger is not None
    fixture = context.world.fixtures.by_name[charger]
    assert fixture.dock_m is not None
    point = fixture.point_m(fixture.dock_m)
    yield from stow(run)
    run.phase = f"driving up to {charger}"
    radius = robot.description.radius_m
    reach = (radius + DOCKED_M[0], radius + DOCKED_M[1])
    yield from stand_at(context, run, point, reach, fixture.inward_rad)
    if robot.drives:
        yield from face(run, point[0], point[1])
    if (taken := context.taken(charger, robot.name)) is not None:
        raise MotionFailed(taken)
    run.phase, run.docked_at = f"charging at {charger}", charger
    while not context.batteries.is_full(robot.name):
        yield
    return ()
