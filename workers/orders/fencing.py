"""What to do with an order: the fencing rules, as a pure function of what was seen before.

An order is fenced by `(epoch, revision, attempt)`. Zenoh may deliver it late, twice, or after a
restart, and two planners may write for a moment; whatever comes, **one attempt never runs twice**:

* an attempt that has ended is only reported again, whoever orders it;
* an attempt that is queued or running goes on, and an order of it never starts another;
* what is older than what was seen (an older planner's epoch, an older revision of the same plan, a
  lower attempt of the same task) is refused;
* an attempt that had started when the worker went down is *interrupted*: it has ended.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import Enum

from keyexpr_schema.payloads.tasks import Order, Report

TaskName = tuple[str, str]
"""`(plan, task)`."""
AttemptName = tuple[str, str, int]
"""`(plan, task, attempt)`."""

LARGEST_ATTEMPT = 10**18
"""An attempt is a chunk of its report's key, of at most 18 digits."""
LARGEST = 2**63
"""What the journal's file can hold."""


class Phase(str, Enum):
    """How far an attempt has come on this robot."""

    QUEUED = "queued"
    STARTED = "started"
    ENDED = "ended"


@dataclass(frozen=True)
class Attempt:
    """One attempt. `report` is its last word; there once it has ended."""

    order: Order
    phase: Phase
    report: Report | None = None


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
    """Report the attempt as refused; `reason` is a sentence."""

    reason: str


@dataclass(frozen=True)
class Ignore:
    """Nothing to do, and nothing to say that would not overwrite something truer."""


Decision = Accept | Renew | Cancel | Repeat | Refuse | Ignore


def attempt_name(order: Order) -> AttemptName:
    """The attempt that an order is about."""
    return (order.plan, order.task, order.attempt)


@dataclass
class Ledger:
    """Everything this robot has seen of orders. Only the methods change it."""

    epoch: int = 0
    """The highest planner epoch seen."""
    revisions: dict[str, int] = field(default_factory=dict)
    """The highest revision seen, by plan."""
    attempts: dict[AttemptName, Attempt] = field(default_factory=dict)
    _latest: dict[TaskName, int] = field(default_factory=dict)

    def latest(self, plan: str, task: str) -> int:
        """The highest attempt of a task that was ever taken on; 0 if none was."""
        return self._latest.get((plan, task), 0)

    def raise_fences(self, order: Order) -> None:
        """Raise the fences to an order that was taken on, renewed or cancelled."""
        self.epoch = max(self.epoch, order.epoch)
        self.revisions[order.plan] = max(self.revisions.get(order.plan, 0), order.revision)

    def put(self, attempt: Attempt) -> None:
        """Enter an attempt, or how it stands now."""
        name = attempt_name(attempt.order)
        self.raise_fences(attempt.order)
        self.attempts[name] = attempt
        self._latest[name[:2]] = max(self.latest(*name[:2]), name[2])

    def drop(self, name: AttemptName) -> None:
        """Forget an attempt that is queued (its order was withdrawn). The fences stay."""
        if (attempt := self.attempts.get(name)) is not None and attempt.phase is Phase.QUEUED:
            del self.attempts[name]

    def in_phase(self, phase: Phase) -> Iterable[Attempt]:
        """The attempts that stand so, in the order of their arrival."""
        return (e for e in list(self.attempts.values()) if e.phase is phase)


def decide(ledger: Ledger, order: Order) -> Decision:
    """What to do with `order`, given everything seen before. Changes nothing."""
    attempt = ledger.attempts.get(attempt_name(order))
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
    if objection is not None:
        return Refuse(objection)
    return Cancel() if order.cancelled else Accept()


def malformed(order: Order) -> str | None:
    """What is wrong with the numbers of an order that decoded, or `None`."""
    if not 1 <= order.attempt < LARGEST_ATTEMPT:
        return f"attempt {order.attempt} is not a count: attempts go from 1 up"
    if not (0 <= order.epoch < LARGEST and 0 <= order.revision < LARGEST):
        return f"epoch {order.epoch} and revision {order.revision} must be from 0 up, in 63 bits"
    return None


def superseded(ledger: Ledger, order: Order) -> tuple[AttemptName, ...]:
    """Older attempts of the same task that are still queued or running when `order` is accepted.

    A later attempt's order stands on the same key: theirs is withdrawn by it.
    """
    return tuple(
        name
        for name, attempt in ledger.attempts.items()
        if name[:2] == (order.plan, order.task)
        and name[2] < order.attempt
        and attempt.phase is not Phase.ENDED
    )


def _objection(ledger: Ledger, order: Order) -> str | None:
    if order.epoch < ledger.epoch:
        return (
            f"the order is from planner epoch {order.epoch}, but this worker has had orders from "
            f"epoch {ledger.epoch}: only the newer planner gives orders"
        )
    seen = ledger.revisions.get(order.plan, 0)
    if order.revision < seen:
        return (
            f"the order is from revision {order.revision} of {order.plan}, but this worker has "
            f"had orders from revision {seen}"
        )
    latest = ledger.latest(order.plan, order.task)
    if order.attempt < latest:
        return f"attempt {order.attempt} is older than attempt {latest}, which came before"
    return None
