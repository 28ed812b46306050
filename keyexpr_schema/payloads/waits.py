"""What goals, plans and tasks wait for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum

from keyexpr_schema.ids import Id
from keyexpr_schema.key import Payload


class WaitKind(str, Enum):
    """What kind of thing is waited for; beside each, the fields of `WaitReason` that name it."""

    TASK = "task"
    """`plan`, `task`: it has to succeed first."""
    PLAN = "plan"
    """`plan`: a goal waits for what that plan waits for."""
    GOAL = "goal"
    """`goal`: it has to end first."""
    NO_PLAN = "no-plan"
    """Nobody has asked for a plan."""
    REVISION = "revision"
    """`plan`, `revision`, `sentence`: it is being made, and why."""
    APPROVAL = "approval"
    """`plan`: a person has to approve it."""
    START = "start"
    """`plan`: a person has to start it."""
    CONFIRMATION = "confirmation"
    """`goal`, `sentence`: a person has to say whether a model's words for it are meant."""
    QUESTION = "question"
    """`goal`, `sentence`: a person has to say which of several meanings is meant."""
    READING = "reading"
    """`goal`: a language model says the sentence in simpler words."""
    BUSY = "busy"
    """`robot`, `plan`, `task`: what it does now."""
    RESERVED = "reserved"
    """`robot`, `plan`: it has begun something for that plan, or carries something for it."""
    AWAY = "away"
    """`robot`, `since_wall_s`: its worker is not connected."""
    LOST = "lost"
    """`robot`; with `plan`, `task`: an order that it may have carried out, of which it has not
    spoken. Else it is not registered any more."""
    LEASE = "lease"
    """`robot`, `plan`, `task`: its worker has that order, and no lease: it moves only while its
    planner is heard."""
    UNREADABLE = "unreadable"
    """`robot`, `plan`, `task`, `sentence`: its worker cannot read that order, and why."""
    CANCELLING = "cancelling"
    """`plan`: it is being cancelled; with `robot`, `task`: that order is."""
    PAUSED = "paused"
    """`hold`, and the `robot`, `plan` or `goal` that it is about; none: the whole fleet."""
    DRAINED = "drained"
    """`hold`, `robot`."""
    STOPPED = "stopped"
    """`stop`, `robot`."""
    CHARGING = "charging"
    """`robot`, `sentence`."""
    CLOSED = "closed"
    """`closure`, `sentence`, and the `robot` that does not get through there; none: nobody does."""
    DUE = "due"
    """`due_s`, `sentence`: the time has not come."""
    CONDITION = "condition"
    """`sentence`: what has to hold first, or has to be known."""
    NO_ROBOT = "no-robot"
    """`sentence`: no robot that is there can do it, and why."""


class WaitReason(Payload, frozen=True, kw_only=True, omit_defaults=True):
    """One thing that a goal, a plan or a task waits for; see `WaitKind`.

    Times are absolute: `due_s` on the fleet's clock [s], `since_wall_s` in Unix time [s].
    """

    kind: WaitKind
    plan: Id | None = None
    task: Id | None = None
    goal: Id | None = None
    robot: Id | None = None
    revision: int | None = None
    hold: Id | None = None
    stop: Id | None = None
    closure: Id | None = None
    due_s: float | None = None
    since_wall_s: float | None = None
    sentence: str | None = None

    def __str__(self) -> str:
        return _PHRASES[self.kind](self)


def _busy(reason: WaitReason) -> str:
    return f"{reason.robot} is busy with {reason.plan}/{reason.task}"


def _lost(reason: WaitReason) -> str:
    if reason.task is None:
        return f"{reason.robot} is not registered"
    return f"{reason.robot} has not said what became of {reason.plan}/{reason.task}"


def _cancelling(reason: WaitReason) -> str:
    if reason.task is None:
        return f"{reason.plan} is being cancelled"
    return f"{reason.robot} has not yet stopped {reason.plan}/{reason.task}"


def _because(reason: WaitReason) -> str:
    return f" ({reason.sentence})" if reason.sentence else ""


def _subject(reason: WaitReason) -> str:
    return reason.robot or reason.plan or reason.goal or "the fleet"


_PHRASES: Mapping[WaitKind, Callable[[WaitReason], str]] = {
    WaitKind.TASK: lambda r: f"{r.plan}/{r.task}",
    WaitKind.PLAN: lambda r: f"plan {r.plan}",
    WaitKind.GOAL: lambda r: f"goal {r.goal}",
    WaitKind.NO_PLAN: lambda r: (
        f"it has no plan: {r.sentence}" if r.sentence else "nobody has asked for a plan"
    ),
    WaitKind.REVISION: lambda r: f"{r.plan} revision {r.revision} is being made{_because(r)}",
    WaitKind.APPROVAL: lambda r: f"approval of {r.plan}",
    WaitKind.START: lambda r: f"the start of {r.plan}",
    WaitKind.CONFIRMATION: lambda r: f"confirmation of goal {r.goal}{_because(r)}",
    WaitKind.QUESTION: lambda r: f"an answer about goal {r.goal}{_because(r)}",
    WaitKind.READING: lambda r: "a language model reads it",
    WaitKind.BUSY: _busy,
    WaitKind.RESERVED: lambda r: f"{r.robot} is reserved by {r.plan}",
    WaitKind.AWAY: lambda r: f"{r.robot} is away",
    WaitKind.LOST: _lost,
    WaitKind.LEASE: lambda r: f"{r.robot} has no lease yet, without which it does not move",
    WaitKind.UNREADABLE: lambda r: f"{r.robot} cannot read its order{_because(r)}",
    WaitKind.CANCELLING: _cancelling,
    WaitKind.PAUSED: lambda r: f"{_subject(r)} is paused{_because(r)}",
    WaitKind.DRAINED: lambda r: f"{r.robot} is drained{_because(r)}",
    WaitKind.STOPPED: lambda r: f"{r.robot} is stopped by an emergency stop{_because(r)}",
    WaitKind.CHARGING: lambda r: f"{r.robot} is charging{_because(r)}",
    WaitKind.CLOSED: lambda r: r.sentence or f"{r.closure} is closed",
    WaitKind.DUE: lambda r: r.sentence or "its time",
    WaitKind.CONDITION: lambda r: r.sentence or "what has to hold first",
    WaitKind.NO_ROBOT: lambda r: r.sentence or "no robot that is there can do it",
}
