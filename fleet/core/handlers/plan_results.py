"""Planning jobs that have ended: the plan is taken over, or goes on as it was, or ends."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sized

from msgspec.structs import replace

from fleet.core import events
from fleet.core.charging import charging_goal
from fleet.core.dispatch.replan_triggers import contradicted
from fleet.core.holds import drains
from fleet.core.indexes.touches import Part, Touch
from fleet.core.own_waiting import KEPT_SINCE_LOGIC, is_own
from fleet.core.plan_entry import PlanEntry, PlanningJob
from fleet.core.replan_reasons import GoalsAdded, ReplanReason, TaskAdded, Wish
from fleet.core.revision.reconcile import reconcile
from fleet.core.state import State
from fleet.core.state_updates import (
    answer,
    give_up,
    mark_goals,
    open_goals,
    put_answer,
    set_entry,
    touch,
    without_goal,
)
from fleet.core.table import Table
from fleet.core.view import status_of
from keyexpr_schema.facts import CHARGE, HOLDING, FactKey
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import Plan, PlanState
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskState

OUT_SINCE_LOGIC = 7
"""Before, nobody looked at what a robot was given that went out while the plan was made, nor said
who is out where those who are there cannot do it."""
AWAY_SINCE_LOGIC = 8
"""Before, nobody said who was away."""
MOST_AWAY = 5
"""So many robots that are away are named."""


_HAD = frozenset({GoalState.REACHED, GoalState.NOT_NEEDED})


def planning_succeeded(state: State, event: events.PlanningSucceeded) -> State:
    """Take over a finished plan, or show it where it was only asked to be seen."""
    if (preview := _preview_of(state, event.job)) is not None:
        return _show(state, preview, event)
    entry = state.plans.get(event.plan.plan)
    if entry is None or entry.job is None or entry.job.job != event.job:
        return state
    job = entry.job
    team = state.team()
    rest, reasons, wishes = entry.job_ended()
    if _as_it_was(entry, job, event):
        as_before = replace(
            rest, team=team, discarded=0, waits_for_team=None, reason=None, violations=()
        )
        return _going_on(set_entry(state, as_before), as_before)
    event = replace(event, plan=_for_goals_of_now(state, entry, event))
    if state.logic >= OUT_SINCE_LOGIC:  # who has gone meanwhile is looked at, as he has work here
        team += tuple(sorted({*event.allocation.values()}.difference(team)))
    revision = reconcile(entry, event, state.world())
    if revision.missed:
        return set_entry(state, replace(entry, job=None, discarded=entry.discarded + 1))
    for goal, reason in event.left_out.items():
        state = mark_goals(state, (goal,), GoalState.FAILED, entry.plan.plan, reason)
    state = _own_given_up_waits(state, job, event.left_out)
    for goal, reason in event.postponed.items():
        state = mark_goals(state, (goal,), GoalState.WAITING, None, reason)
    out = _out(state) + _away(state)
    waiting = {goal: reason + out for goal, reason in event.for_robots.items()}
    state = _wait_for_robots(state, job, waiting)
    first = event.plan.revision == 1
    to = entry.state
    if first:
        asked = state.policy.approval and not _charges_only(state, event.plan)
        to = PlanState.PROPOSED if asked else PlanState.READY
    if to is PlanState.READY and entry.start:
        to = PlanState.RUNNING
    added = _added(entry, job, wishes)
    lost = [actor for actor in added if _is_lost(entry, revision.plan, actor)]
    for actor in lost:
        rest = rest.wishing(replace(added[actor], request=None, after=()))
        added = added.without(actor)
    if again := _to_try_again(state, job, event, reasons, wishes):
        rest = rest.wishing(GoalsAdded(goals=again))
    fruitless = bool(reasons) and not (event.repaired and job.reallocation)
    reserved = entry.index.reserved
    entry = replace(
        rest,
        plan=revision.plan,
        outcome=event.outcome,
        state=to,
        records=entry.records.updated(revision.records),
        unwanted=tuple(dict.fromkeys([*entry.unwanted, *revision.unwanted])),
        change=None if first else revision.change,
        added=added,
        discarded=0,
        waits_for_team=None,
        team=team,
        fruitless_replans=entry.fruitless_replans + fruitless,
        reason=None,
        violations=(),
    )
    state = set_entry(state, _without_moot_reasons(state, entry))
    kept = state.plans[entry.plan.plan].index.reserved
    for robot in reserved:
        if robot not in kept:  # other plans may have it now
            state = touch(state, Touch(Part.ROBOT, robot))
    goal_state = GoalState.RUNNING if to is PlanState.RUNNING else GoalState.PLANNED
    state = mark_goals(state, event.plan.goals, goal_state, entry.plan.plan)
    state = answer(state, job.request, True, _made_sentence(event), entry.plan.plan)
    for wish in wishes:
        state = _answer_wish(state, wish, event)
    return state


def _going_on(state: State, entry: PlanEntry) -> State:
    """Goals that waited with their plan, which goes on."""
    if entry.state is not PlanState.RUNNING:
        return state
    plan = entry.plan.plan
    waiting = tuple(
        goal
        for goal in entry.plan.goals
        if goal in state.goal_states
        and (state.goal_states[goal].state, state.goal_states[goal].plan)
        == (GoalState.WAITING, plan)
    )
    return mark_goals(state, waiting, GoalState.RUNNING, plan)


def _charges_only(state: State, plan: Plan) -> bool:
    """Whether all that a plan is for is that robots charge: who waits for a person's approval may
    wait until the battery is empty."""
    robots = {condition.subject for condition in plan.conditions if condition.subject is not None}
    goals = {goal for robot in robots if (goal := charging_goal(state, robot)) is not None}
    return bool(plan.goals) and goals.issuperset(plan.goals)


def _to_try_again(
    state: State,
    job: PlanningJob,
    event: events.PlanningSucceeded,
    reasons: tuple[ReplanReason, ...],
    wishes: tuple[Wish, ...],
) -> tuple[str, ...]:
    """Goals that there was no time for, which the next revision plans beside this one: as long as
    they become fewer with each, and nobody has to approve what is planned."""
    late = tuple(goal for goal in event.not_in_time if goal in state.goals)
    only_these = not reasons and all(isinstance(wish, GoalsAdded) for wish in wishes)
    tried = {goal for wish in wishes for goal in wish.goals} if wishes and only_these else job.goals
    return late if len(late) < len(tried) and not state.policy.approval else ()


def _added(entry: PlanEntry, job: PlanningJob, wishes: tuple[Wish, ...]) -> Table[str, TaskAdded]:
    """The tasks that people have added to the plan, with the one of this job, by actor."""
    for wish in wishes:
        if isinstance(wish, TaskAdded) and job.proposal is not None:
            return entry.added.set(job.proposal.tasks[-1].actor, wish)
    return entry.added


def _is_lost(entry: PlanEntry, plan: Plan, actor: str) -> bool:
    """Whether a task that somebody added was still to be done, and a plan that was made anew for
    its goals alone does without it: then it is wished for again."""
    undone = (r for r in entry.current() if r.actor == actor and r.state not in ENDED_TASKS)
    return any(undone) and all(task.actor != actor for task in plan.tasks)


def _for_goals_of_now(state: State, entry: PlanEntry, event: events.PlanningSucceeded) -> Plan:
    """The plan without goals that were taken back while it was being made."""
    plan = replace(event.plan, autostart=entry.start)
    wanted = frozenset(entry.wanted_goals)
    for goal in event.plan.goals:
        if goal not in wanted:
            plan = without_goal(state, plan, goal)
    return plan


def _as_it_was(entry: PlanEntry, job: PlanningJob, event: events.PlanningSucceeded) -> bool:
    """Whether another allocation of what was left has turned out to be the one there is."""
    return (
        event.repaired
        and job.reallocation
        and job.residual is not None
        and not event.left_out
        and not event.postponed
        and not event.for_robots
        and event.allocation.items() <= job.previous_allocation.items()
        and len(event.plan.tasks) == len(job.residual.tasks)
        and not any(
            record.state in (TaskState.FAILED, TaskState.CANCELLED)
            or record.task in entry.unwanted
            or (record.state is not TaskState.SUCCEEDED and not entry.is_wanted(record))
            for record in entry.current()
        )
    )


def _without_moot_reasons(state: State, entry: PlanEntry) -> PlanEntry:
    """The entry without reasons that came up meanwhile and say nothing against its new plan: about
    facts that it counts with, and tasks that it does without."""
    ahead = {record.task for record in entry.current() if record.state not in ENDED_TASKS}

    def holds(reason: ReplanReason) -> bool:
        if not state.plans_while_acting:
            return True
        if reason.variables:
            facts = (state.facts.get(variable) for variable in reason.variables)
            return any(f is not None and contradicted(state, entry, f) is not None for f in facts)
        return not reason.tasks or not ahead.isdisjoint(reason.tasks)

    return replace(entry, reasons=tuple(reason for reason in entry.reasons if holds(reason)))


def _answer_wish(state: State, wish: Wish, event: events.PlanningSucceeded) -> State:
    """Met; or refused, if the plan is made and has nothing of what was wanted in it."""
    missing = {**event.left_out, **event.postponed}
    refused = bool(wish.goals) and all(goal in missing for goal in wish.goals)
    return answer(state, wish.request, not refused, _made_sentence(event), event.plan.plan)


def _made_sentence(event: events.PlanningSucceeded) -> str:
    plan = event.plan
    tasks, goals = _counted(plan.tasks, "task"), _counted(plan.goals, "goal")
    sentences = [f"plan {plan.plan} has {tasks} for {goals}"]
    if plan.making.fallback:
        sentences.append(plan.making.fallback)
    missing = {**event.left_out, **event.postponed, **event.for_robots}
    sentences += [f"goal {goal} is left out: {reason}" for goal, reason in missing.items()]
    return "; ".join(sentences)


def _counted(things: Sized, what: str) -> str:
    return f"{len(things)} {what}{'' if len(things) == 1 else 's'}"


def _preview_of(state: State, job: int) -> PlanningJob | None:
    return next((found for found in state.previews.values() if found.job == job), None)


def _show(state: State, job: PlanningJob, event: events.PlanningSucceeded) -> State:
    assert job.request is not None
    entry = PlanEntry(plan=event.plan, state=PlanState.READY, outcome=event.outcome)
    reply = Answer(
        request=job.request,
        accepted=True,
        sentence=f"a dry run: {_made_sentence(event)}",
        preview=event.plan,
        preview_status=status_of(entry),
    )
    return put_answer(_without_preview(state, job.request), reply)


def _without_preview(state: State, request: str) -> State:
    state = replace(state, previews=state.previews.without(request))
    return touch(state, Touch(Part.PREVIEW, request))


def planning_failed(state: State, event: events.PlanningFailed) -> State:
    """A job failed: a first plan is rejected, a running one goes on or is given up."""
    out = any(state.is_empty(robot) for robot in state.robots)
    if state.logic >= OUT_SINCE_LOGIC or event.for_robots or out or not state.team():
        event = replace(event, reason=event.reason + _out(state))
    if (preview := _preview_of(state, event.job)) is not None:
        assert preview.request is not None
        state = _without_preview(state, preview.request)
        return answer(state, preview.request, False, event.reason, violations=event.violations)
    if (plan := state.index.job_of.get(event.job)) is None:
        return state
    entry = state.plans[plan]
    assert entry.job is not None
    job, first = entry.job, entry.plan.revision == 1 and not entry.records
    if first or event.for_robots:
        event = replace(event, reason=event.reason + _away(state))
    entry, reasons, wishes = replace(
        entry,
        violations=event.violations,
        outcome=replace(entry.outcome, planning_time_s=event.planning_time_s),
        discarded=0,
    ).job_ended()
    if first and entry.reasons:  # a goal was taken back: without it, there may be a plan
        job = replace(job, job=state.jobs + 1, goals=entry.plan.goals)
        return set_entry(replace(state, jobs=job.job), replace(entry, job=job, reasons=()))
    if first:
        entry = replace(entry, state=PlanState.REJECTED, reason=event.reason)
        state = set_entry(state, entry)
        for goal in entry.plan.goals:
            state = mark_goals(state, (goal,), GoalState.WAITING, None, event.reason_for(goal))
        if job.partial:  # nobody has asked for this plan who now knows better
            state = _wait_for_robots(state, job, dict.fromkeys(event.for_robots, event.reason))
        state = _own_wait(state, job, entry.plan.goals)
        return answer(state, job.request, False, event.reason, entry.plan.plan, event.violations)
    for wish in wishes:
        sentence = f"{wish.refusal}: {event.reason}"
        state = answer(state, wish.request, False, sentence, plan, event.violations)
        for goal in wish.goals:
            state = mark_goals(state, (goal,), GoalState.WAITING, None, event.reason_for(goal))
        if wish.request is None:
            waiting = [goal for goal in wish.goals if goal in event.for_robots]
            state = _wait_for_robots(state, job, dict.fromkeys(waiting, event.reason))
        state = _own_wait(state, job, wish.goals)
    if not reasons:
        return set_entry(state, entry)  # the plan as it was still stands
    # A task is added when nothing else is open: it is no reason to try the same again at once.
    others = entry.reasons or any(not isinstance(wish, TaskAdded) for wish in entry.wishes)
    if wishes or (others and state.plans_while_acting):
        again = replace(
            entry,
            reasons=(*reasons, *entry.reasons),
            fruitless_replans=entry.fruitless_replans + 1,
        )
        return set_entry(state, again)
    if event.for_robots:
        entry = replace(entry, reasons=(*reasons, *entry.reasons))
        return _wait_with_plan(state, entry, job, event)
    to = GoalState.WAITING if event.postponed else GoalState.FAILED
    state = give_up(state, entry, event.reason, to)
    return _own_given_up_waits(state, job, entry.plan.goals)


def _out(state: State) -> str:
    """Who is out, as somebody has drained it, its battery is empty, or nobody knows yet what its
    hand holds: to be added to a sentence."""
    drained = (
        f"; {robot} is {hold}" for robot, hold in drains(state).items() if state.drained(robot)
    )
    empty = (f"; the battery of {r} is empty" for r in state.robots if state.is_empty(r))
    unknown = (
        f"; what {robot} has in its hand is not known yet"
        for robot, spec in state.robots.items()
        if state.logic >= OUT_SINCE_LOGIC
        and state.connected.get(robot)
        and "grip" in spec.capabilities
        and state.fact(HOLDING, robot) is None
    )
    return "".join((*drained, *empty, *unknown))


def _away(state: State) -> str:
    """The first few robots that are away, and how many more: what waits may wait for them."""
    away = sorted(robot for robot in state.robots if not state.connected.get(robot))
    if state.logic < AWAY_SINCE_LOGIC or not away:
        return ""
    more = f" and {len(away) - MOST_AWAY} more" if len(away) > MOST_AWAY else ""
    return f"; away: {', '.join(away[:MOST_AWAY])}{more}"


def _wait_for_robots(state: State, job: PlanningJob, goals: Mapping[str, str]) -> State:
    """Goals that only a robot which is not there can help with wait for one, with the reason."""
    for goal, reason in goals.items():
        state = mark_goals(state, (goal,), GoalState.WAITING, None, reason)
        waiting = state.waiting_for_robots.set(goal, job.team_number)
        state = replace(state, waiting_for_robots=waiting)
    return state


def _own_wait(state: State, job: PlanningJob, goals: Iterable[str]) -> State:
    """What the planner wants itself, and found no plan for, is planned again when there are other
    robots or ways: there is nobody who would ask for it."""
    if state.logic < OUT_SINCE_LOGIC:
        return state
    for goal in goals:
        status = state.goal_states.get(goal)
        if not is_own(state, goal) or status is None or status.state in _HAD:
            continue
        waiting = state.waiting_for_robots.set(goal, job.team_number)
        state = replace(state, waiting_for_robots=waiting)
        for robot in state.goals[goal].by:  # somebody may have charged it meanwhile
            state = touch(state, Touch(Part.FACT, FactKey(CHARGE, robot)))
    return state


def _own_given_up_waits(state: State, job: PlanningJob, goals: Iterable[str]) -> State:
    """The same of what was given up: it is wanted all the same."""
    return state if state.logic < KEPT_SINCE_LOGIC else _own_wait(state, job, goals)


def _wait_with_plan(
    state: State, entry: PlanEntry, job: PlanningJob, event: events.PlanningFailed
) -> State:
    """A plan that only robots which are not there could go on with waits for them."""
    plan = entry.plan
    hopeless = [g for g in open_goals(state, entry) if g in job.goals and g not in event.for_robots]
    for goal in hopeless:
        state = mark_goals(state, (goal,), GoalState.FAILED, plan.plan, event.reason)
        plan = without_goal(state, plan, goal)
    state = _own_given_up_waits(state, job, hopeless)
    state = mark_goals(state, plan.goals, GoalState.WAITING, plan.plan, event.reason)
    entry = replace(entry, plan=plan, waits_for_team=job.team_number, reason=event.reason)
    return set_entry(state, entry)
