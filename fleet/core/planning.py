"""Requests for plans, and what becomes of planning jobs."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from fleet.core.state import Job, PlanBook, State, put, without
from fleet.core.telling import active_plan_of, mark_goals
from keyexpr_schema.goals import ENDED_GOALS, GoalState
from keyexpr_schema.ids import ACTOR_PREFIX
from keyexpr_schema.plans import Plan, PlanState, Task, Violation
from keyexpr_schema.requests import Answer, Control, ControlRequest
from keyexpr_schema.tasks import TaskRecord, TaskState

MAX_REPLANS = 8
"""After this many new revisions a plan is given up: the world does not go along with it."""


def answer(
    state: State,
    request: str | None,
    accepted: bool,
    sentence: str,
    plan: str | None = None,
    violations: tuple[Violation, ...] = (),
) -> State:
    """Answer a request; no request, no answer."""
    if request is None:
        return state
    reply = Answer(
        request=request, accepted=accepted, sentence=sentence, plan=plan, violations=violations
    )
    return replace(state, answers=put(state.answers, request, reply))


def set_book(state: State, book: PlanBook) -> State:
    """Change what is kept of a plan."""
    return replace(
        state, plans=put(state.plans, book.plan.plan, replace(book, changed_s=state.time_s))
    )


def plan_asked(state: State, event: events.PlanAsked) -> State:
    """Start to plan for the goals asked for, or say why not."""
    ask = event.request
    if ask.request in state.answers or any(
        book.job is not None and book.job.request == ask.request for book in state.plans.values()
    ):
        return state
    goals = ask.goals or tuple(
        goal
        for goal in sorted(state.goals, key=lambda g: (state.goals[g].ordinal, g))
        if state.goal_states[goal].state is GoalState.WAITING and not active_plan_of(state, goal)
    )
    if reason := _why_not_plan(state, ask.plan, goals):
        return answer(state, ask.request, False, reason)
    name = ask.plan or _new_plan_name(state)
    job = Job(
        job=state.jobs + 1,
        plan=name,
        revision=1,
        goals=goals,
        strategy=ask.strategy,
        planner=ask.planner,
        allocator=ask.allocator,
        first_task=1,
        request=ask.request,
    )
    empty = Plan(
        plan=name,
        goals=goals,
        conditions=(),
        tasks=(),
        strategy=ask.strategy,
        made_by=ask.planner,
        allocator=ask.allocator,
        autostart=ask.start,
    )
    book = PlanBook(
        plan=empty, state=PlanState.PLANNING, planner=ask.planner, start=ask.start, job=job
    )
    return set_book(replace(state, jobs=job.job), book)


def _why_not_plan(state: State, plan: str | None, goals: tuple[str, ...]) -> str | None:
    if not goals:
        return "there is no goal that waits for a plan; add one first"
    if plan is not None and (plan in state.plans or plan in state.past_plans):
        return f"there is a plan {plan} already; choose another name or delete it"
    for goal in goals:
        if goal not in state.goals:
            known = ", ".join(sorted(state.goals)) or "none"
            return f"there is no goal {goal}; known are {known}"
        status = state.goal_states[goal]
        if status.state in ENDED_GOALS:
            return f"goal {goal} is {status.state.value}" + (
                f": {status.reason}" if status.reason else ""
            )
        if other := active_plan_of(state, goal):
            return f"goal {goal} is already in plan {other}"
    return None


def _new_plan_name(state: State) -> str:
    number = 1
    while f"plan-{number}" in state.plans or f"plan-{number}" in state.past_plans:
        number += 1
    return f"plan-{number}"


def plan_proposed(state: State, event: events.PlanProposed) -> State:
    """Take a plan that someone put into planning: it is checked and allocated like any other."""
    plan = event.plan
    if plan.plan in state.plans or plan.plan in state.past_plans:
        return state
    job = Job(
        job=state.jobs + 1,
        plan=plan.plan,
        revision=plan.revision,
        goals=plan.goals,
        strategy=plan.strategy,
        planner="symbolic",
        allocator=plan.allocator,
        first_task=1,
        proposal=plan,
    )
    book = PlanBook(plan=plan, state=PlanState.PLANNING, start=plan.autostart, job=job)
    return set_book(replace(state, jobs=job.job), book)


def replan_asked(state: State, event: events.ReplanAsked) -> State:
    """Plan again from what is known now."""
    ask = event.request
    if ask.request in state.answers:
        return state
    book = state.plans.get(ask.plan)
    if book is None:
        return answer(state, ask.request, False, _no_plan(state, ask.plan))
    if book.state is not PlanState.RUNNING:
        return answer(
            state, ask.request, False, f"plan {ask.plan} is {book.state.value}, not running"
        )
    state = set_book(state, replace(book, replan_reason=ask.reason))
    return answer(state, ask.request, True, f"plan {ask.plan} is made again", ask.plan)


def _no_plan(state: State, plan: str) -> str:
    return f"there is no plan {plan}; known are {', '.join(sorted(state.plans)) or 'none'}"


def control_asked(state: State, event: events.ControlAsked) -> State:
    """Start, cancel, delete or extend a plan, or say why not."""
    ask = event.request
    if ask.request in state.answers:
        return state
    book = state.plans.get(ask.plan)
    if book is None:
        return answer(state, ask.request, False, _no_plan(state, ask.plan))
    if ask.control is Control.START:
        if book.state is not PlanState.READY:
            return answer(
                state,
                ask.request,
                False,
                f"plan {ask.plan} is {book.state.value}; only a ready plan can be started",
            )
        state = set_book(state, replace(book, state=PlanState.RUNNING, start=True))
        state = mark_goals(state, book.plan.goals, GoalState.RUNNING, ask.plan)
        return answer(state, ask.request, True, f"plan {ask.plan} is running", ask.plan)
    if ask.control is Control.CANCEL:
        if book.ended:
            return answer(state, ask.request, False, f"plan {ask.plan} is {book.state.value}")
        state = set_book(state, replace(book, cancelling=True, job=None))
        return answer(state, ask.request, True, f"plan {ask.plan} is being cancelled", ask.plan)
    if ask.control is Control.DELETE:
        if not book.ended and book.state is not PlanState.READY:
            return answer(
                state,
                ask.request,
                False,
                f"plan {ask.plan} is {book.state.value}; cancel it before deleting it",
            )
        state = mark_goals(state, book.plan.goals, GoalState.WAITING, None)
        state = replace(state, plans=without(state.plans, ask.plan))
        return answer(state, ask.request, True, f"plan {ask.plan} is deleted")
    return _add_task(state, book, ask)


def _add_task(state: State, book: PlanBook, ask: ControlRequest) -> State:
    if book.state not in (PlanState.READY, PlanState.RUNNING):
        sentence = f"plan {ask.plan} is {book.state.value}; tasks go to ready or running plans"
        return answer(state, ask.request, False, sentence)
    if ask.skill is None:
        return answer(state, ask.request, False, "the request names no skill for the new task")
    if book.amendment is not None or book.job is not None:
        sentence = f"plan {ask.plan} is being changed; add the task when that is done"
        return answer(state, ask.request, False, sentence)
    for before in ask.after:
        if before not in book.records:
            sentence = (
                f"the new task cannot wait for {before}: plan {ask.plan} has "
                f"{', '.join(book.records) or 'no tasks'}"
            )
            return answer(state, ask.request, False, sentence)
    number = _next_task(book)
    task = Task(
        task=f"t{number}",
        skill=ask.skill,
        args={"robot": f"{ACTOR_PREFIX}x{number}", **ask.args},
        actor=f"x{number}",
        after=ask.after,
    )
    pins = put(book.plan.pins, task.actor, ask.robot) if ask.robot else book.plan.pins
    book = replace(
        book,
        plan=replace(book.plan, pins=pins),
        amendment=task,
        replan_reason=f"task {task.task} is added",
    )
    state = set_book(state, book)
    return answer(
        state, ask.request, True, f"task {task.task} is being added to {ask.plan}", ask.plan
    )


def _next_task(book: PlanBook) -> int:
    return 1 + max((int(name[1:]) for name in book.records if name[1:].isdigit()), default=0)


def plan_again(state: State, book: PlanBook) -> State:
    """Start the planning job of the next revision; nothing of the plan is outstanding."""
    if book.replans >= MAX_REPLANS:
        return give_up(
            state, book, f"given up after {book.replans} new plans; the last: {book.replan_reason}"
        )
    revision = book.plan.revision + 1
    job = Job(
        job=state.jobs + 1,
        plan=book.plan.plan,
        revision=revision,
        goals=book.plan.goals,
        strategy=book.plan.strategy,
        planner=book.planner,
        allocator=book.plan.allocator,
        first_task=_next_task(book),
        proposal=_amended(book, revision) if book.amendment is not None else None,
    )
    return set_book(replace(state, jobs=job.job), replace(book, job=job))


def _amended(book: PlanBook, revision: int) -> Plan:
    """The tasks still to be done and the added one, as a proposal of the next revision."""
    assert book.amendment is not None
    rest = [*book.plan.tasks, book.amendment]
    todo = {
        task.task
        for task in rest
        if task.task not in book.records or book.records[task.task].state is TaskState.WAITING
    }
    tasks = tuple(
        replace(task, after=tuple(before for before in task.after if before in todo))
        for task in rest
        if task.task in todo
    )
    actors = {task.actor for task in tasks}
    pins = {
        record.actor: record.robot
        for record in book.records.values()
        if record.state is TaskState.SUCCEEDED and record.actor in actors and record.robot
    }
    return replace(book.plan, revision=revision, tasks=tasks, pins={**pins, **book.plan.pins})


def plan_made(state: State, event: events.PlanMade) -> State:
    """Take over a finished plan: its tasks wait; what an older revision had left is cancelled."""
    book = state.plans.get(event.plan.plan)
    if book is None or book.job is None or book.job.job != event.job:
        return state
    job = book.job
    plan = replace(event.plan, autostart=book.start)
    records = {
        name: record
        if record.state in (TaskState.SUCCEEDED, TaskState.FAILED, TaskState.CANCELLED)
        else replace(record, state=TaskState.CANCELLED, reason="not in the new plan")
        for name, record in book.records.items()
    }
    for task in plan.tasks:
        records[task.task] = TaskRecord(
            plan=plan.plan,
            revision=plan.revision,
            task=task.task,
            skill=task.skill,
            args={
                name: event.allocation.get(value.removeprefix(ACTOR_PREFIX), value)
                if value.startswith(ACTOR_PREFIX)
                else value
                for name, value in task.args.items()
            },
            actor=task.actor,
            robot=event.allocation[task.actor],
            state=TaskState.WAITING,
            after=task.after,
            behind=event.extra_after.get(task.task, ()),
            goal=task.goal,
            duration_s=event.durations_s.get(task.task, task.duration_s),
        )
    running = book.start and not book.cancelling
    book = replace(
        book,
        plan=plan,
        state=PlanState.RUNNING if running else PlanState.READY,
        records=records,
        allocation=event.allocation,
        sequence=event.sequence,
        job=None,
        replan_reason=None,
        amendment=None,
        replans=book.replans + (plan.revision > 1),
        reason=None,
        violations=(),
        makespan_s=event.makespan_s,
        planning_time_s=event.planning_time_s,
    )
    state = set_book(state, book)
    state = mark_goals(
        state, plan.goals, GoalState.RUNNING if running else GoalState.PLANNED, plan.plan
    )
    return answer(
        state,
        job.request,
        True,
        f"plan {plan.plan} has {len(plan.tasks)} tasks for {len(plan.goals)} goals",
        plan.plan,
    )


def plan_not_made(state: State, event: events.PlanNotMade) -> State:
    """A job failed: a first plan is rejected, a running one goes on or is given up."""
    book = next(
        (b for b in state.plans.values() if b.job is not None and b.job.job == event.job), None
    )
    if book is None or book.job is None:
        return state
    request = book.job.request
    book = replace(
        book,
        job=None,
        violations=event.violations,
        planning_time_s=event.planning_time_s,
    )
    if book.amendment is not None:
        # The plan as it was still stands; only the addition is refused.
        book = replace(
            book,
            amendment=None,
            replan_reason=None,
            reason=f"task {book.amendment.task} was not added: {event.reason}",
        )
        return set_book(state, book)
    if book.plan.revision == 1 and not book.records:
        book = replace(book, state=PlanState.REJECTED, reason=event.reason)
        state = set_book(state, book)
        state = mark_goals(state, book.plan.goals, GoalState.WAITING, None, event.reason)
        return answer(state, request, False, event.reason, book.plan.plan, event.violations)
    return give_up(state, book, event.reason)


def give_up(state: State, book: PlanBook, reason: str) -> State:
    """End a plan as failed, and with it those of its goals that are not reached."""
    records = {
        name: record
        if record.state is not TaskState.WAITING
        else replace(record, state=TaskState.CANCELLED, reason="the plan failed")
        for name, record in book.records.items()
    }
    book = replace(
        book, state=PlanState.FAILED, reason=reason, replan_reason=None, records=records, job=None
    )
    state = set_book(state, book)
    return mark_goals(state, book.plan.goals, GoalState.FAILED, book.plan.plan, reason)
