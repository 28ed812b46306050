"""Why a robot does not take up a task now: it is not there, held back, at work, or kept for
something else."""

from __future__ import annotations

from collections.abc import Iterator

from fleet.core.charging import charging_goal
from fleet.core.holds import paused
from fleet.core.indexes.fleet_index import carried_by
from fleet.core.state import State
from keyexpr_schema.payloads.waits import WaitKind, WaitReason


def held_up(state: State, robot: str) -> Iterator[WaitReason]:
    """Why a robot does nothing, whatever it has orders for."""
    if not state.connected.get(robot):
        if robot not in state.robots:
            yield WaitReason(kind=WaitKind.LOST, robot=robot)
        else:
            since_s = state.gone_wall_s.get(robot)
            yield WaitReason(kind=WaitKind.AWAY, robot=robot, since_wall_s=since_s)
    for name in state.stops_of(robot):
        why = state.stops[name].reason or None
        yield WaitReason(kind=WaitKind.STOPPED, robot=robot, stop=name, sentence=why)


def not_free(
    state: State, robot: str, plan: str, reservations: bool = True
) -> Iterator[WaitReason]:
    """Why a robot gets no order of a plan: held up or paused, at work, or reserved by another plan.
    One that is being drained only delivers what it carries, and one that is to charge only does
    that.

    A robot that carries what a plan wants brought somewhere is that plan's until it is delivered:
    between a pick and its place no other plan may have the hand. Without a load, a robot that has
    begun an actor's work stays reserved by that plan until it has nothing left to do there, unless
    `reservations` are not to count.
    """
    yield from held_up(state, robot)
    if (hold := paused(state, robot)) is not None:
        why = hold.reason or None
        about = None if hold.of_all else robot
        yield WaitReason(kind=WaitKind.PAUSED, robot=about, hold=hold.hold, sentence=why)
    orders = state.index.work.get(robot)
    if orders:
        busy_plan, task = min(orders)
        yield WaitReason(kind=WaitKind.BUSY, robot=robot, plan=busy_plan, task=task)
    if (goal := charging_goal(state, robot)) is not None:
        if plan not in state.index.plans_of.get(goal, ()):
            yield WaitReason(kind=WaitKind.CHARGING, robot=robot, goal=goal)
        return
    if _carries_for(state, robot, plan):
        return
    if (drain := state.draining(robot)) is not None:
        why = drain.reason or None
        yield WaitReason(kind=WaitKind.DRAINED, robot=robot, hold=drain.hold, sentence=why)
    if orders:
        return
    for other in state.index.active:
        if other == plan:
            continue
        begun = reservations and robot in state.plans[other].index.reserved
        if begun or _carries_for(state, robot, other):
            yield WaitReason(kind=WaitKind.RESERVED, robot=robot, plan=other)


def _carries_for(state: State, robot: str, plan: str) -> bool:
    """Whether a robot has something with it that an open goal of the plan is about."""
    index = state.index
    if robot not in index.things_at:
        return False
    return any(
        plan in index.plans_of.get(goal, ())
        for subject in carried_by(index, robot)
        for goal in index.goals_about.get(subject, ())
    )
