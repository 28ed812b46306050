"""Payloads about what is over: how it is kept in the archive, and what the planner tells of it.

Times ending in `wall_s` are Unix time [s], the others are on the fleet's clock [s].
"""

from __future__ import annotations

from enum import Enum

import msgspec

from keyexpr_schema.ids import Id
from keyexpr_schema.key import Payload
from keyexpr_schema.payloads.goals import Goal, GoalStatus
from keyexpr_schema.payloads.plans import Plan, PlanStatus
from keyexpr_schema.payloads.requests import Answer
from keyexpr_schema.payloads.tasks import TaskRecord


class Record(Payload, frozen=True, kw_only=True, tag_field="record"):
    """Something that is over, with all that is worth keeping of it.

    The same record comes again when a planner replays its journal; `ended_wall_s`, the time of the
    event that ended it, tells it from another one of the same name.
    """

    ended_s: float
    ended_wall_s: float


class GoalRecord(Record, frozen=True, kw_only=True, tag="goal"):
    """A goal, and how it stood in the end; `deleted`: somebody took it back."""

    spec: Goal
    status: GoalStatus
    deleted: bool = False


class PlanRecord(Record, frozen=True, kw_only=True, tag="plan"):
    """A plan in its last revision, the tasks of all revisions, and the goals that it was for.

    A goal that the plan did not end (it was cancelled, say) is among them as it stood then.
    """

    spec: Plan
    status: PlanStatus
    tasks: tuple[TaskRecord, ...] = ()
    goals: tuple[GoalRecord, ...] = ()
    begun_s: float
    begun_wall_s: float


class RequestRecord(Record, frozen=True, kw_only=True, tag="request"):
    """A request that was answered."""

    answer: Answer


Ended = GoalRecord | PlanRecord | RequestRecord


class HistoryOutcome(str, Enum):
    """What came of a plan or a goal."""

    SUCCEEDED = "succeeded"
    """Of a plan: it was carried out. Its goals are `reached`."""
    REACHED = "reached"
    FAILED = "failed"
    REJECTED = "rejected"
    CANCELLED = "cancelled"
    DELETED = "deleted"
    OPEN = "open"
    """Of a goal: its plan ended, and the goal waits for another one."""
    NOT_NEEDED = "not-needed"
    """Of a goal: it was wanted only if something held, and that did not."""


class PastGoal(Payload, frozen=True, kw_only=True):
    """A goal in the history, and the last plan that worked on it. `took_s` counts from when the
    planner first heard of it."""

    goal: Id
    text: str
    outcome: HistoryOutcome
    reason: str | None = None
    plan: Id | None = None
    took_s: float | None = None
    by: str = ""
    """Who put it there."""


class RobotShare(Payload, frozen=True, kw_only=True):
    """What one robot did of a plan: tasks that it took part in, and how long it was at them."""

    robot: Id
    tasks: int = 0
    busy_s: float = 0.0


class PastEntry(Payload, frozen=True, kw_only=True):
    """One line of the history: a plan that ended, or (`plan` is `None`) a goal that ended without
    its plan, or without ever having one.

    `number` counts what went into the archive; `replans` the revisions after the first.
    """

    number: int
    plan: Id | None = None
    outcome: HistoryOutcome
    reason: str | None = None
    goals: tuple[PastGoal, ...] = ()
    robots: tuple[RobotShare, ...] = ()
    tasks: int = 0
    replans: int = 0
    begun_s: float
    ended_s: float
    begun_wall_s: float
    ended_wall_s: float


class HistoryQuery(Payload, frozen=True, kw_only=True):
    """Asks the planner for what is over, newest first.

    Only what ended at `since_wall_s` or later, is about `goal` or its parts and runs, or was done
    by `robot`, where these are given; at most `limit` entries numbered below `before`.
    """

    since_wall_s: float | None = None
    goal: Id | None = None
    robot: Id | None = None
    before: int | None = None
    limit: int = 100


class HistoryPage(Payload, frozen=True, kw_only=True):
    """A piece of the history. `before` asks for the next one; `None`: there is no more."""

    entries: tuple[PastEntry, ...] = ()
    before: int | None = None


class HistoryStatsQuery(Payload, frozen=True, kw_only=True):
    """Asks the planner to add its history up, in days of a place `utc_offset_s` east of UTC."""

    since_wall_s: float | None = None
    utc_offset_s: int = 0


class FailureCount(Payload, frozen=True, kw_only=True):
    """How many goals were not reached for the same reason."""

    reason: str
    goals: int


class RobotUse(Payload, frozen=True, kw_only=True):
    """How much a robot did in a period; `utilisation` is its share of the time in which plans were
    under way (1.0: it was never idle then)."""

    robot: Id
    tasks: int = 0
    busy_s: float = 0.0
    utilisation: float = 0.0


class PeriodStats(Payload, frozen=True, kw_only=True):
    """What came of a period: a `day` (`2026-11-28`), or (`None`) all that was asked for.

    `goals` and `plans` count outcomes. `median_s` and `p90_s` are times to goal: from when the
    planner heard of a goal to when it was reached. `active_s` is how long plans were under way,
    those at the same time counted once.
    """

    day: str | None = None
    goals: dict[HistoryOutcome, int] = {}
    plans: dict[HistoryOutcome, int] = {}
    failures: tuple[FailureCount, ...] = ()
    median_s: float | None = None
    p90_s: float | None = None
    replans: int = 0
    active_s: float = 0.0
    robots: tuple[RobotUse, ...] = ()


class HistoryStats(Payload, frozen=True, kw_only=True):
    """The history, added up: as a whole and by day, oldest first."""

    total: PeriodStats = PeriodStats()
    days: tuple[PeriodStats, ...] = msgspec.field(default=())


class RetireQuery(Payload, frozen=True, kw_only=True):
    """Delete the keys of what is over now, and not only after the retention.

    `plans`: ended plans, with their tasks, reports and reached or failed goals. `goals`: goals that
    were reached, failed or rejected. `older_than_s`: only what ended that long ago [s].
    """

    plans: bool = False
    goals: bool = False
    older_than_s: float = 0.0
    by: str = ""
    """Who wants it, such as `ana@lab`."""


class Retired(Payload, frozen=True, kw_only=True):
    """How many plans and goals have no keys any more; `left`: there are more of them."""

    plans: int = 0
    goals: int = 0
    left: bool = False
