"""The chain of reasons behind a goal, a plan or a task, to its end.

Each says in `waits_for` what it waits for next; here these are followed through what is on the
keys: from a task to the one before it, to the robot that is busy, to the pause that holds that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import TYPE_CHECKING

from cli.client.closures import how_to_open
from cli.client.closures import in_words as closed_in_words
from cli.client.health import Health
from cli.client.holds import how_to_end, in_words
from cli.client.order_waits import waits_of_order
from cli.times import moment
from cli.views.text import seconds, skill_call, spent_s
from cli.why.deletions import is_being_cancelled, told_deletions
from cli.why.links import (
    Explained,
    how_ended,
    how_many_done,
    in_a_circle,
    iso_of,
    said_of,
    since_when,
    told_above,
    wrong_with,
)
from keyexpr_schema.ids import natural_order
from keyexpr_schema.payloads.goals import ENDED_GOALS, GoalState, GoalStatus
from keyexpr_schema.payloads.plans import ENDED_PLANS, PlanState
from keyexpr_schema.payloads.tasks import ENDED_TASKS, TaskRecord, TaskState
from keyexpr_schema.payloads.waits import WaitKind, WaitReason

if TYPE_CHECKING:
    from cli.client.fleet_view import FleetView
    from keyexpr_schema.payloads.audit import AuditEntry

_BY_A_TASK = frozenset({WaitKind.BUSY, WaitKind.LOST, WaitKind.CANCELLING, WaitKind.CHARGING})
LISTED = 6
"""So many tasks of a plan or a goal are followed; others are counted."""


class Chain:
    """Follows reasons through a view. What was told already is not told a second time, so that a
    circle ends."""

    def __init__(
        self, view: FleetView, health: Health, deletions: Mapping[str, AuditEntry] | None = None
    ) -> None:
        self._view, self._health, self._deletions = view, health, deletions or {}
        self._told: set[tuple[str, str]] = set()
        self._open: list[str] = []
        """Goals that are being told of now."""

    def goal(self, goal: str) -> Explained:
        """A goal."""
        status = self._view.goal_status.get(goal)
        name = f"goal {goal}"
        if status is None:
            return Explained(
                about=goal,
                kind="goal",
                sentence=f"{name} has been read by no planner yet",
                because=self._no_planner(),
            )
        if self._again("goal", goal):
            if goal in self._open and status.state is GoalState.PENDING:
                return in_a_circle(goal, status.state.value)
            return told_above("goal", goal, name, status.state.value)
        self._open.append(goal)
        explained = self._goal(goal, name, status)
        self._open.remove(goal)
        return explained

    def _goal(self, goal: str, name: str, status: GoalStatus) -> Explained:
        state = status.state
        because: tuple[Explained, ...] = ()
        if state is GoalState.RUNNING and status.plan is not None:
            tasks = [r for r in self._tasks(status.plan) if r.goal == goal]
            sentence = f"{name} is worked on in {status.plan}{how_many_done(tasks)}"
            plan = self._view.plan_status.get(status.plan)
            if plan is not None and is_being_cancelled(plan):
                sentence += f"; {status.plan} is being cancelled{said_of(plan.reason)}"
            because = self._under_way(status.plan, tasks)
        elif state in ENDED_GOALS and not status.waits_for:
            sentence = f"{name} {how_ended(status)}"
        elif state is GoalState.STANDING and not status.waits_for:
            sentence = f"{name} is kept until somebody deletes it{said_of(status.reason)}"
        else:
            sentence = f"{name} is {state.value}{since_when(status, ' since ')}"
            because = self._reasons(status.waits_for)
        return Explained(
            about=goal,
            kind="goal",
            sentence=sentence,
            state=state.value,
            since=iso_of(status.wall_time_s),
            because=because,
        )

    def plan(self, plan: str) -> Explained:
        """A plan."""
        status = self._view.plan_status.get(plan)
        name = f"plan {plan}"
        if status is None:
            return Explained(about=plan, kind="plan", sentence=f"{name} has no status yet")
        if self._again("plan", plan):
            return told_above("plan", plan, name, status.state.value)
        because: tuple[Explained, ...] = ()
        if status.state in ENDED_PLANS:
            sentence = f"{name} {how_ended(status)}"
        else:
            tasks = [r for r in self._tasks(plan) if r.state is not TaskState.CANCELLED]
            running = "runs" if status.state is PlanState.RUNNING else f"is {status.state.value}"
            sentence = f"{name} (revision {status.revision}) {running}{how_many_done(tasks)}"
            if is_being_cancelled(status):
                sentence += said_of(status.reason)
            because = self._reasons(status.waits_for)
            if status.state is PlanState.RUNNING:
                because += self._under_way(plan, tasks)
        because = told_deletions(self._view, plan, self._deletions) + because
        return Explained(
            about=plan,
            kind="plan",
            sentence=sentence,
            state=status.state.value,
            since=iso_of(status.wall_time_s),
            because=because,
        )

    def task(self, plan: str, task: str) -> Explained:
        """A task of a plan."""
        record, about = self._view.tasks.get((plan, task)), f"{plan}/{task}"
        if record is None:
            return Explained(
                about=about, kind="task", sentence=f"there is no task {about} any more"
            )
        call = skill_call(record.skill, record.args, record.robot)
        name, who = f"{about} {call}", record.robot or record.actor
        if self._again("task", about):
            return told_above("task", about, name, record.state.value)
        because: tuple[Explained, ...] = ()
        match record.state:
            case TaskState.SUCCEEDED:
                took = f", which took {seconds(spent_s(record, None))}" if record.started_s else ""
                sentence = f"{name} was done by {who}{since_when(record)}{took}"
                sentence += said_of(record.reason)
            case TaskState.FAILED | TaskState.CANCELLED:
                sentence = f"{name} {how_ended(record)}"
            case TaskState.WAITING:
                sentence = f"{name} by {who} waits"
                above = self._view.plan_status.get(plan) if ("plan", plan) in self._told else None
                told = above.waits_for if above is not None else ()
                because = self._reasons(r for r in record.waits_for if r not in told)
            case _:
                done = "is ordered of" if record.state is TaskState.ORDERED else "is being done by"
                waits = waits_of_order(record, self._view.robot_states, self._health.undecodable)
                rests = "" if waits else self._rests(record)
                sentence = f"{name} {done} {who}{since_when(record, ' since ')}{rests}"
                because = self._reasons(waits)
        return Explained(
            about=about,
            kind="task",
            sentence=sentence,
            state=record.state.value,
            since=iso_of(record.wall_time_s),
            because=because,
        )

    def _no_planner(self) -> tuple[Explained, ...]:
        """That no planner is there, and what is wrong with it and the store."""
        wrong = tuple(map(wrong_with, self._health.diagnostics))
        if self._health.planning:
            return wrong
        nobody = "no planner is connected"
        return (
            Explained(about="planner", kind="diagnostic", sentence=nobody, hint="robotctl planner"),
            *wrong,
        )

    def _again(self, kind: str, name: str) -> bool:
        known = (kind, name) in self._told
        self._told.add((kind, name))
        return known

    def _tasks(self, plan: str) -> list[TaskRecord]:
        records = self._view.records(plan)
        return [records[task] for task in sorted(records, key=natural_order)]

    def _rests(self, record: TaskRecord) -> str:
        """What the robot says of itself, where that is not what it is told to do."""
        state = self._view.robot_states.get(record.robot or "")
        if state is None:
            return ""
        if state.trouble is not None:
            return f"; {state.trouble}"
        if state.task is None and record.state is TaskState.ORDERED:
            return f"; {record.robot} says that it has begun nothing: it is {state.activity.value}"
        if state.task in (None, record.task):
            return ""
        return f"; {record.robot} says that it is at {state.plan}/{state.task}"

    def _under_way(self, plan: str, tasks: Iterable[TaskRecord]) -> tuple[Explained, ...]:
        """What runs of these tasks; where nothing does, what is next and waits."""
        open_ = [record for record in tasks if record.state not in ENDED_TASKS]
        shown = [record for record in open_ if record.state is not TaskState.WAITING]
        if not shown:
            first = [r for r in open_ if all(w.kind is not WaitKind.TASK for w in r.waits_for)]
            shown = first or open_[:1]
        return tuple(self.task(plan, record.task) for record in shown[:LISTED])

    def _reasons(self, reasons: Iterable[WaitReason]) -> tuple[Explained, ...]:
        return tuple(self._reason(reason) for reason in reasons)

    def _reason(self, reason: WaitReason) -> Explained:
        plan, task, kind = reason.plan, reason.task, reason.kind
        if kind is WaitKind.TASK and plan and task:
            return self.task(plan, task)
        if kind is WaitKind.GOAL and reason.goal:
            return self.goal(reason.goal)
        if kind is WaitKind.PLAN and plan:
            return self.plan(plan)
        because: tuple[Explained, ...] = ()
        if kind in _BY_A_TASK and plan and task:
            because = (self.task(plan, task),)
        elif kind is WaitKind.LEASE:
            because = self._no_planner()
        elif kind is WaitKind.CHARGING and reason.goal:
            because = (self.goal(reason.goal),)
        elif kind is WaitKind.RESERVED and plan:
            because = self._under_way(
                plan, (r for r in self._tasks(plan) if reason.robot in (r.robot, *r.args.values()))
            )
        sentence, since_s, hint = self._told_of(reason)
        return Explained(
            about=reason.robot or plan or reason.goal or "fleet",
            kind=kind.value,
            sentence=sentence,
            since=iso_of(since_s or reason.since_wall_s),
            hint=hint,
            because=because,
        )

    def _told_of(self, reason: WaitReason) -> tuple[str, float | None, str | None]:
        """A reason as a sentence, since when it is so, and what a person can do about it."""
        view, robot, plan, goal = self._view, reason.robot, reason.plan, reason.goal
        match reason.kind:
            case WaitKind.STOPPED if reason.stop in view.stops:
                stop = view.stops[reason.stop]
                said = f"{robot} is held by {stop}, given {moment(stop.wall_time_s)}"
                return said, stop.wall_time_s, f"robotctl resume --robot {robot}"
            case WaitKind.PAUSED | WaitKind.DRAINED if reason.hold in view.holds:
                hold = view.holds[reason.hold]
                said = f"{in_words(hold)}, since {moment(hold.wall_time_s)}"
                return said, hold.wall_time_s, how_to_end(hold)
            case WaitKind.AWAY:
                since = f" since {moment(reason.since_wall_s)}" if reason.since_wall_s else ""
                return f"{robot} is away{since}: its worker is not connected", None, None
            case WaitKind.LOST:
                said = f"{reason}: its worker has to speak, or somebody says that it will not"
                return said, None, f"robotctl unregister {robot}"
            case WaitKind.LEASE:
                said = f"{robot} waits for a lease from the planner, without which it does not move"
                return said, None, None
            case WaitKind.BUSY:
                return f"{robot} is busy", None, None
            case WaitKind.RESERVED:
                said = f"{robot} is kept by plan {plan}, for which it has begun something"
                return said, None, None
            case WaitKind.APPROVAL:
                said = f"a person has to approve plan {plan}"
                return said, None, f"robotctl plan approve {plan}"
            case WaitKind.START:
                return f"a person has to start plan {plan}", None, f"robotctl plan start {plan}"
            case WaitKind.QUESTION | WaitKind.CONFIRMATION:
                said = f"a person has to say what goal {goal} means{said_of(reason.sentence)}"
                return said, None, f"robotctl goal answer {goal} {self._answers(goal or '')}"
            case WaitKind.NO_PLAN:
                return str(reason), None, "robotctl plan create"
            case WaitKind.CLOSED:
                closed = view.closures.get(reason.closure or "")
                nobody = f"{robot} does not get" if robot else "no robot gets"
                if closed is None:
                    return f"{nobody} there: {reason}", None, None
                said = f"{nobody} there: {closed_in_words(closed)}"
                return said, None, how_to_open(closed)
            case WaitKind.DUE if reason.due_s is not None and reason.sentence is None:
                return f"it is due {moment(self._wall_s(reason.due_s), reason.due_s)}", None, None
            case WaitKind.CONDITION if reason.sentence:
                return f"it waits until {reason.sentence}", None, None
            case WaitKind.REVISION:
                why = said_of(reason.sentence)
                return f"revision {reason.revision} of plan {plan} is being made{why}", None, None
        return str(reason), None, None

    def _wall_s(self, due_s: float) -> float | None:
        """What clocks show when a schedule's run is due, if one begins then."""
        runs = (s.next for s in self._view.schedule_status.values() if s.next_s == due_s and s.next)
        return next((datetime.fromisoformat(run).timestamp() for run in runs), None)

    def _answers(self, goal: str) -> str:
        status = self._view.goal_status.get(goal)
        count = len(status.candidates) if status is not None else 0
        return "yes" if count < 2 else "|".join(str(number) for number in range(1, count + 1))


def explain(
    view: FleetView,
    name: str,
    health: Health,
    deletions: Mapping[str, AuditEntry] | None = None,
) -> list[Explained]:
    """Why what is called so stands as it does: `PLAN/TASK`, a goal, a plan, or both of that name;
    `deletions` are of goals that a plan was cancelled for (`deleted_for`).

    Empty: there is none.
    """
    chain = Chain(view, health, deletions)
    plan, slash, task = name.partition("/")
    if slash:
        return [chain.task(plan, task)] if (plan, task) in view.tasks else []
    found = []
    if name in view.goals or name in view.goal_status:
        found.append(chain.goal(name))
    if name in view.plan_status:
        found.append(chain.plan(name))
    return found
