"""Payloads about work in progress: task records, orders, reports."""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload
from keyexpr_schema.payloads.programs import Program, ProgramTrace
from keyexpr_schema.payloads.waits import WaitReason
from keyexpr_schema.payloads.world import Fact


class TaskAddress(Address, frozen=True):
    """One task of one plan."""

    plan: str
    task: str


class OrderAddress(Address, frozen=True):
    """An order of one robot."""

    robot: str
    plan: str
    task: str

    @classmethod
    def of(cls, about: Order | Report) -> OrderAddress:
        """Where an order goes, or the one that a report is about."""
        return cls(about.robot, about.plan, about.task)


class ReportAddress(Address, frozen=True):
    """What a robot says of one attempt at a task."""

    robot: str
    plan: str
    task: str
    attempt: int

    @classmethod
    def of(cls, report: Report) -> ReportAddress:
        """Where a report goes."""
        return cls(report.robot, report.plan, report.task, report.attempt)


class TaskState(str, Enum):
    """Where a task stands, as the planner records it."""

    WAITING = "waiting"
    ORDERED = "ordered"
    RUNNING = "running"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    CANCELLED = "cancelled"


ENDED_TASKS = frozenset({TaskState.SUCCEEDED, TaskState.FAILED, TaskState.CANCELLED})
"""States that a task does not leave."""


class Try(Payload, frozen=True, kw_only=True):
    """One try of a skill inside an attempt, and why it failed (`None`: it did not)."""

    number: int
    started_s: float
    ended_s: float
    reason: str | None = None


class TaskRecord(Payload, frozen=True, kw_only=True):
    """Everything the planner knows of one task; `args` have robots in place of actors."""

    plan: Id
    revision: int
    task: Id
    skill: Id
    args: dict[str, str]
    actor: Id
    robot: Id | None
    state: TaskState
    after: tuple[Id, ...] = ()
    behind: tuple[Id, ...] = ()
    """Tasks that its robot has to do first, because of the allocation."""
    goal: Id | None = None
    attempt: int = 0
    serial: int = 0
    """That of the latest attempt's order."""
    tries: tuple[Try, ...] = ()
    reason: str | None = None
    duration_s: float = 0.0
    """Predicted duration."""
    way_s: float | None = None
    """Of that, the way there at the robot's top speed, as known when the task was ordered; `None`
    where nobody knew where the robot set out from."""
    ordered_s: float | None = None
    started_s: float | None = None
    ended_s: float | None = None
    program: Program | None = None
    """Of a sentence for the robot (`do`), what it means and the program that does it."""
    trace: ProgramTrace | None = None
    """What the program did in the latest attempt that has ended."""
    wall_time_s: float | None = None
    """Since when it stands so, Unix time [s]."""
    waits_for: tuple[WaitReason, ...] = ()
    """Why it is not done now: of tasks that have to succeed first no more than the last eight."""


class Order(Payload, frozen=True, kw_only=True):
    """A task given to a robot.

    `(epoch, revision, attempt)` fences it: a worker refuses an order older than one it has seen.
    `cancelled` asks the worker to stop the attempt and report. `deadline_s` bounds the whole
    attempt on the fleet's clock, counted from its start.

    `planner` is the lineage of the planner's journal: made once with it, and kept over restarts. A
    planner that lost its journal counts anew under another one, and what it orders by the same
    names are other attempts. `None`: from a planner that does not say so.

    `serial` numbers the attempts of a lineage, over all plans and robots: it rises by each and
    never returns, so that a worker can forget what is over and still refuse it. 0: not numbered.

    `lease_s`: the robot moves only while the planner was heard within so many seconds, by the
    worker's own clock (see `LeaseQuery`). 0: it needs no lease.
    """

    robot: Id
    plan: Id
    revision: int
    task: Id
    attempt: int
    epoch: int
    skill: Id
    args: dict[str, str]
    deadline_s: float
    cancelled: bool = False
    planner: Id | None = None
    serial: int = 0
    program: Program | None = None
    """With one, the order is carried out by running it; `skill` is then `do`."""
    lease_s: float = 0.0


class ReportState(str, Enum):
    """How an attempt stands, in the worker's words."""

    STARTED = "started"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    INTERRUPTED = "interrupted"
    CANCELLED = "cancelled"
    REFUSED = "refused"


FINAL_REPORTS = frozenset(ReportState) - {ReportState.STARTED}
"""States after which nothing more is reported of an attempt."""


class Report(Payload, frozen=True, kw_only=True):
    """What a worker says of an attempt. Put again on the same key as the attempt goes on.

    `facts` are what the attempt changed or discovered. `retryable` says whether the same order
    could succeed if it were given again. `planner` is that of the attempt's order: a planner hears
    reports of its own lineage, and those that name none. `fence` is set where the order was refused
    because its epoch is too low: the highest that the worker has had orders of. `stops` are the
    emergency stops that interrupted it; `lapsed`: the robot's lease had run out. `leaving`: the
    worker, `incarnation`, ends with this, so nothing is to be ordered of it, although its token may
    still be there. `told`: the store has had its facts on their keys before.
    """

    robot: Id
    plan: Id
    revision: int
    task: Id
    attempt: int
    epoch: int
    incarnation: Id
    state: ReportState
    tries: tuple[Try, ...] = ()
    facts: tuple[Fact, ...] = ()
    reason: str | None = None
    retryable: bool = True
    started_s: float | None = None
    ended_s: float | None = None
    planner: Id | None = None
    fence: int = 0
    program: ProgramTrace | None = None
    """Of an order with a program: what it did, and why it ended."""
    stops: tuple[Id, ...] = ()
    leaving: bool = False
    lapsed: bool = False
    told: bool = False
