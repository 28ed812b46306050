"""Work in progress: which tasks are ready, whose robot is lost, when a plan is done."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core.dispatch.delays import late_task, next_lateness
from fleet.core.dispatch.replan_triggers import new_robots, why_replan
from fleet.core.handlers.goals import mark_goals, next_stage
from fleet.core.handlers.plan_results import plan_again
from fleet.core.handlers.requests import take_waiting_goals
from fleet.core.model.preconditions import Skills, action_of, unmet_before
from fleet.core.model.skills import Action
from fleet.core.plan_entry import give_up, set_entry, set_record
from fleet.core.state import OUTSTANDING, PlanEntry, State
from keyexpr_schema.facts import AT
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskRecord, TaskState


def advance(state: State, skills: Skills) -> State:
    """Take every plan as far as it goes without news: orders, replans, ends."""
    state = _fail_tasks_of_lost_robots(state)
    if state.policy.auto_plan:
        state = take_waiting_goals(state)
    for plan in sorted(state.plans, key=lambda name: _priority(state, name)):
        entry = state.plans[plan]
        if entry.cancelling and not entry.ended:
            state = _cancel(state, entry)
        elif entry.job is None and entry.replan_reason is not None and not entry.ended:
            state = plan_again(state, entry)
        elif entry.state is PlanState.RUNNING and entry.job is None:
            state = _run(state, entry, skills)
    return _loosened(state, skills)


def _loosened(state: State, skills: Skills) -> State:
    """Where nobody moves, since plans keep robots from each other in a circle, one task gets its
    robots all the same; what that upsets is planned again."""
    alive = [entry for entry in state.plans.values() if not entry.ended]
    if any(entry.job is not None or entry.outstanding() for entry in alive):
        return state
    for entry in sorted(alive, key=lambda each: _priority(state, each.plan.plan)):
        if entry.state is not PlanState.RUNNING or entry.replan_reason is not None:
            continue
        for record in entry.current():
            if record.state is not TaskState.WAITING:
                continue
            after = _dispatch(state, entry.plan.plan, record, skills, kept=False)
            if after is not state:
                return advance(after, skills)
    return state


def _priority(state: State, plan: str) -> tuple[int, str]:
    goals = [state.goals[g] for g in state.plans[plan].plan.goals if g in state.goals]
    return -max((goal.priority for goal in goals), default=0), plan


def _cancel(state: State, entry: PlanEntry) -> State:
    if entry.outstanding():
        return state  # their orders now say `cancelled`; the workers' reports bring us back here
    records = {
        name: record
        if record.state in ENDED_TASKS
        else replace(record, state=TaskState.CANCELLED, reason="the plan was cancelled")
        for name, record in entry.records.items()
    }
    entry = replace(
        entry, state=PlanState.CANCELLED, cancelling=False, records=records, replan_reason=None
    )
    state = set_entry(state, entry)
    return mark_goals(
        state, entry.plan.goals, GoalState.WAITING, None, f"plan {entry.plan.plan} was cancelled"
    )


def _run(state: State, entry: PlanEntry, skills: Skills) -> State:
    state = _mark_reached(state, entry, skills)
    entry = state.plans[entry.plan.plan]
    if (reason := why_replan(state, entry, skills)) is not None:
        return advance(set_entry(state, replace(entry, replan_reason=reason)), skills)
    if (helpers := new_robots(state, entry)) is not None:
        return advance(set_entry(state, helpers), skills)
    if (late := late_task(state, entry)) is not None:
        reason = f"{late.robot} is late with {late.task} ({late.skill})"
        handled = (*entry.late, late.task)
        entry = replace(entry, replan_reason=reason, outside_reason=reason, late=handled)
        return advance(set_entry(state, entry), skills)
    if all(record.state is TaskState.SUCCEEDED for record in entry.current()):
        return set_entry(state, replace(entry, state=PlanState.SUCCEEDED))
    if any(record.state in (TaskState.FAILED, TaskState.CANCELLED) for record in entry.current()):
        return give_up(state, entry, "a task of the plan was cancelled or failed")
    for record in list(entry.current()):
        if record.state is TaskState.WAITING:
            state = _dispatch(state, entry.plan.plan, record, skills)
            if state.plans[entry.plan.plan].replan_reason is not None:
                return advance(state, skills)
    return state


def _mark_reached(state: State, entry: PlanEntry, skills: Skills) -> State:
    """A stage of a goal is reached when all its tasks are done and its conditions hold."""
    world = state.world(skills)
    open_goals = {
        record.goal for record in entry.current() if record.state is not TaskState.SUCCEEDED
    }
    for goal in entry.plan.goals:
        status = state.goal_states.get(goal)
        if (
            status is None
            or status.state in ENDED_GOALS
            or goal in open_goals
            or not all(world.holds(condition) for condition in status.conditions)
        ):
            continue
        entry = replace(state.plans[entry.plan.plan], replans=0)
        if status.stage + 1 < len(status.stages):
            state = next_stage(state, goal)
            reason = f"goal {goal} goes on with its next step"
            state = set_entry(state, replace(entry, replan_reason=reason))
        else:
            state = set_entry(state, entry)
            state = mark_goals(state, (goal,), GoalState.REACHED, entry.plan.plan)
    return state


def _dispatch(
    state: State, plan: str, record: TaskRecord, skills: Skills, kept: bool = True
) -> State:
    """Order a waiting task if nothing holds it back; replan if the world is not as it must be.

    See `_free` for `kept`.
    """
    entry = state.plans[plan]
    befores = (*record.after, *record.behind)
    if any(
        entry.records[before].state is not TaskState.SUCCEEDED
        for before in befores
        if before in entry.records
    ):
        return state
    action = action_of(record, skills)
    if action is None:
        reason = f"{record.task} cannot start: there is no skill {record.skill} any more"
        return give_up(state, entry, reason)
    if not all(_free(state, robot, plan, kept) for robot in action.participants):
        return state
    if _touches_what_is_dropped(entry, action, skills):
        return state
    if (unmet := unmet_before(action, state.world(skills))) is not None:
        reason = f"{record.task} ({record.skill}) cannot start: {unmet}"
        return set_entry(state, replace(entry, replan_reason=reason))
    ordered = replace(
        record,
        state=TaskState.ORDERED,
        attempt=record.attempt + 1,
        ordered_s=state.time_s if record.ordered_s is None else record.ordered_s,
        way_s=_way_s(state, action, skills),
    )
    return set_record(state, entry, ordered)


def _way_s(state: State, action: Action, skills: Skills) -> float | None:
    """The way to the task at its robot's top speed, s; `None` if nobody knows from where."""
    if action.skill.travel_to is None:
        return 0.0
    here = state.fact(AT, action.actor)
    if here is None or here.value not in state.places:
        return None
    return state.world(skills).way_s(action.actor, here.value, action.args[action.skill.travel_to])


def _touches_what_is_dropped(entry: PlanEntry, action: Action, skills: Skills) -> bool:
    """Whether a task that is being cancelled, and has not confirmed it, is about the same facts."""
    variables = action.variables
    for task in entry.dropping:
        record = entry.records[task]
        if record.state in OUTSTANDING:
            other = action_of(record, skills)
            if other is None or variables & other.variables:
                return True
    return False


def _free(state: State, robot: str, plan: str, kept: bool) -> bool:
    """Whether a robot is connected and neither works now nor is in the middle of other work.

    A robot that carries what a plan wants brought somewhere is that plan's until it is delivered:
    between a pick and its place no other plan may have the hand. Without a load, a robot that has
    begun an actor's work is `kept` by that plan until it has nothing left to do there.
    """
    if not state.alive.get(robot):
        return False
    carries = _carries_for(state, robot, state.plans[plan])
    for entry in state.plans.values():
        begun: set[str] = set()
        unfinished: set[str] = set()
        for record in entry.records.values():
            if robot not in (record.robot, *record.args.values()):
                continue
            if record.state in OUTSTANDING:
                return False
            if record.robot == robot and record.state is TaskState.SUCCEEDED:
                begun.add(record.actor)
            elif record.robot == robot and record.state is TaskState.WAITING:
                unfinished.add(record.actor)
        if entry.plan.plan == plan or entry.ended or carries:
            continue
        if (kept and begun & unfinished) or _carries_for(state, robot, entry):
            return False
    return True


def _carries_for(state: State, robot: str, entry: PlanEntry) -> bool:
    """Whether a robot has something with it that an open goal of the plan is about."""
    return any(
        (fact := state.fact(AT, subject)) is not None and fact.value == robot
        for goal in entry.plan.goals
        if goal in state.goal_states and state.goal_states[goal].state not in ENDED_GOALS
        for condition in state.goal_states[goal].conditions
        for subject in condition.subjects
    )


def _fail_tasks_of_lost_robots(state: State) -> State:
    for robot, since in state.gone_since.items():
        if state.wall_time_s - since < state.policy.lost_after_s:
            continue
        reason = f"robot {robot} has been away for {state.policy.lost_after_s:g} s"
        if robot not in state.robots:
            reason = f"robot {robot} was unregistered"
        for entry in state.plans.values():
            if entry.ended or not _needs(entry, robot):
                continue
            records = {
                name: replace(record, state=TaskState.FAILED, reason=reason)
                if record.state in OUTSTANDING and robot in (record.robot, *record.args.values())
                else record
                for name, record in entry.records.items()
            }
            if records != entry.records or entry.replan_reason is None:
                lost = replace(entry, records=records, replan_reason=reason, outside_reason=reason)
                state = set_entry(state, lost)
    return state


def _needs(entry: PlanEntry, robot: str) -> bool:
    return any(
        record.state not in ENDED_TASKS and robot in (record.robot, *record.args.values())
        for record in entry.current()
    )


def next_timer(state: State) -> float | None:
    """The Unix time [s] at which a robot that is away becomes lost to a plan that counts on it, or
    a task late."""
    counting = [
        entry
        for entry in state.plans.values()
        if not entry.ended and entry.job is None and entry.replan_reason is None
    ]
    times = [
        since + state.policy.lost_after_s
        for robot, since in state.gone_since.items()
        if any(_needs(entry, robot) for entry in counting)
    ]
    if (late_s := next_lateness(state)) is not None:
        times.append(late_s)
    return min(times, default=None)
