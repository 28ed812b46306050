"""Payloads about tasks that people name, and the methods by which they are done."""

from __future__ import annotations

from keyexpr_schema.ids import Id
from keyexpr_schema.key import Payload
from keyexpr_schema.payloads.goals import Condition


class TasksQuery(Payload, frozen=True, kw_only=True):
    """Which tasks are known; with `text`, what that would mean if `speaker` said it as a goal."""

    text: str | None = None
    speaker: Id | None = None


class KnownTask(Payload, frozen=True, kw_only=True):
    """A task that goals can call by the phrases of `says`; `file` says where it stands."""

    task: str
    says: tuple[str, ...] = ()
    about: str = ""
    file: str = ""
    methods: int = 1


class MethodTried(Payload, frozen=True, kw_only=True):
    """What a method says, with parameters filled in; why it cannot be taken, or that it is."""

    text: str
    taken: bool = False
    reason: str | None = None


class TaskCalled(Payload, frozen=True, kw_only=True):
    """A task that a text calls by name, and its methods up to the one that is taken."""

    said: str
    task: str
    methods: tuple[MethodTried, ...] = ()


class TasksReply(Payload, frozen=True, kw_only=True):
    """Every task that is known; or what the text calls, and would be understood as.

    `stages` are the conditions, `always` and `never` those that would hold on the way. Without
    them, `reason` says why not, and `candidates` what it can mean, if that is several things.
    """

    tasks: tuple[KnownTask, ...] = ()
    called: tuple[TaskCalled, ...] = ()
    stages: tuple[tuple[Condition, ...], ...] = ()
    always: tuple[Condition, ...] = ()
    never: tuple[Condition, ...] = ()
    understood: str | None = None
    reason: str | None = None
    candidates: tuple[str, ...] = ()
