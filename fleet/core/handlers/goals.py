"""What the planner makes of news about goals, robots and the world."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import PLANNER_SOURCE
from fleet.core.state import State, put, without
from fleet.errors import NotUnderstood
from fleet.language import Reading, read_goal, statement_facts
from keyexpr_schema.facts import AT, NOTHING, SEARCHED, FactKey, Value
from keyexpr_schema.payloads.goals import ENDED_GOALS, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.plans import Plan, PlanState
from keyexpr_schema.payloads.world import Fact, StatementStatus

"""Relation that says of a place that somebody looked around in it."""


def goal_put(state: State, event: events.GoalPut) -> State:
    """Keep the goal and say what it is understood to mean; a changed goal begins anew."""
    goal = event.goal
    if state.goals.get(goal.goal) == goal:
        return state
    known_ended = goal.goal not in state.goals and goal.goal in state.goal_states
    state = replace(state, goals=put(state.goals, goal.goal, goal))
    if known_ended:
        return state  # under an earlier planner
    return _take_goal(state, goal)


def _take_goal(state: State, goal: Goal) -> State:
    """Say what a goal means; a sentence that the grammar refuses may go to a language model."""
    status = _understand(state, goal)
    state = set_goal(state, status)
    if status.state is GoalState.WAITING:
        state = _presume(state, goal.goal, _reading(state, goal))
    if status.state is GoalState.REJECTED and state.policy.interpreter and not goal.conditions:
        state = set_goal(state, replace(status, state=GoalState.READING))
        return replace(state, interpreting=tuple({*state.interpreting, goal.goal}))
    return _begin_stage(state, goal.goal)


def goal_interpreted(state: State, event: events.GoalInterpreted) -> State:
    """Take over what a language model read in a goal's sentence, or that it read nothing."""
    if event.goal not in state.interpreting:
        return state
    rest = tuple(goal for goal in state.interpreting if goal != event.goal)
    state = replace(state, interpreting=rest)
    status = state.goal_states.get(event.goal)
    if status is None:
        return state
    if not event.stages:
        reason = f"{status.reason}; a language model did not understand it either: {event.reason}"
        return set_goal(state, replace(status, state=GoalState.REJECTED, reason=reason))
    state = set_goal(
        state,
        replace(
            status,
            state=GoalState.WAITING,
            stages=event.stages,
            conditions=event.stages[0],
            reason=None,
        ),
    )
    return _begin_stage(state, event.goal)


def _begin_stage(state: State, goal: str) -> State:
    """A place is searched anew for every goal that asks for it."""
    for condition in state.goal_states[goal].conditions:
        for subject in condition.subjects:
            fact = state.fact(condition.relation, subject)
            if condition.relation == SEARCHED and fact is not None and fact.value is True:
                state = believe(state, replace(fact, value=False, source=PLANNER_SOURCE))
    return state


def next_stage(state: State, goal: str) -> State:
    """A goal goes on with what it wants next; what was brought somewhere before stays there."""
    status = state.goal_states[goal]
    number = status.stage + 1
    wanted = status.stages[number]
    about = {subject for condition in wanted for subject in condition.subjects}
    kept = tuple(
        condition
        for condition in status.conditions
        if condition.relation == AT
        and about.isdisjoint(condition.subjects)
        and not state.robots.keys() & set(condition.subjects)
    )
    status = replace(status, stage=number, conditions=(*wanted, *kept), time_s=state.time_s)
    return _begin_stage(set_goal(state, status), goal)


def goal_deleted(state: State, event: events.GoalDeleted) -> State:
    """Drop the goal; a plan that works on it is made again without it."""
    if event.goal not in state.goals:
        return state
    state = replace(
        state,
        goals=without(state.goals, event.goal),
        goal_states=without(state.goal_states, event.goal),
    )
    for plan, entry in state.plans.items():
        if event.goal in entry.plan.goals and not entry.ended:
            rest = without_goal(state, entry.plan, event.goal)
            entry = replace(
                entry,
                plan=rest,
                replan_reason=f"goal {event.goal} was deleted",
                outside_reason=f"goal {event.goal} was deleted",
                cancelling=entry.cancelling or not rest.goals,
            )
            state = replace(state, plans=put(state.plans, plan, entry))
    return state


def without_goal(state: State, plan: Plan, goal: str) -> Plan:
    """The plan, answering for its other goals only; its tasks stay."""
    rest = tuple(other for other in plan.goals if other != goal)
    conditions = tuple(
        condition
        for other in rest
        if other in state.goal_states
        for condition in state.goal_states[other].conditions
    )
    return replace(plan, goals=rest, conditions=conditions)


def _understand(state: State, goal: Goal) -> GoalStatus:
    try:
        reading = _reading(state, goal)
        stages = reading.stages
        for condition in (condition for stage in stages for condition in stage):
            for name in (*condition.subjects, condition.value):
                _check_name(state, name)
    except NotUnderstood as error:
        return GoalStatus(
            goal=goal.goal, state=GoalState.REJECTED, reason=str(error), time_s=state.time_s
        )
    return GoalStatus(
        goal=goal.goal,
        state=GoalState.WAITING,
        conditions=stages[0],
        stages=stages,
        note=_note(state, reading),
        time_s=state.time_s,
    )


def _reading(state: State, goal: Goal) -> Reading:
    if goal.conditions:
        return Reading(goal.text, (goal.conditions,))
    return read_goal(goal.text, state.vocabulary())


def _note(state: State, reading: Reading) -> str | None:
    """What a goal's sentence says besides what must hold, so that no word is lost unseen."""
    notes = [f"{remark!r} asks for nothing" for remark in reading.remarks]
    for relation, subject, value in reading.presumed:
        fact = state.fact(relation, subject)
        if fact is not None and fact.value not in (None, value):
            notes.append(f"it takes {subject} to be at {value}; believed is {fact.value}")
    return "; ".join(notes) or None


def _presume(state: State, goal: str, reading: Reading) -> State:
    """Believe what a goal takes for granted where nothing is known, as if it had been stated."""
    for relation, subject, value in reading.presumed:
        fact = state.fact(relation, subject)
        if fact is None or fact.value is None:
            said = Fact(
                subject=subject,
                relation=relation,
                value=value,
                source=f"{PLANNER_SOURCE}:{goal}",
                time_s=state.time_s,
            )
            state = believe(state, said)
    return state


def _check_name(state: State, name: Value) -> None:
    known = {**state.places, **state.objects, **state.robots}
    if isinstance(name, str) and name not in known and name != NOTHING:
        raise NotUnderstood(
            f"{name!r} is nothing that is known; known are {', '.join(sorted(known)) or 'none'}"
        )


def set_goal(state: State, status: GoalStatus) -> State:
    """Change what is said of a goal."""
    return replace(state, goal_states=put(state.goal_states, status.goal, status))


def mark_goals(
    state: State,
    goals: tuple[str, ...],
    to: GoalState,
    plan: str | None,
    reason: str | None = None,
) -> State:
    """Move those goals that have not ended to another state."""
    for goal in goals:
        status = state.goal_states.get(goal)
        if (
            status is None
            or status.state in ENDED_GOALS
            or (status.state is to and status.reason == reason and status.plan == plan)
        ):
            continue
        state = set_goal(
            state, replace(status, state=to, plan=plan, reason=reason, time_s=state.time_s)
        )
    return state


def believe(state: State, fact: Fact) -> State:
    """Believe a fact, whatever was known of its variable."""
    if state.facts.get(fact.key) == fact:
        return state
    return replace(state, facts=put(state.facts, fact.key, fact))


def believe_if_newer(state: State, fact: Fact) -> State:
    """Believe a fact that came on another way than its key, unless a newer one is known."""
    known = state.fact(fact.relation, fact.subject)
    return state if known is not None and fact.time_s < known.time_s else believe(state, fact)


def fact_deleted(state: State, event: events.FactDeleted) -> State:
    """No longer believe anything of that variable."""
    key = FactKey(event.relation, event.subject)
    return replace(state, facts=without(state.facts, key)) if key in state.facts else state


def statement_put(state: State, event: events.StatementPut) -> State:
    """Keep the statement, and believe the facts that can be read out of it."""
    statement = event.statement
    if state.statements.get(statement.statement) == statement:
        return state
    state = replace(state, statements=put(state.statements, statement.statement, statement))
    return _read_statement(state, statement.statement)


def statement_deleted(state: State, event: events.StatementDeleted) -> State:
    """Drop the statement. Facts once read out of it stay: they may have been confirmed since."""
    if event.statement not in state.statements:
        return state
    return replace(
        state,
        statements=without(state.statements, event.statement),
        understood=without(state.understood, event.statement),
    )


def _read_statement(state: State, name: str) -> State:
    try:
        read = statement_facts(state.statements[name].text, state.vocabulary())
    except NotUnderstood as error:
        return _set_understood(state, StatementStatus(statement=name, reason=str(error)))
    facts = tuple(
        Fact(
            subject=key.subject,
            relation=key.relation,
            value=value,
            source=f"{PLANNER_SOURCE}:{name}",
            time_s=state.time_s,
        )
        for key, value in read
    )
    for fact in facts:
        state = believe(state, fact)
    return _set_understood(state, StatementStatus(statement=name, facts=facts))


def _set_understood(state: State, status: StatementStatus) -> State:
    if state.understood.get(status.statement) == status:
        return state
    return replace(state, understood=put(state.understood, status.statement, status))


def place_put(state: State, event: events.PlacePut) -> State:
    """Know the place."""
    if state.places.get(event.place.place) == event.place:
        return state
    return _words_changed(replace(state, places=put(state.places, event.place.place, event.place)))


def place_deleted(state: State, event: events.PlaceDeleted) -> State:
    """Forget the place."""
    return replace(state, places=without(state.places, event.place))


def object_put(state: State, event: events.ObjectPut) -> State:
    """Know the object."""
    if state.objects.get(event.object.object) == event.object:
        return state
    return _words_changed(
        replace(state, objects=put(state.objects, event.object.object, event.object))
    )


def object_deleted(state: State, event: events.ObjectDeleted) -> State:
    """Forget the object."""
    return replace(state, objects=without(state.objects, event.object))


def robot_registered(state: State, event: events.RobotRegistered) -> State:
    """Know the robot."""
    if state.robots.get(event.spec.robot) == event.spec:
        return state
    robot = event.spec.robot
    gone = state.gone_since
    if state.alive.get(robot):
        gone = without(gone, robot)
    state = replace(state, robots=put(state.robots, robot, event.spec), gone_since=gone)
    return _words_changed(state)


def robot_unregistered(state: State, event: events.RobotUnregistered) -> State:
    """Forget the robot; what it was doing is as with a robot that went away."""
    if event.robot not in state.robots:
        return state
    return replace(
        state,
        robots=without(state.robots, event.robot),
        gone_since=put(state.gone_since, event.robot, 0.0),
    )


def worker_connected(state: State, event: events.WorkerConnected) -> State:
    """A worker is connected; plans that waited for robots are looked at again."""
    runs = state.alive.get(event.robot, ())
    if event.incarnation in runs:
        return state
    return replace(
        state,
        alive=put(state.alive, event.robot, (*runs, event.incarnation)),
        gone_since=without(state.gone_since, event.robot),
    )


def worker_disconnected(state: State, event: events.WorkerDisconnected) -> State:
    """A worker is gone; a new one has some time to come before its robot counts as lost."""
    runs = state.alive.get(event.robot, ())
    if event.incarnation not in runs:
        return state
    rest = tuple(run for run in runs if run != event.incarnation)
    state = replace(state, alive=put(state.alive, event.robot, rest))
    if rest:
        return state
    return replace(state, gone_since=put(state.gone_since, event.robot, event.wall_time_s))


def prior_state_loaded(state: State, event: events.PriorStateLoaded) -> State:
    """Take over what an earlier planner left, so that nothing is done a second time."""
    answers = {answer.request: answer for answer in event.answers}
    goals = {status.goal: status for status in event.goals if status.state in ENDED_GOALS}
    return replace(
        state,
        answers={**answers, **state.answers},
        durations={**{known.model: known for known in event.durations}, **state.durations},
        goal_states={**goals, **state.goal_states},
        past_plans=(*state.past_plans, *(p for p in event.plans if p not in state.plans)),
    )


def _words_changed(state: State) -> State:
    """Try again to understand what was not, now that there are other names."""
    for goal in state.goals.values():
        status = state.goal_states[goal.goal]
        read = _understand(state, goal)
        if status.state is GoalState.REJECTED and read.reason != status.reason:
            state = _take_goal(state, goal)
        elif status.state is GoalState.WAITING and read.stages and read.stages != status.stages:
            state = set_goal(state, read)  # "some robot" now has more to choose from
    for name, reading in state.understood.items():
        if reading.reason is not None:
            state = _read_statement(state, name)
    return state


def active_plan_of(state: State, goal: str) -> str | None:
    """The plan that works on a goal and has not ended."""
    for plan, entry in state.plans.items():
        if goal in entry.plan.goals and not entry.ended and entry.state is not PlanState.REJECTED:
            return plan
    return None
