"""Robots and the runs of their workers."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.belief_updates import robot_changed
from fleet.core.handlers.goals import drop_goal
from fleet.core.handlers.world import vocabulary_changed
from fleet.core.indexes.touches import Part, Touch
from fleet.core.state import State
from fleet.core.state_updates import touch

OWN_GOALS_GO_SINCE_LOGIC = 7
"""Before, the planner still wanted a robot charged that was in the fleet no more."""


def robot_registered(state: State, event: events.RobotRegistered) -> State:
    """A robot whose worker is connected already is no longer away."""
    robot, known = event.spec.robot, state.robots.get(event.spec.robot)
    if known is not None and replace(known, by=event.spec.by) == event.spec:
        return state
    if state.connected.get(robot):
        state = _there(state, robot)
    state = replace(
        state, robots=state.robots.set(robot, event.spec), team_number=state.team_number + 1
    )
    return vocabulary_changed(touch(robot_changed(state, robot), Touch(Part.TEAM)), robot)


def robot_unregistered(state: State, event: events.RobotUnregistered) -> State:
    """What the robot was doing is as with one that has been away for too long."""
    if event.robot not in state.robots:
        return state
    if state.logic >= OWN_GOALS_GO_SINCE_LOGIC:
        for goal in sorted(state.index.goals_about.get(event.robot, ())):
            spec = state.goals.get(goal)
            if spec is not None and spec.by == (event.robot,) and state.goal_states[goal].own:
                state = drop_goal(state, goal)
    state = replace(state, robots=state.robots.without(event.robot))
    return robot_changed(_gone(state, event.robot), event.robot)


def worker_connected(state: State, event: events.WorkerConnected) -> State:
    """The robot is no longer away, if it is registered."""
    runs = state.connected.get(event.robot, ())
    if event.incarnation in runs:
        return state
    state = replace(state, connected=state.connected.set(event.robot, (*runs, event.incarnation)))
    if event.robot in state.robots:
        state = _there(state, event.robot)
    return robot_changed(state, event.robot)


def worker_disconnected(state: State, event: events.WorkerDisconnected) -> State:
    """A new run has some time to come before the robot counts as lost."""
    return run_ended(state, event.robot, event.incarnation)


def run_ended(state: State, robot: str, incarnation: str) -> State:
    """Without that run of a robot's worker; the robot is away where it has no other."""
    runs = state.connected.get(robot, ())
    if incarnation not in runs:
        return state
    rest = tuple(run for run in runs if run != incarnation)
    state = replace(state, connected=state.connected.set(robot, rest))
    if rest:
        return state
    return robot_changed(_gone(state, robot), robot)


def _gone(state: State, robot: str) -> State:
    return replace(
        state,
        gone_since=state.gone_since.set(robot, state.monotonic_s),
        gone_wall_s=state.gone_wall_s.set(robot, state.wall_time_s),
    )


def _there(state: State, robot: str) -> State:
    return replace(
        state,
        gone_since=state.gone_since.without(robot),
        gone_wall_s=state.gone_wall_s.without(robot),
    )
