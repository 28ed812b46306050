"""Payloads of requests to the planner, and its answers."""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.authors import Author
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload
from keyexpr_schema.payloads.plans import Plan, PlanStatus, Violation


class RequestAddress(Address, frozen=True):
    """One request."""

    request: str


class PlanRequest(Payload, frozen=True, kw_only=True):
    """Make a plan for these goals (none named: every goal that waits).

    A `dry_run` is answered with the plan, and leaves nothing behind.
    """

    request: Id
    plan: Id | None = None
    goals: tuple[Id, ...] = ()
    strategy: str = "big-dag"
    planner: str = "symbolic"
    allocator: str = "makespan"
    start: bool = True
    dry_run: bool = False
    programs: bool = False
    """Robots are to carry out programs, each of several calls, instead of one call an order."""
    by: Author = ""
    """Who asks, such as `ana@lab`."""


class ReplanRequest(Payload, frozen=True, kw_only=True):
    """Plan again from what is known now, and for these further goals."""

    request: Id
    plan: Id
    reason: str
    goals: tuple[Id, ...] = ()
    by: Author = ""


class Control(str, Enum):
    """What can be asked of a plan."""

    START = "start"
    APPROVE = "approve"
    CANCEL = "cancel"
    DELETE = "delete"
    ADD_TASK = "add-task"
    TASK_DONE = "task-done"


class ControlRequest(Payload, frozen=True, kw_only=True):
    """Start, approve, cancel or delete a plan; add a task to one (`skill`, `args`, `after`); or say
    that somebody has done its `task` by hand.

    An added task without `robot` is allocated like any other.
    """

    request: Id
    control: Control
    plan: Id
    skill: Id | None = None
    args: dict[str, str] = {}
    after: tuple[Id, ...] = ()
    robot: Id | None = None
    by: Author = ""
    task: Id | None = None
    reason: str = ""


class Answer(Payload, frozen=True, kw_only=True):
    """The planner's answer to a request: final, a sentence, and the plan it is about."""

    request: Id
    accepted: bool
    sentence: str
    plan: Id | None = None
    violations: tuple[Violation, ...] = ()
    preview: Plan | None = None
    preview_status: PlanStatus | None = None
    """What a dry run came to."""
