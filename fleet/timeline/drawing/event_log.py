"""The event log: what a payload says, as a sentence and a level."""

from __future__ import annotations

from collections.abc import Iterator

from fleet.timeline.drawing.gantt import call_text
from keyexpr_schema.facts import render_value
from keyexpr_schema.payloads.closures import Closure
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.plans import Plan, PlanState, PlanStatus
from keyexpr_schema.payloads.robots import RobotActivity, RobotSpec, RobotState
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.stops import Stop, StopRelease
from keyexpr_schema.payloads.system import UndecodableValue
from keyexpr_schema.payloads.tasks import Order, Report, ReportState, TaskRecord, TaskState, Try
from keyexpr_schema.payloads.world import Fact

INFO, WARN, ERROR = "INFO", "WARN", "ERROR"

_ENDS = {
    ReportState.SUCCEEDED: INFO,
    ReportState.CANCELLED: INFO,  # somebody wanted that
    ReportState.INTERRUPTED: WARN,
}

Line = tuple[str, str]
"""`(level, sentence)`."""


def goal(now: Goal, before: Goal | None) -> Iterator[Line]:
    """A goal was given or changed."""
    what = f"goal {now.goal}: “{now.text}”"
    if before is None:
        yield INFO, what
    elif before != now:
        yield INFO, f"{what} (changed)"


def goal_status(now: GoalStatus, before: GoalStatus | None) -> Iterator[Line]:
    """A goal moved on."""
    if before is not None and (before.state, before.reason) == (now.state, now.reason):
        return
    bad = now.state in (GoalState.FAILED, GoalState.REJECTED)
    means = ""
    if now.conditions and (before is None or before.conditions != now.conditions):
        means = f"; it means {', '.join(map(str, now.conditions))}"
    yield ERROR if bad else INFO, f"goal {now.goal} is {now.state.value}{_why(now.reason)}{means}"


def plan(now: Plan, before: Plan | None) -> Iterator[Line]:
    """A plan was made or made again."""
    if before is not None and before.revision == now.revision and before.tasks == now.tasks:
        return
    again = before is not None or now.revision > 1
    what = f"plan {now.plan} revision {now.revision}" if again else f"plan {now.plan}"
    actors = {task.actor for task in now.tasks}
    yield (
        WARN if again else INFO,
        f"{what}: {len(now.tasks)} tasks, {len(actors)} actors for "
        f"{', '.join(now.goals) or 'no goal'}, by {now.made_by} ({now.strategy})",
    )


def plan_status(now: PlanStatus, before: PlanStatus | None) -> Iterator[Line]:
    """A plan moved on, or its actors went to other robots."""
    if before is None or (before.state, before.reason) != (now.state, now.reason):
        bad = now.state in (PlanState.FAILED, PlanState.REJECTED)
        yield ERROR if bad else INFO, f"plan {now.plan} is {now.state.value}{_why(now.reason)}"
    if now.allocation and (before is None or before.allocation != now.allocation):
        who = ", ".join(f"{actor} → {robot}" for actor, robot in sorted(now.allocation.items()))
        yield INFO, f"plan {now.plan} allocates {who}"
    for violation in (
        now.violations if before is None or before.violations != now.violations else ()
    ):
        yield ERROR, f"plan {now.plan}: {violation.sentence}"


def task_record(now: TaskRecord, before: TaskRecord | None) -> Iterator[Line]:
    """A task ended badly, or changed hands. Orders and reports have the rest."""
    if before is not None and before.robot and now.robot and before.robot != now.robot:
        yield WARN, f"task {now.task} goes from {before.robot} to {now.robot}"
    if before is not None and before.state is now.state:
        return
    if now.state in (TaskState.FAILED, TaskState.CANCELLED):
        what = call_text(now.skill, now.args, now.robot)
        level = ERROR if now.state is TaskState.FAILED else INFO
        yield level, f"task {now.task} ({what}) is {now.state.value}{_why(now.reason)}"


def order(now: Order, before: Order | None) -> Iterator[Line]:
    """An order was given or cancelled."""
    fence = (now.epoch, now.revision, now.attempt)
    if before is None or (before.epoch, before.revision, before.attempt) != fence:
        attempt = f", attempt {now.attempt}" if now.attempt > 1 else ""
        what = call_text(now.skill, now.args, now.robot)
        yield INFO, f"{now.robot} shall {what} ({now.task}{attempt})"
        if now.program is not None:
            yield INFO, f"program of {now.task}:\n{now.program.code.rstrip()}"
        before = None
    if now.cancelled and not (before is not None and before.cancelled):
        yield INFO, f"{now.robot} shall stop {now.task}"


def tries(now: Report, before: Report | None, what: str) -> Iterator[tuple[float, Line]]:
    """Each failed try of an attempt at `what` that is news: when it ended [s], and why."""
    known = len(before.tries) if before is not None else 0
    for one in now.tries[known:]:
        if one.reason is not None:
            sentence = f"{now.robot}: {what}, try {one.number} failed: {one.reason}"
            yield one.ended_s, (INFO if now.state is ReportState.CANCELLED else WARN, sentence)


def calls(now: Report, before: Report | None) -> Iterator[tuple[float, Line]]:
    """Each call of a program that is news: when it ended [s], and what it gave."""
    known = len(before.program.calls) if before is not None and before.program is not None else 0
    for one in now.program.calls[known:] if now.program is not None else ():
        call = f"{one.name}({', '.join(render_value(value) for value in one.args.values())})"
        gave = f" failed: {one.reason}" if one.reason is not None else ""
        if one.name == "ask":
            gave = f" = {render_value(one.result)}"
        level = INFO if one.reason is None else WARN
        yield one.ended_s, (level, f"{now.robot}: program line {one.line}: {call}{gave}")


def report(now: Report, before: Report | None, what: str) -> Iterator[Line]:
    """A robot reported on an attempt at `what`."""
    if before is not None and before.state is now.state:
        return
    if now.state is ReportState.STARTED:
        yield INFO, f"{now.robot} started {what}"
        return
    good = now.state is ReportState.SUCCEEDED
    count = f" at try {len(now.tries)}" if good and len(now.tries) > 1 else ""
    why = "" if good else _why(now.reason or _last(now.tries))
    yield _ENDS.get(now.state, ERROR), f"{now.robot}: {what} {now.state.value}{count}{why}"


def fact(now: Fact, before: Fact | None) -> Iterator[Line]:
    """A fact that is new, or has another value."""
    if before is not None and before.value == now.value:
        return
    was = f" (was {render_value(before.value)})" if before is not None else ""
    yield INFO, f"{now.source} says {now.literal}{was}"


def robot_spec(now: RobotSpec, before: RobotSpec | None) -> Iterator[Line]:
    """A robot was registered."""
    if before != now:
        yield INFO, f"{now.robot} ({now.model}) can {', '.join(now.skills) or 'do nothing'}"


def robot_state(now: RobotState, before: RobotState | None) -> Iterator[Line]:
    """A worker began anew or ended, or its robot is being recovered or obeys an emergency stop.

    One that begins where none was, or the one before has ended, is as it should be.
    """
    begins = before is None or before.activity is RobotActivity.STOPPED
    if before is not None and before.incarnation != now.incarnation:
        yield INFO if begins else WARN, f"{now.robot}'s worker started anew"
    if before is None or before.activity is not now.activity:
        if now.activity is RobotActivity.RECOVERING:
            yield INFO if begins else WARN, f"{now.robot} is recovering"
        elif now.activity is RobotActivity.STOPPED:
            yield INFO, f"{now.robot}'s worker has ended"
    held = before.stops if before is not None else ()
    if now.stops and not held:
        yield WARN, f"{now.robot} is at rest by emergency stop {', '.join(now.stops)}"
    elif held and not now.stops:
        yield INFO, f"{now.robot} may move again"


def truth(now: Truth, before: Truth | None) -> Iterator[Line]:
    """An object really changed place, support or hand."""
    if now.held_by is None and not now.settled:
        return
    if before is not None and (before.place, before.support, before.held_by) == (
        now.place,
        now.support,
        now.held_by,
    ):
        return
    if now.held_by is not None:
        where = f"in the hand of {now.held_by}"
    else:
        where = f"on {now.support}" if now.support else "in mid-air"
    yield (
        INFO,
        f"in truth {now.object} is {where}, {f'in {now.place}' if now.place else 'in no place'}",
    )


def stop(now: Stop | None, before: Stop | None) -> Iterator[Line]:
    """An emergency stop was given, or is over."""
    if now is not None and before is None:
        whom = ", ".join(now.robots) or "all robots"
        yield ERROR, f"{now}: {whom}"
    elif now is None and before is not None:
        yield INFO, f"emergency stop {before.stop} is over"


def stop_release(now: StopRelease | None, before: StopRelease | None) -> Iterator[Line]:
    """A robot may move again, though a stop goes on for others."""
    if now is not None and before is None:
        whom = f" by {now.by}" if now.by else ""
        yield INFO, f"{now.robot} is released from emergency stop {now.stop}{whom}"


def hold(now: Hold | None, before: Hold | None) -> Iterator[Line]:
    """A pause or a drain began, or is over."""
    one = now or before
    if one is None or now == before:
        return
    names = (*one.robots, *one.plans, *one.schedules)
    whom = ", ".join(names) or "the whole fleet"
    verb = "are" if names[1:] else "is"
    if now is not None:
        yield WARN, f"{whom} {verb} {now}"
    else:
        done = "drained" if one.kind is HoldKind.DRAIN else "paused"
        yield INFO, f"{whom} {verb} {done} no more"


def closure(now: Closure | None, before: Closure | None) -> Iterator[Line]:
    """A part of the floor was closed, or is open again."""
    if now is not None and now != before:
        yield WARN, str(now)
    elif now is None and before is not None:
        yield INFO, f"{' and '.join(before.names) or 'a part of the floor'} is open again"


def undecodable(now: UndecodableValue, before: UndecodableValue | None) -> Iterator[Line]:
    """A value could not be read."""
    if before is None or before.reason != now.reason:
        yield ERROR, f"{now.component} could not read {now.keyexpr}: {now.reason}"


def _why(reason: str | None) -> str:
    return f": {reason}" if reason else ""


def _last(tries: tuple[Try, ...]) -> str | None:
    return tries[-1].reason if tries else None
