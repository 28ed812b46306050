"""Errors of the workers: what a caller of this package may have to handle."""

from __future__ import annotations

from keyexpr_schema.facts import Value

Observation = tuple[str, str, Value]
"""One observed fact: `(relation, subject, value)`, e.g. `("at", "cup_1", None)` for *unknown*."""


class WorkerError(Exception):
    """Root of every error this package raises. The message is one sentence for a person."""


class SkillFailed(WorkerError):
    """A skill could not do what it was asked to, for a reason that lies in the world.

    `reason` is a sentence; `retryable` says whether trying again here and now could help;
    `facts` are those that the failure shows, beside those that `SkillContext.observe` was given.
    """

    def __init__(
        self, reason: str, *, retryable: bool = True, facts: tuple[Observation, ...] = ()
    ) -> None:
        super().__init__(reason)
        self.reason = reason
        self.retryable = retryable
        self.facts = facts


class RobotUnreachable(WorkerError):
    """The driver of the robot does not answer. Raised by embodiments; a try fails of it."""


class BadArguments(WorkerError):
    """The arguments of an order do not fit the parameters of its skill."""


class UnknownSkill(WorkerError):
    """No skill of that name; the message lists those there are."""


class BadSkill(WorkerError):
    """Something that was offered as a skill (say, by an entry point) is not one."""


class ProgramRefused(WorkerError):
    """A skill program does not pass the checks before its start; nothing of it was run."""


class ProgramStopped(WorkerError):
    """A skill program broke a limit, asked for what no program may have, or raised something."""


class JournalBusy(WorkerError):
    """Another process has the journal open: two workers for one robot must not be."""


class RobotTaken(WorkerError):
    """Another worker, with another journal, drives the robot: two would do each order twice."""


class JournalFull(WorkerError):
    """There is no room on the disk to open the journal."""


class JournalUnreadable(WorkerError):
    """The journal's file is not a journal that this version can read."""


class WorkersEnded(WorkerError):
    """A process of several workers ended, and some of its robots were not served then."""
