"""What to do with an order: the fencing rules, as a pure function of what was seen before.

An order is fenced by `(epoch, revision, attempt)`. Zenoh may deliver it late, twice, or after a
restart, and two planners may write for a moment; whatever comes, **one attempt never runs twice**:

* an attempt that has ended is only reported again, whoever orders it;
* an attempt that is queued or running goes on, and an order of it never starts another;
* what is older than what was seen (an older planner's epoch, an older revision of the same plan, a
  lower attempt of the same task) is refused;
* an attempt that had started when the worker went down is *interrupted*: it has ended.

Revisions and attempts count within the lineage of one planner's journal: a planner that lost it
gives out the same names anew, and means other attempts by them.

**What is over is forgotten**, and stays fenced. Attempts of a lineage that numbers them (`serial`)
are given out in the order of their numbers, so one number says of all that are forgotten that they
do not come again: an unknown attempt with a number up to it is refused. Of attempts without a
number, the highest one of each task is kept.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from keyexpr_schema.payloads.system import LARGEST_EPOCH, LARGEST_OVERTAKEN
from keyexpr_schema.payloads.tasks import Order, Report


class PlanName(NamedTuple):
    """A plan of one lineage; `planner` is `None` where the planner does not name its own."""

    planner: str | None
    plan: str


class TaskName(NamedTuple):
    """A task of one lineage."""

    planner: str | None
    plan: str
    task: str


class AttemptName(NamedTuple):
    """An attempt of one lineage: the same names of another lineage are another attempt."""

    planner: str | None
    plan: str
    task: str
    attempt: int

    @classmethod
    def of(cls, about: Order | Report) -> AttemptName:
        """The attempt that an order or a report is about."""
        return cls(about.planner, about.plan, about.task, about.attempt)

    @property
    def in_plan(self) -> PlanName:
        """Its plan."""
        return PlanName(self.planner, self.plan)

    @property
    def of_task(self) -> TaskName:
        """Its task."""
        return TaskName(self.planner, self.plan, self.task)


LARGEST_ATTEMPT = 10**18
"""An attempt is a chunk of its report's key, of at most 18 digits."""
LARGEST = 2**63
"""What the journal's file can hold."""

HOW_TO_RESET = (
    "; no planner goes beyond that: `robotctl fence ROBOT --reset-below EPOCH` on its host"
)


HOW_TO_FORGET = (
    "; where no planner has ordered that, `robotctl fence ROBOT --forget PLAN/TASK/ATTEMPT` on its "
    "host has it forgotten, and `robotctl fence ROBOT --json` names what it knows"
)
HOW_TO_RESET_SERIAL = (
    "; where no planner has counted so far, `robotctl fence ROBOT --reset-serial {}` on its host "
    "has it take this one, and those after it"
)
NOBODY_IS_SO_LATE = 1_000_000
"""So many orders after it, nobody gives one any more."""
NOBODY_COUNTS_TO = 1000
"""Revisions and attempts above that are somebody's mistake, or meant to lock a task."""


class Phase(str, Enum):
    """How far an attempt has come on this robot."""

    QUEUED = "queued"
    STARTED = "started"
    ENDED = "ended"


@dataclass(frozen=True)
class Attempt:
    """One attempt. `report` is its last word; there once it has ended.

    `ended_wall_s` is when that was, in Unix seconds: for keeping it for a while, and nothing else.
    """

    order: Order
    phase: Phase
    report: Report | None = None
    ended_wall_s: float | None = None

    @property
    def name(self) -> AttemptName:
        """Which attempt it is."""
        return AttemptName.of(self.order)


@dataclass(frozen=True)
class Accept:
    """Put the order at the end of the queue."""


@dataclass(frozen=True)
class Renew:
    """The attempt is queued or running already: note the newer order, start nothing."""


@dataclass(frozen=True)
class Cancel:
    """Stop the attempt if it runs; end it as cancelled."""


@dataclass(frozen=True)
class Repeat:
    """The attempt has ended: put its report again."""

    report: Report


@dataclass(frozen=True)
class Refuse:
    """Report the attempt as refused; `reason` is a sentence.

    `fence`: it is because of the order's epoch, and this is the highest that was seen.
    """

    reason: str
    fence: int = 0


@dataclass(frozen=True)
class Ignore:
    """Nothing to do, and nothing to say that would not overwrite something truer."""


Decision = Accept | Renew | Cancel | Repeat | Refuse | Ignore


@dataclass
class Ledger:
    """Everything this robot has seen of orders. Only the methods change it."""

    epoch: int = 0
    """The highest planner epoch seen."""
    revisions: dict[PlanName, int] = field(default_factory=dict)
    """The highest revision seen, by plan."""
    latest: dict[TaskName, int] = field(default_factory=dict)
    """The highest attempt that was ever taken on, by task."""
    forgotten: dict[str | None, int] = field(default_factory=dict)
    """The highest serial among the attempts that were forgotten, by lineage."""
    unnumbered: dict[TaskName, int] = field(default_factory=dict)
    """The highest attempt among those without a serial that were forgotten, by task."""
    attempts: dict[AttemptName, Attempt] = field(default_factory=dict)

    def raise_fences(self, order: Order) -> None:
        """Raise the fences to an order that was taken on, renewed or cancelled."""
        plan = PlanName(order.planner, order.plan)
        self.epoch = max(self.epoch, order.epoch)
        self.revisions[plan] = max(self.revisions.get(plan, 0), order.revision)

    def put(self, attempt: Attempt) -> None:
        """Enter an attempt, or how it stands now."""
        name = attempt.name
        self.raise_fences(attempt.order)
        self.attempts[name] = attempt
        self.latest[name.of_task] = max(self.latest.get(name.of_task, 0), name.attempt)

    def drop(self, name: AttemptName) -> None:
        """Forget an attempt that is queued (its order was withdrawn). The fences stay."""
        if (attempt := self.attempts.get(name)) is not None and attempt.phase is Phase.QUEUED:
            del self.attempts[name]

    def forget(self, name: AttemptName) -> None:
        """Forget an attempt that has ended; what fences it stays, in as few numbers as will do."""
        attempt = self.attempts[name]
        if attempt.phase is not Phase.ENDED:
            raise ValueError(f"{name} has not ended")
        del self.attempts[name]
        if serial := attempt.order.serial:
            self.forgotten[name.planner] = max(self.forgotten.get(name.planner, 0), serial)
        else:
            known = self.unnumbered.get(name.of_task, 0)
            self.unnumbered[name.of_task] = max(known, name.attempt)
        # Earlier attempts of the task, and revisions of the plan, had lower serials.
        if not any(other.of_task == name.of_task for other in self.attempts):
            self.latest.pop(name.of_task, None)
        if serial and not any(task[:2] == name.in_plan for task in self.latest):
            self.revisions.pop(name.in_plan, None)

    def in_phase(self, phase: Phase) -> Iterable[Attempt]:
        """The attempts that stand so, in the order of their arrival."""
        return (e for e in list(self.attempts.values()) if e.phase is phase)


def decide(ledger: Ledger, order: Order) -> Decision:
    """What to do with `order`, given everything seen before. Changes nothing."""
    attempt = ledger.attempts.get(AttemptName.of(order))
    objection = _objection(ledger, order)
    if attempt is not None and attempt.phase is Phase.ENDED:
        if attempt.report is None:
            return Ignore()
        return Repeat(attempt.report)
    if attempt is not None:
        if objection is not None:
            # A refusal would stand on the report key of an attempt that is under way.
            return Ignore()
        return Cancel() if order.cancelled else Renew()
    if objection is None:
        objection = _forgotten(ledger, order)
    if objection is not None:
        return Refuse(objection, ledger.epoch if order.epoch < ledger.epoch else 0)
    return Cancel() if order.cancelled else Accept()


def malformed(order: Order) -> str | None:
    """What is wrong with the numbers of an order that decoded, or `None`."""
    if not 1 <= order.attempt < LARGEST_ATTEMPT:
        return f"attempt {order.attempt} is not a count: attempts go from 1 up"
    if order.epoch > LARGEST_EPOCH:
        return f"epoch {order.epoch} is larger than any that a planner counts to"
    if not all(0 <= n < LARGEST for n in (order.epoch, order.revision, order.serial)):
        return (
            f"epoch {order.epoch}, revision {order.revision} and serial {order.serial} must be "
            "from 0 up, in 63 bits"
        )
    return None


def superseded(ledger: Ledger, order: Order) -> tuple[AttemptName, ...]:
    """Other attempts of the same task that are still queued or running when `order` is accepted.

    The order stands on the same key as theirs: they are withdrawn by it. It is a later attempt, or
    one of another lineage.
    """
    return tuple(
        name
        for name, attempt in ledger.attempts.items()
        if (name.plan, name.task) == (order.plan, order.task)
        and name != AttemptName.of(order)
        and attempt.phase is not Phase.ENDED
    )


def _objection(ledger: Ledger, order: Order) -> str | None:
    """Why an order is out of date, or `None`."""
    name = AttemptName.of(order)
    if order.epoch < ledger.epoch:
        return (
            f"the order is from planner epoch {order.epoch}, but this worker has had orders from "
            f"epoch {ledger.epoch}: only the newer planner gives orders"
            + (HOW_TO_RESET if ledger.epoch > LARGEST_OVERTAKEN else "")
        )
    seen = ledger.revisions.get(name.in_plan, 0)
    if order.revision < seen:
        return (
            f"the order is from revision {order.revision} of {order.plan}, but this worker has "
            f"had orders from revision {seen}" + (HOW_TO_FORGET if seen > NOBODY_COUNTS_TO else "")
        )
    latest = ledger.latest.get(name.of_task, 0)
    if order.attempt < latest:
        return f"attempt {order.attempt} is older than attempt {latest}, which came before" + (
            HOW_TO_FORGET if latest > NOBODY_COUNTS_TO else ""
        )
    return None


def _forgotten(ledger: Ledger, order: Order) -> str | None:
    """Why an attempt that is not known may be one that was forgotten, or `None`."""
    name = AttemptName.of(order)
    highest = ledger.forgotten.get(name.planner, 0)
    if 0 < order.serial <= highest:
        why = (
            f"attempt {order.attempt} has the serial {order.serial}, and this worker has forgotten "
            f"what was over up to serial {highest}: it may have been carried out"
        )
        if highest - order.serial > NOBODY_IS_SO_LATE:
            why += HOW_TO_RESET_SERIAL.format(f"{name.planner or ''}/{order.serial - 1}")
        return why
    if order.attempt <= ledger.unnumbered.get(name.of_task, 0):
        return f"attempt {order.attempt} is over, and this worker has forgotten how it ended"
    return None
