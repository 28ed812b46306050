"""What the store's journal remembers, which outlives the router, and what must not stand in it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from keyexpr_schema.errors import ForeignKey, UndecodablePayload
from keyexpr_schema.keyspace import (
    ANSWER,
    CONTROL_REQUEST,
    GOAL_SPEC,
    GOAL_STATUS,
    ORDER,
    PLAN_SPEC,
    PLAN_STATUS,
    REPORT,
    STORE_JOURNAL,
)
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.plans import Plan, PlanState, PlanStatus
from keyexpr_schema.payloads.requests import Answer, Control, ControlRequest
from keyexpr_schema.payloads.system import JournalEntry, StoreAddress, StoreJournal, StoreQuery
from keyexpr_schema.payloads.tasks import FINAL_REPORTS, Order, Report, ReportAddress, ReportState
from keyexpr_schema.transport.session import Session

Reports = dict[ReportAddress, list[Report]]
"""Of each attempt everything that was ever said, in the order in which the store took it."""
Attempt = tuple[str | None, str, str, int]
"""The planner's lineage, plan, task, and number."""


async def read_journal(session: Session) -> list[JournalEntry]:
    """All that the store has applied, in that order."""
    entries: list[JournalEntry] = []
    while True:
        after = entries[-1].number if entries else 0
        page: StoreJournal = await session.query(
            STORE_JOURNAL, StoreAddress(), StoreQuery(after=after), 10.0
        )
        if not page.entries:
            return entries
        entries += page.entries


async def all_reports(session: Session) -> Reports:
    """What robots have ever said of attempts."""
    return reports_in(await read_journal(session))


def reports_in(entries: Iterable[JournalEntry]) -> Reports:
    """What robots have said of attempts."""
    told: Reports = defaultdict(list)
    for entry in entries:
        try:
            address = REPORT.parse(entry.keyexpr)
        except ForeignKey:
            continue
        if entry.value is not None:
            told[address].append(REPORT.decode(entry.value.encode()))
    return told


def done_twice(reports: Reports) -> list[str]:
    """Attempts that began twice or have two ends, and tasks that two attempts succeeded in."""
    wrong: list[str] = []
    done: defaultdict[tuple[str, str], set[int]] = defaultdict(set)
    for address, said in reports.items():
        begun = {(r.incarnation, r.started_s) for r in said if r.state is ReportState.STARTED}
        ended = {(r.incarnation, r.state, r.ended_s) for r in said if r.state in FINAL_REPORTS}
        if len(begun) > 1:
            wrong.append(f"{address} began more than once: {begun}")
        if len(ended) > 1:
            wrong.append(f"{address} ended more than once: {ended}")
        if any(state is ReportState.SUCCEEDED for _, state, _ in ended):
            done[address.plan, address.task].add(address.attempt)
    wrong += [
        f"{task} was done in attempts {found}" for task, found in done.items() if len(found) > 1
    ]
    return wrong


@dataclass
class Cancelled:
    """What was taken back by people, as far as the planner has said so, and what was ordered or
    begun all the same: `wrong`. `goals` and `plans` count what was looked at.

    Once the status of a deleted goal is gone, nothing new is ordered for it; once the planner has
    answered that a plan is being cancelled, nothing new of that plan. An order that was out by then
    may still be begun by a robot that has not heard of it. Once the plan *is* cancelled, it may
    not: that was said when every robot had answered, or its lease was long over.
    """

    goals: int = 0
    plans: int = 0
    wrong: list[str] = field(default_factory=list)
    _for_goal: dict[tuple[str, int, str], str | None] = field(default_factory=dict)
    _deleted: set[str] = field(default_factory=set)
    _gone: set[str] = field(default_factory=set)
    _asked: dict[str, str] = field(default_factory=dict)
    _cancelling: set[str] = field(default_factory=set)
    _cancelled: dict[str, float] = field(default_factory=dict)
    _ordered: set[Attempt] = field(default_factory=set)
    _begun: set[tuple[str, Attempt]] = field(default_factory=set)

    @classmethod
    def of(cls, entries: Sequence[JournalEntry]) -> Cancelled:
        """What a journal says."""
        told = [_change(entry) for entry in entries]
        found = cls()
        for _, value in told:
            if isinstance(value, Plan):
                for task in value.tasks:
                    found._for_goal[value.plan, value.revision, task.task] = task.goal
        for entry, (name, value) in zip(entries, told, strict=True):
            found._see(entry, name, value)
        return found

    def _see(self, entry: JournalEntry, name: str, value: object) -> None:
        match value:
            case None if entry.keyexpr.endswith("/spec") and name:
                self._deleted.add(name)
            case None if name in self._deleted:
                self._deleted.discard(name)
                self._gone.add(name)
                self.goals += 1
            case Goal():
                self._gone.discard(name)  # so is called another one now
            case ControlRequest(control=Control.CANCEL, plan=plan, request=request):
                self._asked[request] = plan
            case Answer(accepted=True, request=request) if request in self._asked:
                self._cancelling.add(self._asked[request])
            case PlanStatus(state=PlanState.CANCELLED, plan=plan, time_s=time_s):
                self.plans += plan not in self._cancelled
                self._cancelled.setdefault(plan, time_s)
            case Order(cancelled=False):
                self._see_order(value)
            case Report():
                self._see_report(value)

    def _see_order(self, order: Order) -> None:
        attempt = (order.planner, order.plan, order.task, order.attempt)
        if attempt in self._ordered:
            return
        self._ordered.add(attempt)
        what = f"attempt {order.attempt} at {order.plan}/{order.task} was ordered"
        if order.plan in self._cancelling:
            self.wrong.append(f"{what} after the planner had said that the plan is cancelled")
        goal = self._for_goal.get((order.plan, order.revision, order.task))
        if goal in self._gone:
            self.wrong.append(f"{what} after the planner had dropped {goal}")

    def _see_report(self, report: Report) -> None:
        attempt = (report.planner, report.plan, report.task, report.attempt)
        if report.started_s is None or (report.robot, attempt) in self._begun:
            return
        self._begun.add((report.robot, attempt))
        cancelled_s = self._cancelled.get(report.plan)
        if cancelled_s is not None and report.started_s > cancelled_s:
            self.wrong.append(
                f"{report.robot} began {report.plan}/{report.task} at {report.started_s:.1f} s, "
                f"and the plan was cancelled at {cancelled_s:.1f} s"
            )


_KEYS = (GOAL_SPEC, GOAL_STATUS, PLAN_SPEC, PLAN_STATUS, CONTROL_REQUEST, ANSWER, ORDER, REPORT)


def _change(entry: JournalEntry) -> tuple[str, object]:
    """The goal that an entry is about, and its value, of the keys that count here; `None`: a goal's
    was deleted."""
    for key in _KEYS:
        try:
            address = key.parse(entry.keyexpr)
        except ForeignKey:
            continue
        goal = getattr(address, "goal", "")
        if entry.value is None:
            return goal, None
        try:
            return goal, key.decode(entry.value.encode())
        except UndecodablePayload:
            return "", entry
    return "", entry
