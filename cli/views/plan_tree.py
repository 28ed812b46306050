"""A plan as a tree: its goals, under each its tasks with what they wait for and who does them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec
from rich.text import Text
from rich.tree import Tree

from cli.times import moment
from cli.views.text import (
    STATE_STYLE,
    outcome,
    performer,
    seconds,
    spent_s,
    task_call,
)
from cli.views.waits import waits_shown, why_shown
from keyexpr_schema.ids import natural_order
from keyexpr_schema.payloads.goals import Goal, GoalStatus
from keyexpr_schema.payloads.plans import ENDED_PLANS, Plan, PlanState, PlanStatus, Task
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.waits import WaitKind

MARKS = {
    TaskState.WAITING: "·",
    TaskState.ORDERED: "→",
    TaskState.RUNNING: "▶",
    TaskState.SUCCEEDED: "✓",
    TaskState.FAILED: "✗",
    TaskState.CANCELLED: "□",
}


def plan_tree(
    plan: Plan,
    status: PlanStatus | None,
    records: Mapping[str, TaskRecord],
    goals: Mapping[str, Goal],
    goal_status: Mapping[str, GoalStatus],
    now_s: float | None = None,
) -> Tree:
    """Draw `plan`; `records` and goals are by id, `now_s` is the fleet's clock."""
    tree = Tree(_title(plan, status))
    tasks = [*_earlier(plan, records), *plan.tasks]
    ids = list(plan.goals)
    ids += sorted({task.goal for task in tasks if task.goal} - set(ids))
    ordered = in_order(tasks)
    for goal in ids:
        branch = tree.add(_goal(goal, goals.get(goal), goal_status.get(goal), status))
        for task in ordered:
            if task.goal == goal:
                branch.add(_task(task, records.get(task.task), status, now_s))
    rest = [task for task in ordered if task.goal is None]
    if rest:
        branch = tree.add(Text("for no goal in particular", "dim"))
        for task in rest:
            branch.add(_task(task, records.get(task.task), status, now_s))
    return tree


def _earlier(plan: Plan, records: Mapping[str, TaskRecord]) -> list[Task]:
    """Tasks of earlier revisions that were begun; what was only planned is of no interest now."""
    current = {task.task for task in plan.tasks}
    return [
        msgspec.convert(record, Task, from_attributes=True)
        for record in sorted(records.values(), key=lambda record: natural_order(record.task))
        if record.task not in current and record.started_s is not None
    ]


def in_order(tasks: Sequence[Task]) -> list[Task]:
    """Tasks so that each comes after those it waits for; otherwise in their given order.

    A dependency on a task that is not there is ignored, and so is a cycle: this draws plans that
    were rejected for these very reasons.
    """
    there = {task.task for task in tasks}
    done: set[str] = set()
    rest = list(tasks)
    ordered: list[Task] = []
    while rest:
        ready = next(
            (t for t in rest if all(a in done or a not in there for a in t.after)), rest[0]
        )
        rest.remove(ready)
        done.add(ready.task)
        ordered.append(ready)
    return ordered


def _title(plan: Plan, status: PlanStatus | None) -> Text:
    state = status.state.value if status else "proposed"
    text = Text.assemble(
        (plan.plan, "bold"), f" revision {plan.revision}  ", (state, STATE_STYLE.get(state, ""))
    )
    text.append(f"  {plan.strategy}, {plan.made_by}, {plan.allocator}", "dim")
    if status and status.predicted_makespan_s is not None:
        text.append(f"  predicted {seconds(status.predicted_makespan_s)}", "dim")
    if status and status.wall_time_s is not None:
        text.append(f"  since {moment(status.wall_time_s, status.time_s)}", "dim")
    if status and (waits := waits_shown(status.waits_for, plan.plan)):
        text.append(f"\nwaits: {waits}", "yellow")
    if status and outcome(status):
        text.append(f"\n{outcome(status)}", "red")
    return text


def _goal(goal: str, spec: Goal | None, status: GoalStatus | None, plan: PlanStatus | None) -> Text:
    over = plan is not None and plan.state in ENDED_PLANS
    going_on = plan is not None and plan.state is PlanState.RUNNING
    gone = spec is None and (over or going_on)
    state = status.state.value if status else "deleted" if gone else "waiting"
    text = Text.assemble((goal, "bold"), "  ", (state, STATE_STYLE.get(state, "")))
    if status is None and gone and going_on:
        text.append(", its tasks are being withdrawn")
    if spec:
        text.append(f"  “{spec.text}”")
    if status and status.conditions:
        text.append(f"  {' and '.join(str(each) for each in status.conditions)}", "dim")
    if status and (why := why_shown(status.waits_for, status.reason)):
        text.append(f"  {why}", "red")
    return text


def _task(
    task: Task, record: TaskRecord | None, status: PlanStatus | None, now_s: float | None
) -> Text:
    robot = performer(task, status, record)
    state = record.state if record else TaskState.WAITING
    style = STATE_STYLE[state.value]
    text = Text.assemble((f"{MARKS[state]} ", style), (task.task, "bold"), " ")
    text.append(task_call(task, status, robot))
    text.append(f"  {task.actor}→{robot or '?'}", "blue")
    text.append(f"  {state.value}", style)
    spent = spent_s(record, now_s) if record else None
    predicted = (record.duration_s if record else 0.0) or task.duration_s
    if spent is not None:
        text.append(f" {seconds(spent)}")
    if predicted:
        text.append(
            f" of about {seconds(predicted)}"
            if spent is not None
            else f" about {seconds(predicted)}",
            "dim",
        )
    if record and record.attempt > 1:
        text.append(f"  attempt {record.attempt}", "yellow")
    if task.after:
        text.append(f"  after {', '.join(task.after)}", "dim")
    waits = record.waits_for if record else ()
    if any(reason.kind is not WaitKind.TASK for reason in waits):
        text.append(f"  {waits_shown(waits, record.plan if record else None)}", "yellow")
    if record and record.reason:
        text.append(f"  {record.reason}", "red")
    return text
