"""Emergency stops: workers obey them by themselves; the planner only gives no orders meanwhile."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.indexes.touches import Part, Touch
from fleet.core.state import State
from fleet.core.state_updates import set_late_bound, touch


def stop_put(state: State, event: events.StopPut) -> State:
    """What it names gets no order until it is released."""
    stop = event.stop
    known = state.stops.get(stop.stop)
    if known == stop:
        return state
    state = replace(state, stops=state.stops.set(stop.stop, stop))
    return state if known is None else _look_again(state)  # it may hold others now


def stop_deleted(state: State, event: events.StopDeleted) -> State:
    """Robots that no other stop holds may be free now."""
    if event.stop not in state.stops:
        return state
    return _look_again(replace(state, stops=state.stops.without(event.stop)))


def stop_released(state: State, event: events.StopReleased) -> State:
    """The robot may be free now."""
    stop, robot = event.release.stop, event.release.robot
    released = state.released.get(stop, ())
    if robot in released:
        return state
    return _look_again(replace(state, released=state.released.set(stop, (*released, robot))))


def stop_release_deleted(state: State, event: events.StopReleaseDeleted) -> State:
    """The robot is held again, if the stop still stands."""
    released = state.released.get(event.stop, ())
    if event.robot not in released:
        return state
    rest = tuple(robot for robot in released if robot != event.robot)
    table = state.released.set(event.stop, rest) if rest else state.released.without(event.stop)
    return replace(state, released=table)


def _look_again(state: State) -> State:
    """Robots may be free now, and what they do may be late, which it was not while they rested."""
    for plan in state.index.active:
        state = set_late_bound(state, state.plans[plan], 0.0)
    for robot in state.robots:
        if not state.stopped(robot):
            state = touch(state, Touch(Part.ROBOT, robot))
    return state
