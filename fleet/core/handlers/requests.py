"""What people ask of the planner: plans, replans, and control of plans."""

from __future__ import annotations

import re
from collections.abc import Iterator

from msgspec.structs import replace

from fleet.core import events
from fleet.core.charging import is_charging
from fleet.core.handlers.by_hand import task_done
from fleet.core.holds import plan_paused
from fleet.core.indexes.touches import Part, Touch
from fleet.core.own_waiting import KEPT_SINCE_LOGIC, is_own
from fleet.core.plan_entry import PlanEntry, PlanningJob
from fleet.core.replan_reasons import GoalsAdded, ReplanAsked, TaskAdded
from fleet.core.sentences import program_for
from fleet.core.state import State
from fleet.core.state_updates import (
    active_plan_of,
    answer,
    cancel,
    forget_entry,
    mark_goals,
    refuse_wishes,
    set_entry,
    touch,
)
from fleet.errors import NotUnderstood
from fleet.language.refusals import nearest
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState
from keyexpr_schema.payloads.plans import Plan, PlanState
from keyexpr_schema.payloads.programs import DO
from keyexpr_schema.payloads.requests import Control, ControlRequest, PlanRequest, ReplanRequest

_NUMBERED = re.compile("plan-([1-9][0-9]{0,14})")


OWN_SINCE_LOGIC = 7
"""Before, charging that nobody could plan was planned again as its robot's charge fell."""


def plan_requested(state: State, event: events.PlanRequested) -> State:
    """Start to plan for the goals asked for, or say why not."""
    return _start_planning(state, event.request)


def plan_waiting_goals(state: State) -> State:
    """Goals that wait go into the running plan, or, where none runs, into a new one.

    Those that waited for robots do so when one has come, others where the policy says so.
    """
    if not state.policy.auto_plan and not state.waiting_for_robots:
        return state
    active = [state.plans[plan] for plan in state.index.active]
    if any(entry.state is PlanState.PLANNING for entry in active):
        return state  # what comes meanwhile goes into the plan that is being made
    waiting = tuple(goal for goal in _waiting_goals(state) if _is_due(state, goal))
    if not waiting:
        return state
    state = _taken_up(state, waiting)
    if state.logic >= OWN_SINCE_LOGIC:
        to_charge = tuple(goal for goal in waiting if is_charging(state, goal))
        for goal in to_charge:
            state = plan_at_once(state, goal)
        waiting = tuple(goal for goal in waiting if goal not in to_charge)
        if not waiting:
            return state
    running = [e for e in active if e.state is PlanState.RUNNING and not e.cancelling]
    if state.logic >= KEPT_SINCE_LOGIC and all(is_own(state, goal) for goal in waiting):
        # What somebody has paused may stay so for long, and this is none of it.
        running = [entry for entry in running if plan_paused(state, entry.plan.plan) is None]
    for entry in running:
        return set_entry(state, entry.wishing(GoalsAdded(goals=waiting)))
    plan = Plan(plan=_new_plan_name(state), goals=waiting, conditions=(), tasks=())
    job = PlanningJob.of(state.jobs + 1, plan, "symbolic")
    job = replace(job, partial=True, team_number=state.team_number)
    return _planning(state, plan, job)


def plan_at_once(state: State, goal: str) -> State:
    """Plan for a goal that the planner itself has made, apart from all others."""
    plan = Plan(plan=_new_plan_name(state), goals=(goal,), conditions=(), tasks=())
    job = PlanningJob.of(state.jobs + 1, plan, "symbolic")
    if state.logic >= OWN_SINCE_LOGIC:
        job = replace(job, team_number=state.team_number)
    return _planning(state, plan, job)


def _taken_up(state: State, goals: tuple[str, ...]) -> State:
    """These goals wait for nobody any more: a plan is made for them."""
    rest = state.waiting_for_robots
    for goal in goals:
        rest = rest.without(goal)
    return state if rest is state.waiting_for_robots else replace(state, waiting_for_robots=rest)


def _is_due(state: State, goal: str) -> bool:
    number = state.waiting_for_robots.get(goal)
    if number is not None:
        return number != state.team_number
    return state.policy.auto_plan and state.goal_states[goal].reason is None


def _start_planning(state: State, ask: PlanRequest) -> State:
    if _is_known(state, ask.request):
        return state
    goals = _with_parts(state, ask.goals) or tuple(_waiting_goals(state))
    if reason := _why_not_plan(state, ask.plan, goals):
        return answer(state, ask.request, False, reason)
    plan = Plan(
        plan=ask.plan or _new_plan_name(state),
        goals=goals,
        conditions=(),
        tasks=(),
        strategy=ask.strategy,
        made_by=ask.planner,
        allocator=ask.allocator,
        autostart=ask.start,
        programs=ask.programs,
    )
    job = PlanningJob.of(state.jobs + 1, plan, ask.planner)
    job = replace(job, request=ask.request, dry_run=ask.dry_run)
    if ask.dry_run:
        previews = state.previews.set(ask.request, job)
        state = replace(state, jobs=job.job, previews=previews)
        return touch(state, Touch(Part.PREVIEW, ask.request))
    return _planning(state, plan, job)


def _with_parts(state: State, goals: tuple[str, ...]) -> tuple[str, ...]:
    """These goals, and in place of one that is several those of it that wait."""
    found: dict[str, None] = {}
    for goal in goals:
        status = state.goal_states.get(goal)
        parts = status.parts if status is not None and status.next_s is None else ()
        waiting = [p for p in parts if state.goal_states[p].state is GoalState.WAITING]
        found.update(dict.fromkeys(waiting or [goal]))
    return tuple(found)


def _is_known(state: State, request: str) -> bool:
    """Whether a request was answered, or is in work."""
    return request in state.answers or request in state.previews or request in state.index.asked


def _planning(state: State, plan: Plan, job: PlanningJob) -> State:
    entry = PlanEntry(
        plan=plan,
        state=PlanState.PLANNING,
        planner=job.planner,
        start=plan.autostart,
        lineage=state.lineage or None,
        job=job,
        begun_s=state.time_s,
        begun_wall_s=state.wall_time_s,
    )
    made = max(state.plans_made, plan_number(plan.plan))
    state = replace(_taken_up(state, plan.goals), jobs=job.job, plans_made=made)
    return set_entry(state, entry)


def _why_not_plan(state: State, plan: str | None, goals: tuple[str, ...]) -> str | None:
    if not goals:
        return "there is no goal that waits for a plan; add one first"
    if plan is not None and (plan in state.plans or plan in state.past_plans):
        return f"there is a plan {plan} already; choose another name or delete it"
    for goal in goals:
        if goal not in state.goals:
            return f"there is no goal {goal}; known are {nearest(sorted(state.goals), goal)}"
        status = state.goal_states[goal]
        if status.state is GoalState.PENDING:
            return f"goal {goal} is pending: {status.reason}; it is planned by itself then"
        if status.state is GoalState.STANDING:
            return f"goal {goal} stands, and what it makes is planned by itself"
        if status.state is GoalState.READING:
            return f"what goal {goal} means is still being worked out; ask again"
        if status.state in ENDED_GOALS:
            return f"goal {goal} is {status.state.value}" + (
                f": {status.reason}" if status.reason else ""
            )
        if other := active_plan_of(state, goal):
            return f"goal {goal} is already in plan {other}"
    return None


def _waiting_goals(state: State) -> Iterator[str]:
    """Goals that no plan works on, in their order."""
    waiting = (g for g in state.index.in_state.get(GoalState.WAITING, ()) if g in state.goals)
    for goal in sorted(waiting, key=lambda g: (state.goals[g].ordinal, g)):
        if not active_plan_of(state, goal):
            yield goal


def plan_number(plan: str) -> int:
    """`N` where the plan is called `plan-N`, else 0."""
    named = _NUMBERED.fullmatch(plan)
    return 0 if named is None else int(named[1])


def _new_plan_name(state: State) -> str:
    number = state.plans_made + 1 if state.logic else 1
    while f"plan-{number}" in state.plans or f"plan-{number}" in state.past_plans:
        number += 1
    return f"plan-{number}"


FROM_ONE_SINCE_LOGIC = 9
"""Before, a proposal that was no first revision was neither begun nor rejected, and all that was to
be planned waited for it."""


def plan_proposed(state: State, event: events.PlanProposed) -> State:
    """Take a plan that someone put into planning: it is checked and allocated like any other.

    Whichever revision of another plan it may have been, it is the first of this one."""
    plan = event.plan
    if plan.plan in state.plans or plan.plan in state.past_plans:
        return state
    if state.logic >= FROM_ONE_SINCE_LOGIC:
        plan = replace(plan, revision=1)
    job = PlanningJob.of(state.jobs + 1, plan, "symbolic")
    return _planning(state, plan, replace(job, proposal=plan))


def replan_requested(state: State, event: events.ReplanRequested) -> State:
    """Plan again from what is known now; answered when that is done."""
    ask = event.request
    if _is_known(state, ask.request):
        return state
    entry = _entry_to_replan(state, ask)
    if isinstance(entry, str):
        return answer(state, ask.request, False, entry)
    wish = ReplanAsked(request=ask.request, sentence=ask.reason, goals=ask.goals)
    # What a person asks for is no sign that the world does not go along: counting begins anew.
    entry = replace(entry.wishing(wish), fruitless_replans=0, hopeless=())
    return set_entry(_taken_up(state, ask.goals), entry)


def _entry_to_replan(state: State, ask: ReplanRequest) -> PlanEntry | str:
    """The plan's entry, or a sentence on why it cannot be made again."""
    entry = state.plans.get(ask.plan)
    if entry is None:
        return _no_plan(state, ask.plan)
    if entry.state is not PlanState.RUNNING:
        return f"plan {ask.plan} is {entry.state.value}, not running"
    if entry.cancelling:
        return f"plan {ask.plan} is being cancelled"
    return (ask.goals and _why_not_plan(state, None, ask.goals)) or entry


def _no_plan(state: State, plan: str) -> str:
    return f"there is no plan {plan}; known are {nearest(sorted(state.plans), plan)}"


APPROVED_BY_SINCE_LOGIC = 7
"""Before, a plan did not say who had approved it."""


def control_requested(state: State, event: events.ControlRequested) -> State:
    """Start, approve, cancel, delete or change a plan, or say why not."""
    ask = event.request
    if _is_known(state, ask.request):
        return state
    entry = state.plans.get(ask.plan)
    done = _no_plan(state, ask.plan) if entry is None else _CONTROLS[ask.control](state, entry, ask)
    return answer(state, ask.request, False, done) if isinstance(done, str) else done


def _start(state: State, entry: PlanEntry, ask: ControlRequest) -> State | str:
    if entry.state is not PlanState.READY:
        return f"plan {ask.plan} is {entry.state.value}; only a ready plan can be started"
    return _release(state, replace(entry, start=True), ask)


def _approve(state: State, entry: PlanEntry, ask: ControlRequest) -> State | str:
    if entry.state is not PlanState.PROPOSED:
        return f"plan {ask.plan} is {entry.state.value}; only a proposed plan is approved"
    by = ask.by if state.logic >= APPROVED_BY_SINCE_LOGIC else ""
    return _release(state, replace(entry, approved_by=by), ask)


def _release(state: State, entry: PlanEntry, ask: ControlRequest) -> State:
    to = PlanState.RUNNING if entry.start else PlanState.READY
    state = set_entry(state, replace(entry, state=to))
    if entry.start:
        state = mark_goals(state, entry.plan.goals, GoalState.RUNNING, ask.plan)
    return answer(state, ask.request, True, f"plan {ask.plan} is {to.value}", ask.plan)


SAYS_ALREADY_SINCE_LOGIC = 12
"""Before, who cancelled a plan a second time was not told of the first, and his words were not
kept."""


def _cancel(state: State, entry: PlanEntry, ask: ControlRequest) -> State | str:
    if entry.ended:
        return f"plan {ask.plan} is {entry.state.value}"
    sentence = f"plan {ask.plan} is being cancelled"
    because = ""
    if state.logic >= SAYS_ALREADY_SINCE_LOGIC:
        if entry.cancelling:
            before = f": {entry.reason}" if entry.reason else ""
            return answer(state, ask.request, True, f"{sentence} already{before}", ask.plan)
        because = f" ({ask.reason})" if ask.reason else ""
    why = f"{ask.by or 'somebody'} has cancelled plan {ask.plan}{because}"
    return answer(cancel(state, entry, why), ask.request, True, sentence, ask.plan)


def _delete(state: State, entry: PlanEntry, ask: ControlRequest) -> State | str:
    if not entry.ended and entry.state not in (PlanState.READY, PlanState.PROPOSED):
        return f"plan {ask.plan} is {entry.state.value}; cancel it before deleting it"
    if working := [f"{r.robot} with {r.task}" for r in entry.outstanding()]:
        return (
            f"plan {ask.plan} has orders that may still be carried out: {', '.join(working)}; "
            "delete it when those robots have reported; one that does not come back, "
            "`robotctl unregister ROBOT --force`"
        )
    state = mark_goals(state, entry.plan.goals, GoalState.WAITING, None)
    state = refuse_wishes(state, entry, f"plan {ask.plan} was deleted")
    state = forget_entry(state, ask.plan)
    return answer(state, ask.request, True, f"plan {ask.plan} is deleted")


def _add_task(state: State, entry: PlanEntry, ask: ControlRequest) -> State | str:
    if entry.state not in (PlanState.READY, PlanState.RUNNING):
        return f"plan {ask.plan} is {entry.state.value}; tasks go to ready or running plans"
    if ask.skill is None:
        return "the request names no skill for the new task"
    if entry.cancelling:
        return f"plan {ask.plan} is being cancelled"
    if entry.job is not None and not state.plans_while_acting:
        return f"plan {ask.plan} is being changed; add the task when that is done"
    for before in ask.after:
        if before not in entry.records:
            tasks = ", ".join(entry.records) or "no tasks"
            return f"the new task cannot wait for {before}: plan {ask.plan} has {tasks}"
    if ask.skill == DO:
        wish = _sentence(state, ask)
        return wish if isinstance(wish, str) else set_entry(state, entry.wishing(wish))
    if "robot" in ask.args:
        robot = ask.args["robot"]
        return (
            f"who does the task is no argument: instead of robot={robot} give the robot by itself "
            f"(`robotctl task add … --robot {robot}`)"
        )
    wish = TaskAdded(
        request=ask.request, skill=ask.skill, args=ask.args, after=ask.after, robot=ask.robot
    )
    return set_entry(state, entry.wishing(wish))


def _sentence(state: State, ask: ControlRequest) -> TaskAdded | str:
    """A sentence for a robot as a task, or why it is none. Its program is written by the planning
    job that checks it."""
    args = dict(ask.args)
    robot, text = args.pop("robot", ask.robot), args.pop("text", None)
    speaker = args.pop("speaker", None)
    if args or not text:
        return (
            f'{DO} takes text="a sentence", robot=NAME if one robot shall do it, and speaker=NAME '
            "of the person who says it, if that is somebody"
        )
    if robot is not None and robot not in state.robots:
        return f"there is no robot {robot}; known are {nearest(sorted(state.robots), robot)}"
    try:
        program, robot = program_for(text, state.vocabulary().spoken_by(speaker), robot)
    except NotUnderstood as error:
        return f"{text!r}: {error}"
    return TaskAdded(
        request=ask.request,
        skill=DO,
        args={"text": text},
        after=ask.after,
        robot=robot,
        program=program,
    )


_CONTROLS = {
    Control.START: _start,
    Control.APPROVE: _approve,
    Control.CANCEL: _cancel,
    Control.DELETE: _delete,
    Control.ADD_TASK: _add_task,
    Control.TASK_DONE: task_done,
}
