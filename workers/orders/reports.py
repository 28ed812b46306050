"""Making reports out of orders."""

from __future__ import annotations

from keyexpr_schema.payloads.tasks import Order, Report, ReportAddress, ReportState, Try
from keyexpr_schema.payloads.world import Fact


def make_report(
    order: Order,
    incarnation: str,
    state: ReportState,
    *,
    reason: str | None = None,
    retryable: bool = True,
    tries: tuple[Try, ...] = (),
    facts: tuple[Fact, ...] = (),
    started_s: float | None = None,
    ended_s: float | None = None,
) -> Report:
    """What the run `incarnation` of a worker says of the attempt that `order` asks for."""
    return Report(
        robot=order.robot,
        plan=order.plan,
        revision=order.revision,
        task=order.task,
        attempt=order.attempt,
        epoch=order.epoch,
        incarnation=incarnation,
        state=state,
        tries=tries,
        facts=facts,
        reason=reason,
        retryable=retryable,
        started_s=started_s,
        ended_s=ended_s,
    )


def report_address(report: Report) -> ReportAddress:
    """Where a report goes."""
    return ReportAddress(report.robot, report.plan, report.task, report.attempt)
