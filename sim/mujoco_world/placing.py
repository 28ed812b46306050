"""Putting things on or in others, and into people's hands."""

from __future__ import annotations

import math
from functools import partial

from keyexpr_schema.payloads.motions import PointM
from sim.files.world_schema import FLOOR_M
from sim.mujoco_world.base_motions import in_reach, reach_m, reach_to_m, stand_at
from sim.mujoco_world.grasping import (
    BASKET_OPENING_M,
    RELEASE_OPENING_M,
    held_by,
    path_to_set_down,
    set_down,
    width_m,
)
from sim.mujoco_world.motion import MotionContext, MotionFailed, MotionRun, Steps, stow, wait
from sim.mujoco_world.reaching import fitting

FINGERS_M = 0.03
"""Room for a finger beside an object that is let go."""
BUTTON_M = 0.12
"""And for a hand that comes to a button."""
PITCH_M = 0.05
MOST_SPOTS = 40
FRONT_M = 0.16
"""Under a roof things are put at most so far behind the front."""


def place_at(context: MotionContext, run: MotionRun) -> Steps:
    """Set the held object down on or in a thing, at a free spot that the hand gets to."""
    target = run.motion.object
    assert target is not None
    held = held_by(run.robot)
    _check_target(context, run, target, held)
    yield from stow(run)
    run.phase = f"looking for a free spot at {target}"
    spots = _spots(context, target, held)
    if not spots:
        raise MotionFailed(f"there is no free spot for {held} at {target}")
    spot = None
    for candidate in spots[:MOST_SPOTS]:
        reach = reach_to_m(context, run, candidate)
        if (
            context.navigator.reaches(run.robot.name, candidate, reach)
            if run.robot.drives
            else in_reach(run, candidate, reach)
        ):
            spot = candidate
            break
        yield  # the world goes on while it thinks
    if spot is None:
        raise MotionFailed(f"no free spot at {target} is in reach of {run.robot.name}")
    run.phase = f"driving up to {target}"
    hollow = target in context.world.object_entries and context.world.kind_of(target).hollow
    rim_m = context.world.kind_of(target).extent_m[2] - FLOOR_M if hollow else 0.0
    above_m = max(0.0, rim_m - 0.01)
    path_to = partial(path_to_set_down, context, run.robot, spot, above_m)
    fits = fitting(context, run, spot, path_to)
    yield from stand_at(context, run, spot, reach_to_m(context, run, spot), fits=fits)
    yield from set_down(
        context,
        run,
        spot,
        into=target,
        above_m=above_m,
        opening_m=BASKET_OPENING_M if hollow else RELEASE_OPENING_M,
    )
    return ()


def hand_over(context: MotionContext, run: MotionRun) -> Steps:
    """Give the held object to a person: let it down on the palm, which closes on it."""
    person = run.motion.object
    assert person is not None
    held = held_by(run.robot)
    if person in context.mechanisms.given.values():
        raise MotionFailed(f"{person} has something in the hand already")
    yield from stow(run)
    run.phase = f"driving up to {person}"
    palm = context.world.fixtures.carrier_point_m(person, 0.0, 0.0)
    fixture = context.world.fixture_of[person]
    fits = fitting(context, run, palm, partial(path_to_set_down, context, run.robot, palm))
    yield from stand_at(context, run, palm, reach_m(run), fixture.inward_rad, fits=fits)
    yield from set_down(context, run, palm, into=person)
    yield from wait(0.2)
    if context.mechanisms.given.get(held) != person:
        raise MotionFailed(f"{person} did not get hold of {held}")
    return ()


def _check_target(context: MotionContext, run: MotionRun, target: str, held: str) -> None:
    """Raises `MotionFailed` where nothing can be put."""
    supports = {truth.object: truth.support for truth in context.observer.truths(0.0)}
    link: str | None = target
    while link is not None:
        if link == held:
            raise MotionFailed(f"{held} cannot be put on or in itself")
        if not context.mechanisms.is_open(link):
            raise MotionFailed(f"{link} is closed: open it first")
        link = supports.get(link)


def _spots(context: MotionContext, target: str, held: str) -> list[PointM]:
    """Points on or in a thing where the held object has room, the best one first."""
    world, observer = context.world, context.observer
    gap = width_m(context, held) / 2
    taken = [
        (observer.base_point(name), width_m(context, name) / 2)
        for name in observer.contents(target)
        if name != held
    ]
    if target in world.object_entries:
        points = observer.spots_on(target)
    else:
        fixture, carrier = world.fixtures.carriers[target]
        opening = context.mechanisms.opening(target) if fixture.mover(target) else 0.0
        rim = gap + (FINGERS_M if carrier.inside or carrier.roofed else 0.02)
        length, width, _ = carrier.size_m
        half_x, half_y = length / 2 - rim, width / 2 - rim
        if half_x < 0 or half_y < 0:
            return []
        rows = _line(half_y)
        if carrier.roofed:
            front = -fixture.half_m[1] + FRONT_M - carrier.center_m[1]
            rows = [y for y in rows if y <= front] or rows[:1]
        points = [
            world.fixtures.carrier_point_m(target, x, y, opening)
            for y in rows
            for x in sorted(_line(half_x), key=abs)
        ]
        if fixture.mover(target) is None and not carrier.roofed:
            points.sort(key=lambda point: _from_rim(fixture.local_m(point), half_x, half_y))
        if fixture.button is not None:
            button = fixture.point_m(fixture.button.top_m)
            points = [at for at in points if math.dist(at[:2], button[:2]) >= BUTTON_M + gap]
    return [
        point
        for point in points
        if all(math.dist(point[:2], at[:2]) >= gap + other + FINGERS_M for at, other in taken)
    ]


def _line(half_m: float) -> list[float]:
    count = max(1, int(2 * half_m / PITCH_M))
    return [-half_m + 2 * half_m * k / count for k in range(count + 1)]


def _from_rim(local_m: PointM, half_x: float, half_y: float) -> float:
    """How far from the nearest rim a point is: a hand gets to those near one."""
    return min(half_x - abs(local_m[0]), half_y - abs(local_m[1]))
