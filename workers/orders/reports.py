"""Making reports out of orders."""

from __future__ import annotations

from keyexpr_schema.payloads.tasks import Order, Report, ReportAddress, ReportState


def make_report(
    order: Order,
    incarnation: str,
    state: ReportState,
    reason: str | None = None,
    *,
    retryable: bool = True,
    started_s: float | None = None,
) -> Report:
    """What the run `incarnation` of a worker reports of the attempt that `order` asks for."""
    return Report(
        robot=order.robot,
        plan=order.plan,
        revision=order.revision,
        task=order.task,
        attempt=order.attempt,
        epoch=order.epoch,
        incarnation=incarnation,
        state=state,
        reason=reason,
        retryable=retryable,
        started_s=started_s,
    )


def report_address(report: Report) -> ReportAddress:
    """Where a report goes."""
    return ReportAddress(report.robot, report.plan, report.task, report.attempt)
