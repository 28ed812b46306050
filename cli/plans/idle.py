"""What `plan show --analyze-idle` tells of a plan: idle time by two definitions, and the bound."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import msgspec

from fleet.scheduling.idle_time import (
    IdleTime,
    capable,
    measured_idle,
    measured_unit,
    predicted_idle,
    predicted_unit,
)

if TYPE_CHECKING:
    from keyexpr_schema.payloads.plans import Plan, PlanStatus
    from keyexpr_schema.payloads.robots import RobotSpec
    from keyexpr_schema.payloads.tasks import TaskRecord


class Idle(msgspec.Struct, frozen=True, kw_only=True):
    """One way to count: the makespan [steps or s], and shares of it, 0 to 1, of doing nothing."""

    makespan: float
    idle: dict[str, float]
    mean: float


class IdleReport(msgspec.Struct, frozen=True, kw_only=True):
    """Idle time of a plan. `unit_…` is the reference's definition in steps; the others are ours, in
    seconds, over `fleet`, the registered robots that have a skill of the plan.

    `measured…` is of what has happened so far, in all revisions; `None` before anything has.
    `over_bound` is the predicted makespan of the latest revision by its proven lower bound, where
    the allocator gave one; `measured_over_bound` the measured one of a plan that was never revised.
    """

    fleet: tuple[str, ...]
    unit_predicted: Idle | None = None
    predicted: Idle | None = None
    unit_measured: Idle | None = None
    measured: Idle | None = None
    ended: bool = False
    lower_bound_s: float | None = None
    over_bound: float | None = None
    measured_over_bound: float | None = None


def idle_report(
    plan: Plan,
    status: PlanStatus | None,
    records: Iterable[TaskRecord],
    robots: Iterable[RobotSpec],
) -> IdleReport:
    """The report, from what stands on the keys."""
    from fleet.core.model.task_graph import Cycle
    from keyexpr_schema.payloads.plans import ENDED_PLANS

    fleet = capable(plan, robots)
    records = list(records)
    report = IdleReport(fleet=fleet)
    if status is None:
        return report
    allocated = {task.actor for task in plan.tasks} <= status.allocation.keys()
    begun = any(record.started_s is not None for record in records)
    bound_s = status.lower_bound_s
    try:
        if allocated and plan.tasks:
            predicted = predicted_idle(plan, status.allocation, status.sequence, fleet)
            makespan_s = status.predicted_makespan_s or predicted.makespan
            report = msgspec.structs.replace(
                report,
                unit_predicted=_idle(predicted_unit(plan, status.allocation)),
                predicted=_idle(predicted),
                lower_bound_s=bound_s,
                over_bound=makespan_s / bound_s if bound_s else None,
            )
        if begun:
            measured = measured_idle(records, fleet)
            ended = status.state in ENDED_PLANS
            report = msgspec.structs.replace(
                report,
                unit_measured=_idle(measured_unit(records)),
                measured=_idle(measured),
                ended=ended,
                measured_over_bound=measured.makespan / bound_s
                if bound_s and ended and status.revision == 1
                else None,
            )
    except Cycle:
        pass  # a plan that was rejected for it has no times
    return report


def _idle(found: IdleTime) -> Idle:
    return Idle(makespan=found.makespan, idle=found.idle, mean=found.mean)
