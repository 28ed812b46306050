"""Tables of robots, goals, plans, tasks and the world."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import msgspec
from rich.table import Table

from cli.show.page import table
from cli.show.words import (
    call,
    capabilities,
    carried,
    doing,
    meaning,
    natural,
    outcome,
    seconds,
    spent_s,
    statement_means,
)
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.plans import Plan, PlanStatus
from keyexpr_schema.payloads.robots import RobotSpec, RobotState
from keyexpr_schema.payloads.service import Reject
from keyexpr_schema.payloads.tasks import Report, TaskRecord
from keyexpr_schema.payloads.world import Fact, Object, Place, Statement, StatementStatus


class RobotRow(msgspec.Struct, frozen=True, kw_only=True):
    """One robot as `robotctl robots --json` shows it."""

    robot: str
    connected: bool
    spec: RobotSpec | None
    state: RobotState | None


def robot_row(
    robot: str, spec: RobotSpec | None, state: RobotState | None, connected: bool
) -> RobotRow:
    """What is known of one robot; the state of one that is not connected is its last."""
    return RobotRow(robot=robot, connected=connected, spec=spec, state=state)


def robots_table(rows: Iterable[RobotRow]) -> Table:
    """One line a robot."""
    return table(
        ["robot", "connected", "activity", "place", "holding", "task", "skills", "capabilities"],
        (
            (
                row.robot,
                "yes" if row.connected else "no",
                row.state.activity.value if row.state and row.connected else "",
                row.state.place if row.state else "",
                carried(row.state),
                doing(row.state),
                ", ".join(row.spec.skills) if row.spec else "not registered",
                capabilities(row.spec) if row.spec else "",
            )
            for row in rows
        ),
    )


class GoalRow(msgspec.Struct, frozen=True, kw_only=True):
    """One goal as `robotctl goal list --json` shows it."""

    goal: str
    spec: Goal | None
    status: GoalStatus | None


def goal_rows(goals: Mapping[str, Goal], status: Mapping[str, GoalStatus]) -> list[GoalRow]:
    """Every goal in the order it was given."""
    rows = [GoalRow(goal=g, spec=goals[g], status=status.get(g)) for g in goals]
    return sorted(rows, key=lambda row: (row.spec.ordinal if row.spec else 0, row.goal))


def goals_table(rows: Iterable[GoalRow]) -> Table:
    """One line a goal."""
    return table(
        ["goal", "state", "priority", "text", "means", "plan", "reason"],
        (
            (
                row.goal,
                (row.status.state if row.status else GoalState.WAITING).value,
                row.spec.priority if row.spec else "",
                row.spec.text if row.spec else "",
                meaning(row.status) if row.status else "",
                row.status.plan if row.status else "",
                row.status.reason if row.status else "",
            )
            for row in rows
        ),
    )


def plans_table(plans: Mapping[str, Plan], status: Mapping[str, PlanStatus]) -> Table:
    """One line a plan; also those that never came to have tasks."""
    rows = []
    for name in sorted(set(plans) | set(status), key=natural):
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
                outcome(now) if now else "",
            )
        )
    columns = ["plan", "rev", "state", "goals", "tasks", "strategy", "made by", "allocator"]
    return table([*columns, "predicted", "reason"], rows)


def tasks_table(records: Iterable[TaskRecord], now_s: float | None = None) -> Table:
    """One line a task."""
    return table(
        ["plan", "task", "call", "robot", "state", "attempt", "spent", "predicted", "after", "why"],
        (
            (
                record.plan,
                record.task,
                call(record.skill, record.args, leave_out=record.robot),
                record.robot,
                record.state.value,
                record.attempt or "",
                seconds(spent_s(record, now_s)),
                seconds(record.duration_s) if record.duration_s else "",
                ", ".join(record.after),
                record.reason,
            )
            for record in records
        ),
    )


def places_table(places: Sequence[Place]) -> Table:
    """One line a place."""
    return table(
        ["place", "label", "also called", "surfaces", "distances"],
        (
            (
                place.place,
                place.label,
                ", ".join(place.aliases),
                ", ".join(surface.surface for surface in place.surfaces),
                ", ".join(f"{to} {m:.1f} m" for to, m in place.travel_m.items()),
            )
            for place in places
        ),
        title="Places",
    )


def objects_table(objects: Sequence[Object]) -> Table:
    """One line an object."""
    return table(
        ["object", "kind", "label", "also called", "mass", "home"],
        (
            (o.object, o.kind, o.label, ", ".join(o.aliases), f"{o.mass_kg:g} kg", o.home)
            for o in objects
        ),
        title="Objects",
    )


def facts_table(facts: Sequence[Fact]) -> Table:
    """One line a fact."""
    return table(
        ["fact", "source", "time"],
        (
            (
                str(fact.literal),
                fact.source,
                f"{fact.time_s:.1f} s",
            )
            for fact in facts
        ),
        title="Facts",
    )


def statements_table(statements: Sequence[Statement], read: Mapping[str, StatementStatus]) -> Table:
    """One line a statement, with what the planner read out of it."""
    return table(
        ["statement", "text", "source", "read as"],
        (
            (
                said.statement,
                said.text,
                said.source,
                statement_means(read.get(said.statement)).removeprefix(", "),
            )
            for said in statements
        ),
        title="Statements",
    )


def rejects_table(rejects: Sequence[Reject]) -> Table:
    """One line a value that somebody could not read."""
    return table(
        ["key", "told by", "times", "reason"],
        ((r.keyexpr, r.component, r.count, r.reason) for r in rejects),
        title="Unreadable values",
    )


def reports_table(reports: Iterable[Report]) -> Table:
    """One line a try of each attempt at a task; an attempt without tries has one line too."""
    rows: list[Sequence[object]] = []
    for report in reports:
        learned = ", ".join(str(fact.literal) for fact in report.facts)
        if not report.tries:
            spent = _between(report.started_s, report.ended_s)
            rows.append(
                (
                    report.attempt,
                    report.robot,
                    report.state.value,
                    "",
                    spent,
                    report.reason,
                    learned,
                )
            )
        for each in report.tries:
            spent = _between(each.started_s, each.ended_s)
            state = report.state.value if each is report.tries[-1] else "failed"
            rows.append(
                (report.attempt, report.robot, state, each.number, spent, each.reason, learned)
            )
    return table(["attempt", "robot", "state", "try", "spent", "reason", "learned"], rows)


def _between(start_s: float | None, end_s: float | None) -> str:
    return seconds(end_s - start_s) if start_s is not None and end_s is not None else ""
