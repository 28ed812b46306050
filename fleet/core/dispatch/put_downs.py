"""Things that a robot has in its hand, and that nobody wants anywhere any more, are put down.

Their goal was deleted or has failed while they were carried, or a task that nobody wanted any more
was carried out all the same. A robot that keeps one in its hand can do little else, and nobody
would ever come back to it. So the planner makes a goal of its own: at home, or on the nearest
surface.
"""

from __future__ import annotations

from collections.abc import Iterable

from msgspec.structs import replace

from fleet.core.indexes.fact_views import FactValues
from fleet.core.indexes.fleet_index import EMPTY
from fleet.core.model.derived import carrier_of, carriers
from fleet.core.model.programs import names_in
from fleet.core.own_goals import with_own_goal
from fleet.core.own_waiting import AT_ONCE
from fleet.core.state import State
from fleet.core.state_updates import mark_goals
from fleet.core.table import Table
from keyexpr_schema.facts import AT, HOLDING
from keyexpr_schema.payloads.goals import Condition, GoalState
from keyexpr_schema.payloads.tasks import TaskRecord

SINCE_LOGIC = 6
"""Before, a thing whose goal was deleted stayed in the hand."""
DOWN_SINCE_LOGIC = 7
"""Before, a thing that had been put down meanwhile was brought there all the same."""
PROGRAMS_SINCE_LOGIC = 7
"""Before, so did what a program of many calls had taken that was cancelled."""
_WANTS_IT = frozenset({GoalState.WAITING, GoalState.PLANNED, GoalState.RUNNING, GoalState.READING})
"""States of goals for which a thing stays in the hand."""


def holder_of(state: State, thing: str) -> str | None:
    """The robot that has the thing in its hand."""
    robot = carrier_of(thing, FactValues(state.facts).get, state)
    if robot is None or robot not in state.robots:
        return None
    held = state.fact(HOLDING, robot)
    return robot if held is not None and held.value == thing else None


def note_what_is_carried(state: State, goal: str) -> State:
    """Before a goal is dropped: remember what of it is in a hand, or may come to be in one by what
    robots are doing now."""
    return _left_of_goal(state, goal, f"goal {goal} was deleted")


def note_what_failed_left(state: State, goal: str) -> State:
    """The same of a goal that has failed: whoever tries it again does so from the facts."""
    if state.logic < DOWN_SINCE_LOGIC:
        return state
    return _left_of_goal(state, goal, f"goal {goal} has failed")


def _left_of_goal(state: State, goal: str, cause: str) -> State:
    status = state.goal_states.get(goal)
    if status is None or status.own:
        return state
    rows = (*status.conditions, *(row for stage in status.stages for row in stage))
    return _left(state, dict.fromkeys(name for row in rows for name in row.subjects), cause)


def note_what_was_left(state: State, record: TaskRecord) -> State:
    """After the last report of a task that nobody wanted any more: the same."""
    cause = f"task {record.task} of plan {record.plan} was cancelled"
    names = dict.fromkeys(record.args.values())
    if record.program is not None and state.logic >= PROGRAMS_SINCE_LOGIC:
        names |= dict.fromkeys(sorted(names_in(record.program)))
    return _left(state, names, cause)


def _left(state: State, names: Iterable[str], cause: str) -> State:
    if state.logic < SINCE_LOGIC:
        return state
    left: Table[str, str] = state.to_put_down
    for thing in names:
        if state.logic < DOWN_SINCE_LOGIC:
            if thing not in state.objects:
                continue
        elif thing in left or thing in state.robots or thing in state.places:
            continue
        if thing in state.index.work or holder_of(state, thing):
            left = left.set(thing, cause)
    return state if left is state.to_put_down else replace(state, to_put_down=left)


def put_down_what_is_left(state: State) -> State:
    """Make goals of what is in a hand for nobody, once nothing is done with it any more."""
    for thing, cause in state.to_put_down.items():
        if thing in state.index.work or (thing not in state.objects and holder_of(state, thing)):
            continue
        state = replace(state, to_put_down=state.to_put_down.without(thing))
        robot = holder_of(state, thing)
        if robot is not None and thing in state.objects and not _is_wanted(state, thing):
            state = _with_goal(state, thing, robot, cause)
    return _without_what_is_down(state)


def _without_what_is_down(state: State) -> State:
    """What was in a hand when its put-down was wanted, and is not when it comes to be planned, has
    been brought somewhere meanwhile, and stays there."""
    if state.logic < DOWN_SINCE_LOGIC:
        return state
    for goal in state.waiting_for_robots:
        status = state.goal_states.get(goal)
        if status is None or not status.own or status.part_of is not None:
            continue
        things = [row.subject for row in status.conditions if row.relation == AT]
        if things and not any(t in state.index.work or holder_of(state, t) for t in things):
            reason = f"{' and '.join(things)} is in no hand any more"
            state = mark_goals(state, (goal,), GoalState.NOT_NEEDED, None, reason)
            rest = state.waiting_for_robots.without(goal)
            state = replace(state, waiting_for_robots=rest)
    return state


def _is_wanted(state: State, thing: str) -> bool:
    about = state.index.goals_about.get(thing, EMPTY)
    return any(state.goal_states[goal].state in _WANTS_IT for goal in about)


def _with_goal(state: State, thing: str, robot: str, cause: str) -> State:
    place = _where_to(state, thing, robot)
    if place is None:
        return state
    label = state.places[place].label
    state, name = with_own_goal(
        state,
        f"put-down-{thing}",
        f"Put {state.objects[thing].label} down in the {label}",
        [Condition(relation=AT, subject=thing, value=place)],
        f"{cause} while {thing} was in the hand of {robot}",
    )
    waiting = state.waiting_for_robots.set(name, AT_ONCE)
    return replace(state, waiting_for_robots=waiting)


def _where_to(state: State, thing: str, robot: str) -> str | None:
    """Where it belongs, or else the nearest place with a surface, or with a floor."""
    value_of = FactValues(state.facts).get
    home = state.objects[thing].home
    if home is not None:
        around = (home, *carriers(home, value_of, state))
        if (found := next((name for name in around if name in state.places), None)) is not None:
            return found
    here = state.fact(AT, robot)
    origin = None if here is None else here.value
    world = state.world()
    ways = [
        (not place.surfaces, world.way_s(robot, origin, name), name)
        for name, place in state.places.items()
    ]
    return min(ways)[2] if ways else None
