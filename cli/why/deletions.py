"""Who has deleted what a plan was cancelled for: the plan itself does not know."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from cli.times import moment
from cli.why.links import Explained, iso_of
from keyexpr_schema.payloads.plans import PlanState, PlanStatus
from keyexpr_schema.payloads.waits import WaitKind

if TYPE_CHECKING:
    from cli.client.fleet_view import FleetView
    from keyexpr_schema.payloads.audit import AuditEntry


def deleted_for(view: FleetView, plan: str) -> list[str]:
    """The goals that nobody wants any more, and that a plan is, or was, cancelled for."""
    status, spec = view.plan_status.get(plan), view.plans.get(plan)
    if status is None or not (is_being_cancelled(status) or status.state is PlanState.CANCELLED):
        return []
    about = {record.goal for record in view.records(plan).values() if record.goal}
    gone = (about | set(spec.goals if spec else ())) - view.wanted.keys()
    return sorted(goal for goal in gone if f"goal {goal} " in (status.reason or ""))


def is_being_cancelled(status: PlanStatus) -> bool:
    """Whether a plan is being cancelled."""
    return any(each.kind is WaitKind.CANCELLING and each.task is None for each in status.waits_for)


def told_deletions(
    view: FleetView, plan: str, deletions: Mapping[str, AuditEntry]
) -> tuple[Explained, ...]:
    """Who has deleted the goals for which a plan is, or was, cancelled, and when."""
    found = ((goal, deletions.get(goal)) for goal in deleted_for(view, plan))
    return tuple(
        Explained(
            about=goal,
            kind="goal",
            sentence=f"goal {goal} was deleted {moment(said.wall_time_s, said.time_s)}"
            + (f" by {said.by}" if said.by else ""),
            since=iso_of(said.wall_time_s),
        )
        for goal, said in found
        if said is not None
    )
