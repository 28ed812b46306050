"""Robots and the runs of their workers."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.handlers.world import vocabulary_changed
from fleet.core.model.skills import Skills
from fleet.core.state import State, put, without


def robot_registered(state: State, event: events.RobotRegistered, skills: Skills) -> State:
    """A robot whose worker is connected already is no longer away."""
    if state.robots.get(event.spec.robot) == event.spec:
        return state
    robot = event.spec.robot
    gone = state.gone_since
    if state.connected.get(robot):
        gone = without(gone, robot)
    state = replace(state, robots=put(state.robots, robot, event.spec), gone_since=gone)
    return vocabulary_changed(state)


def robot_unregistered(state: State, event: events.RobotUnregistered, skills: Skills) -> State:
    """What the robot was doing is as with one that has been away for too long."""
    if event.robot not in state.robots:
        return state
    return replace(
        state,
        robots=without(state.robots, event.robot),
        gone_since=put(state.gone_since, event.robot, 0.0),
    )


def worker_connected(state: State, event: events.WorkerConnected, skills: Skills) -> State:
    """The robot is no longer away."""
    runs = state.connected.get(event.robot, ())
    if event.incarnation in runs:
        return state
    return replace(
        state,
        connected=put(state.connected, event.robot, (*runs, event.incarnation)),
        gone_since=without(state.gone_since, event.robot),
    )


def worker_disconnected(state: State, event: events.WorkerDisconnected, skills: Skills) -> State:
    """A new run has some time to come before the robot counts as lost."""
    runs = state.connected.get(event.robot, ())
    if event.incarnation not in runs:
        return state
    rest = tuple(run for run in runs if run != event.incarnation)
    state = replace(state, connected=put(state.connected, event.robot, rest))
    if rest:
        return state
    return replace(state, gone_since=put(state.gone_since, event.robot, event.wall_time_s))
