"""Work in progress: what reports mean, which tasks are ready, when a plan is done."""

from __future__ import annotations

from collections.abc import Mapping

from msgspec.structs import replace

from fleet.core import events
from fleet.core.effects import PLANNER_SOURCE
from fleet.core.planning import give_up, plan_again, set_book
from fleet.core.skills import Action, SkillModel
from fleet.core.state import OUTSTANDING, PlanBook, State, put
from fleet.core.telling import believe, believe_if_newer, mark_goals
from fleet.core.world_model import WorldModel, first_unmet, room_left
from keyexpr_schema.goals import GoalState
from keyexpr_schema.plans import PlanState
from keyexpr_schema.tasks import ENDED_TASKS, Report, ReportState, TaskRecord, TaskState
from keyexpr_schema.world import Fact

Skills = Mapping[str, SkillModel]

MAX_ATTEMPTS = 3
"""Orders given for one task to one robot; each order has the worker's own tries inside."""
LOST_AFTER_S = 30.0
"""A robot whose worker is gone for longer (wall time, s) counts as lost. A supervisor restarts a
crashed worker within a few seconds; a person would not wait longer than this."""


def report_told(state: State, event: events.ReportTold, skills: Skills) -> State:
    """Take in what a worker says; a report of an attempt that is not current only brings facts."""
    report = event.report
    for fact in report.facts:
        state = believe_if_newer(state, fact)
    book = state.plans.get(report.plan)
    record = book.records.get(report.task) if book else None
    if (
        book is None
        or record is None
        or record.state not in OUTSTANDING
        or (report.robot, report.attempt) != (record.robot, record.attempt)
    ):
        return state
    match report.state:
        case ReportState.STARTED:
            if record.state is TaskState.RUNNING:
                return state
            record = replace(record, state=TaskState.RUNNING, started_s=report.started_s)
            return _set_record(state, book, record)
        case ReportState.SUCCEEDED:
            return _succeeded(state, book, record, report, skills)
        case ReportState.CANCELLED:
            return _set_record(state, book, _ended(record, report, TaskState.CANCELLED))
        case ReportState.FAILED:
            return _failed(state, book, record, report)
        case ReportState.INTERRUPTED:
            return _interrupted(state, book, record, report, skills)
        case ReportState.REFUSED:
            if report.retryable and record.attempt < MAX_ATTEMPTS:
                return _set_record(state, book, _again(record, report))
            return _failed(state, book, record, report)


def _ended(record: TaskRecord, report: Report, to: TaskState) -> TaskRecord:
    return replace(
        record,
        state=to,
        tries=(*record.tries, *report.tries),
        reason=report.reason,
        started_s=record.started_s if report.started_s is None else report.started_s,
        ended_s=report.ended_s,
    )


def _again(record: TaskRecord, report: Report) -> TaskRecord:
    return replace(
        record,
        state=TaskState.WAITING,
        tries=(*record.tries, *report.tries),
        reason=report.reason,
    )


def _set_record(state: State, book: PlanBook, record: TaskRecord) -> State:
    return set_book(state, replace(book, records=put(book.records, record.task, record)))


def _succeeded(
    state: State, book: PlanBook, record: TaskRecord, report: Report, skills: Skills
) -> State:
    told = {(fact.relation, fact.subject) for fact in report.facts}
    action = _action(record, skills)
    for literal in action.after if action is not None else ():
        if tuple(literal.variable) not in told:
            state = believe(
                state,
                Fact(
                    subject=literal.variable.subject,
                    relation=literal.variable.relation,
                    value=literal.value,
                    source=PLANNER_SOURCE,
                    time_s=report.ended_s or state.time_s,
                ),
            )
    return _set_record(state, book, _ended(record, report, TaskState.SUCCEEDED))


def _failed(state: State, book: PlanBook, record: TaskRecord, report: Report) -> State:
    record = _ended(record, report, TaskState.FAILED)
    book = replace(book, replan_reason=f"{record.task} ({record.skill}) failed: {report.reason}")
    return _set_record(state, book, record)


def _interrupted(
    state: State, book: PlanBook, record: TaskRecord, report: Report, skills: Skills
) -> State:
    """A worker came back in the middle of an attempt: the world decides what it is worth."""
    action = _action(record, skills)
    if action is None:
        return _failed(state, book, record, report)
    world = state.world(skills)
    if all(world.value(*literal.variable) == literal.value for literal in action.after):
        record = _ended(record, report, TaskState.SUCCEEDED)
        return _set_record(state, book, replace(record, reason="found done after an interruption"))
    if unmet_before(action, world) is None and record.attempt < MAX_ATTEMPTS:
        return _set_record(state, book, _again(record, report))
    return _failed(state, book, record, report)


def _action(record: TaskRecord, skills: Skills) -> Action | None:
    """The task as a ground action; `None` if the planner was started without that skill."""
    skill = skills.get(record.skill)
    if skill is None or set(skill.parameters) != set(record.args):
        return None
    return skill.ground(record.args)


def unmet_before(action: Action, world: WorldModel) -> str | None:
    """The first precondition that the facts do not grant, as a phrase, or `None`."""
    literal = first_unmet(action, world.facts, world)
    if literal is not None:
        has = world.value(*literal.variable)
        told = "unknown" if has is None else f"{has}"
        return f"{literal.variable} should be {literal.value} and is {told}"
    for carrier in action.space_in:
        if room_left(carrier, world.facts, world) < 1:
            return f"there is no room in {carrier}'s basket"
    return None


def advance(state: State, skills: Skills) -> State:
    """Take every plan as far as it goes without news: orders, replans, ends."""
    state = _fail_tasks_of_lost_robots(state)
    for plan in sorted(state.plans, key=lambda name: _priority(state, name)):
        book = state.plans[plan]
        if book.cancelling and not book.ended:
            state = _cancel(state, book)
        elif book.job is None and book.replan_reason is not None and not book.ended:
            if not book.outstanding():
                state = plan_again(state, book)
        elif book.state is PlanState.RUNNING and book.job is None:
            state = _run(state, book, skills)
    return state


def _priority(state: State, plan: str) -> tuple[int, str]:
    goals = [state.goals[g] for g in state.plans[plan].plan.goals if g in state.goals]
    return -max((goal.priority for goal in goals), default=0), plan


def _cancel(state: State, book: PlanBook) -> State:
    if book.outstanding():
        return state  # their orders now say `cancelled`; the workers' reports bring us back here
    records = {
        name: record
        if record.state in ENDED_TASKS
        else replace(record, state=TaskState.CANCELLED, reason="the plan was cancelled")
        for name, record in book.records.items()
    }
    book = replace(
        book, state=PlanState.CANCELLED, cancelling=False, records=records, replan_reason=None
    )
    state = set_book(state, book)
    return mark_goals(
        state, book.plan.goals, GoalState.WAITING, None, f"plan {book.plan.plan} was cancelled"
    )


def _run(state: State, book: PlanBook, skills: Skills) -> State:
    state = _mark_reached(state, book, skills)
    current = list(book.current())
    if all(record.state is TaskState.SUCCEEDED for record in current):
        world = state.world(skills)
        unmet = [c for c in book.plan.conditions if not world.holds(c)]
        if not unmet:
            return set_book(state, replace(book, state=PlanState.SUCCEEDED))
        reason = f"every task is done, and {unmet[0]} does not hold"
        return advance(set_book(state, replace(book, replan_reason=reason)), skills)
    if any(record.state in (TaskState.FAILED, TaskState.CANCELLED) for record in current):
        return give_up(state, book, "a task of the plan was cancelled or failed")
    for record in current:
        if record.state is TaskState.WAITING:
            state = _dispatch(state, book.plan.plan, record, skills)
            if state.plans[book.plan.plan].replan_reason is not None:
                return advance(state, skills)
    return state


def _mark_reached(state: State, book: PlanBook, skills: Skills) -> State:
    """A goal is reached when all its tasks are done and its conditions hold."""
    world = state.world(skills)
    open_goals = {
        record.goal for record in book.current() if record.state is not TaskState.SUCCEEDED
    }
    for goal in book.plan.goals:
        status = state.goal_states.get(goal)
        if (
            status is not None
            and goal not in open_goals
            and all(world.holds(condition) for condition in status.conditions)
        ):
            state = mark_goals(state, (goal,), GoalState.REACHED, book.plan.plan)
    return state


def _dispatch(state: State, plan: str, record: TaskRecord, skills: Skills) -> State:
    """Order a waiting task if nothing holds it back; replan if the world is not as it must be."""
    book = state.plans[plan]
    befores = (*record.after, *record.behind)
    if any(
        book.records[before].state is not TaskState.SUCCEEDED
        for before in befores
        if before in book.records
    ):
        return state
    action = _action(record, skills)
    if action is None:
        reason = f"{record.task} cannot start: there is no skill {record.skill} any more"
        return give_up(state, book, reason)
    if not all(_free(state, robot, plan, record) for robot in action.participants):
        return state
    if (unmet := unmet_before(action, state.world(skills))) is not None:
        reason = f"{record.task} ({record.skill}) cannot start: {unmet}"
        return set_book(state, replace(book, replan_reason=reason))
    ordered = replace(
        record,
        state=TaskState.ORDERED,
        attempt=record.attempt + 1,
        ordered_s=state.time_s if record.ordered_s is None else record.ordered_s,
    )
    return _set_record(state, book, ordered)


def _free(state: State, robot: str, plan: str, record: TaskRecord) -> bool:
    """Whether a robot is connected and neither works now nor is in the middle of other work.

    An actor that has begun keeps its robot until it has ended: between a pick and its place no
    other plan may have the hand.
    """
    if not state.alive.get(robot):
        return False
    for book in state.plans.values():
        begun: set[str] = set()
        unfinished: set[str] = set()
        for other in book.records.values():
            if robot not in (other.robot, *other.args.values()):
                continue
            if other.state in OUTSTANDING:
                return False
            if other.robot == robot and not book.ended:
                if other.state is TaskState.SUCCEEDED:
                    begun.add(other.actor)
                elif other.state is TaskState.WAITING:
                    unfinished.add(other.actor)
        if book.plan.plan != plan and begun & unfinished:
            return False
    return True


def _fail_tasks_of_lost_robots(state: State) -> State:
    for robot, since in state.gone_since.items():
        if state.wall_time_s - since < LOST_AFTER_S:
            continue
        reason = f"robot {robot} has been away for {LOST_AFTER_S:g} s"
        if robot not in state.robots:
            reason = f"robot {robot} was unregistered"
        for book in state.plans.values():
            if book.ended or not _needs(book, robot):
                continue
            records = {
                name: replace(record, state=TaskState.FAILED, reason=reason)
                if record.state in OUTSTANDING and robot in (record.robot, *record.args.values())
                else record
                for name, record in book.records.items()
            }
            if records != book.records or book.replan_reason is None:
                state = set_book(state, replace(book, records=records, replan_reason=reason))
    return state


def _needs(book: PlanBook, robot: str) -> bool:
    return any(
        record.state not in ENDED_TASKS and robot in (record.robot, *record.args.values())
        for record in book.current()
    )


def next_timer(state: State) -> float | None:
    """The Unix time [s] at which a robot that is away becomes lost, if a plan needs it."""
    times = [
        since + LOST_AFTER_S
        for robot, since in state.gone_since.items()
        if any(_needs(book, robot) and not book.ended for book in state.plans.values())
    ]
    return min(times, default=None)
