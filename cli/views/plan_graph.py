"""A plan's DAG: in layers of text, and as Graphviz DOT."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.table import Table
from rich.text import Text

from cli.views.plan_tree import MARKS, in_order
from cli.views.text import STATE_STYLE, performer, seconds, task_call
from cli.views.waits import waits_shown
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.plans import Plan, PlanStatus, Task
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState
from keyexpr_schema.payloads.waits import WaitKind

FILL = {
    TaskState.WAITING: "white",
    TaskState.ORDERED: "lightcyan",
    TaskState.RUNNING: "khaki",
    TaskState.SUCCEEDED: "palegreen",
    TaskState.FAILED: "lightsalmon",
    TaskState.CANCELLED: "gray85",
}
"""Graphviz colour of a task by its state."""


def layers(tasks: Sequence[Task]) -> list[list[Task]]:
    """Tasks by how many others they wait for in a row at least: all of a layer may run at once.

    What is not in the plan is not waited for; tasks that wait in a circle come in some order.
    """
    there = {task.task for task in tasks}
    depth: dict[str, int] = {}
    for task in in_order(tasks):
        depth[task.task] = 1 + max((depth.get(b, -1) for b in task.after if b in there), default=-1)
    rows: list[list[Task]] = [[] for _ in range(1 + max(depth.values(), default=-1))]
    for task in tasks:
        rows[depth[task.task]].append(task)
    return [row for row in rows if row]


def plan_graph(
    plan: Plan, status: PlanStatus | None, records: Mapping[str, TaskRecord]
) -> Table | Text:
    """One line a task, layer by layer: `t1 ─┐` what it waits for, itself, and what waits for it."""
    if not plan.tasks:
        return Text("no tasks: there is nothing to do", "dim")
    followers: dict[str, list[str]] = {}
    for task in plan.tasks:
        for before in task.after:
            followers.setdefault(before, []).append(task.task)
    drawn = Table(box=None, pad_edge=False, show_header=False)
    for justify in ("right", "right", "left", "left", "left", "left"):
        drawn.add_column(justify=justify, overflow="fold")
    for number, row in enumerate(layers(plan.tasks)):
        for place, task in enumerate(row):
            last = place == len(row) - 1
            state = _state(task, records)
            who = _who(task, status, records)
            before, after = ", ".join(task.after), ", ".join(followers.get(task.task, ()))
            drawn.add_row(
                Text(f"{number + 1}" if place == 0 else "", "dim"),
                Text(f"{before} →" if before else "", "dim"),
                Text.assemble((f"{MARKS[state]} ", STATE_STYLE[state.value]), (task.task, "bold")),
                Text.assemble(task_call(task, status), (f"  {who}", "blue")),
                Text(f"→ {after}" if after else "", "dim"),
                Text(_waits(records.get(task.task)), "yellow"),
                end_section=last,
            )
    return drawn


def plan_dot(plan: Plan, status: PlanStatus | None, records: Mapping[str, TaskRecord]) -> str:
    """The DAG in Graphviz' language; solid arrows are causes, dashed ones a robot's own order."""
    lines = [
        f"digraph {_quoted(plan.plan)} {{",
        '  rankdir=LR; node [shape=box, style="rounded,filled", fontname=sans];',
    ]
    for task in plan.tasks:
        parts = [f"{task.task}  {_who(task, status, records)}", task_call(task, status)]
        label = "\n".join([*parts, seconds(task.duration_s)] if task.duration_s else parts)
        fill = FILL[_state(task, records)]
        lines.append(f"  {_quoted(task.task)} [label={_quoted(label)}, fillcolor={fill}];")
    there = {task.task for task in plan.tasks}
    for task in plan.tasks:
        for before in task.after:
            if before in there:
                lines.append(f"  {_quoted(before)} -> {_quoted(task.task)};")
        record = records.get(task.task)
        for before in record.behind if record else ():
            if before in there and before not in task.after:
                lines.append(f"  {_quoted(before)} -> {_quoted(task.task)} [style=dashed];")
    return "\n".join([*lines, "}"])


def _waits(record: TaskRecord | None) -> str:
    """What a task waits for besides the tasks that the graph shows."""
    reasons = record.waits_for if record is not None else ()
    return waits_shown(each for each in reasons if each.kind is not WaitKind.TASK)


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def _state(task: Task, records: Mapping[str, TaskRecord]) -> TaskState:
    record = records.get(task.task)
    return record.state if record else TaskState.WAITING


def _who(task: Task, status: PlanStatus | None, records: Mapping[str, TaskRecord]) -> str:
    return performer(task, status, records.get(task.task)) or actor_arg(task.actor)
