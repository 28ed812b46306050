"""Plans as a table; pages about one: all that is known of it, violations, differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from cli.plans.comparison import PlanDiff, TaskChange
from cli.times import moment
from cli.views.console import table
from cli.views.plan_graph import plan_graph
from cli.views.plan_tree import plan_tree
from cli.views.text import outcome, seconds, skill_call
from cli.views.waits import why_shown
from keyexpr_schema.ids import actor_arg, natural_order
from keyexpr_schema.payloads.goals import Goal, GoalStatus
from keyexpr_schema.payloads.plans import Making, Plan, PlanStatus, Task, Violation
from keyexpr_schema.payloads.tasks import TaskRecord


def plans_table(plans: Mapping[str, Plan], status: Mapping[str, PlanStatus]) -> Table:
    """One line a plan; also those that never came to have tasks."""
    rows = []
    for name in sorted(set(plans) | set(status), key=natural_order):
        plan, now = plans.get(name), status.get(name)
        rows.append(
            (
                name,
                now.revision if now else plan.revision if plan else "",
                now.state.value if now else "proposed",
                ", ".join(plan.goals if plan else now.goals if now else ()),
                len(plan.tasks) if plan else "",
                plan.strategy if plan else "",
                plan.made_by if plan else now.made_by if now else "",
                plan.allocator if plan else now.allocator if now else "",
                seconds(now.predicted_makespan_s) if now else "",
                moment(now.wall_time_s, now.time_s) if now else "",
                why_shown(now.waits_for, outcome(now)) if now else "",
            )
        )
    columns = ["plan", "rev", "state", "goals", "tasks", "strategy", "made by", "allocator"]
    return table([*columns, "predicted", "since", "why"], rows)


def plan_page(
    plan: Plan,
    status: PlanStatus | None,
    records: Mapping[str, TaskRecord],
    goals: Mapping[str, Goal],
    goal_status: Mapping[str, GoalStatus],
    now_s: float | None = None,
) -> Group:
    """The plan as a tree and as a DAG, how it was made, what its latest revision changed."""
    parts: list[RenderableType] = [
        plan_tree(plan, status, records, goals, goal_status, now_s),
        "",
        Text("What waits for what (a number is a step; tasks of a step can run at once)", "bold"),
        plan_graph(plan, status, records),
        "",
        *(Text(line) for line in making_lines(status.making if status else plan.making, status)),
    ]
    if plan.conditions:
        parts.append(f"ends with   {' and '.join(str(each) for each in plan.conditions)}")
    if plan.seeks:
        parts.append(f"looks for   {', '.join(plan.seeks)}; the plan goes on once one is found")
    if status and status.violations:
        parts += ["", violations_table(status.violations)]
    return Group(*parts)


def making_lines(making: Making, status: PlanStatus | None) -> list[str]:
    """Who made the plan, at what cost, what was predicted, what the latest revision changed."""
    made = [making.planner]
    if making.model:
        made.append(f"model {making.model}")
    if making.rounds:
        made.append(f"{making.rounds} {'answer' if making.rounds == 1 else 'answers'}")
        made.append(f"{making.tokens_in} tokens in, {making.tokens_out} out")
    if making.cost_usd is not None:
        made.append(f"{making.cost_usd:.4f} USD")
    if making.wall_s:
        made.append(f"{making.wall_s:.2f} s")
    if making.prompts:
        made.append(f"prompts {making.prompts}")
    lines = [f"made by     {', '.join(made)}"]
    if making.fallback:
        lines.append(f"fallback    {making.fallback}")
    if status is not None:
        if status.approved_by:
            lines.append(f"approved    by {status.approved_by}")
        if status.planning_time_s is not None:
            lines.append(f"planning    {status.planning_time_s:.2f} s")
        if status.predicted_makespan_s is not None:
            makespan = f"makespan    {seconds(status.predicted_makespan_s)} predicted"
            lines.append(makespan)
            if status.lower_bound_s is not None:
                least = seconds(status.lower_bound_s)
                lines.append(f"            this task graph cannot be done in less than {least}")
            if status.mission_bound_s is not None:
                least = seconds(status.mission_bound_s)
                lines.append(f"            no plan for this mission is shorter than {least}")
        lines += [f"allocation  {note}" for note in status.notes]
        if status.change is not None:
            change = status.change
            lines.append(
                f"change      revision {status.revision} kept {change.kept}, "
                f"dropped {change.dropped}, added {change.added} of the unfinished tasks"
            )
    return lines


def violations_table(violations: Sequence[Violation]) -> RenderableType:
    """One line a violation."""
    return table(
        ["violation", "task", "condition", "why"],
        (
            (each.code, each.task, "" if each.condition is None else each.condition, each.sentence)
            for each in violations
        ),
    )


def diff_page(diff: PlanDiff) -> Group:
    """Tasks that are new, gone, different, the same; `+`, `-`, `~` and nothing before them."""
    parts: list[RenderableType] = [
        Text(
            f"{diff.a} → {diff.b}: {len(diff.kept)} kept, {len(diff.changed)} changed, "
            f"{len(diff.dropped)} dropped, {len(diff.added)} added"
            + (f", {len(diff.finished)} finished meanwhile" if diff.finished else ""),
            "bold",
        )
    ]
    parts += [Text(f"- goal {goal}", "red") for goal in diff.goals_dropped]
    parts += [Text(f"+ goal {goal}", "green") for goal in diff.goals_added]
    parts += [Text(f"✓ {_line(task)}", "dim") for task in diff.finished]
    parts += [Text(f"- {_line(task)}", "red") for task in diff.dropped]
    parts += [Text(f"+ {_line(task)}", "green") for task in diff.added]
    for change in diff.changed:
        parts.append(Text(f"~ {_named(change)}", "yellow"))
        parts += [
            Text(f"    {each.field}: {each.before} → {each.now}", "yellow")
            for each in change.changes
        ]
    if diff.kept:
        parts.append(Text(f"  {', '.join(_named(each) for each in diff.kept)}", "dim"))
    return Group(*parts)


def _named(change: TaskChange) -> str:
    was = "" if change.was == change.task else f" (was {change.was})"
    return f"{change.task}{was}"


def _line(task: Task) -> str:
    after = f"  after {', '.join(task.after)}" if task.after else ""
    actor = actor_arg(task.actor)
    return f"{task.task} {skill_call(task.skill, task.args, actor)}  {actor}{after}"
