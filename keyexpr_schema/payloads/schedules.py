"""Schedules: goals that are wanted again and again, at times of day or after spans of time."""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload
from keyexpr_schema.payloads.goals import Goal


class ScheduleAddress(Address, frozen=True):
    """One schedule."""

    schedule: str


class Missed(str, Enum):
    """What becomes of times that pass while nobody is there to begin a run."""

    ONCE = "once"
    """One run makes up for all of them."""
    SKIP = "skip"
    """They are left out."""
    ALL = "all"
    """Each gets its run, one after the other."""


class Overlap(str, Enum):
    """What becomes of a time that comes while the run before still goes on."""

    SKIP = "skip"
    QUEUE = "queue"
    """Its run begins when that one has ended."""


class Schedule(Payload, frozen=True, kw_only=True):
    """Each time that comes makes a goal of its own, called `SCHEDULE.1`, `SCHEDULE.2`, ….

    `goal` is what each of them wants; it has the schedule's name. Its `every` is a line of cron or
    an ISO 8601 period, in its time `zone`; without, its text says the times ("every morning"). It
    counts from `not_before_s` on, or from when it was said.
    """

    schedule: Id
    goal: Goal
    missed: Missed = Missed.ONCE
    overlap: Overlap = Overlap.SKIP


class ScheduleState(str, Enum):
    """How a schedule stands."""

    ACTIVE = "active"
    PAUSED = "paused"
    """Somebody holds it (`holds/…`): its times pass without a run."""
    READING = "reading"
    """A language model says its sentence in simpler words."""
    REJECTED = "rejected"
    OVER = "over"
    """No time will come any more."""


class ScheduleStatus(Payload, frozen=True, kw_only=True):
    """What the planner says of a schedule, or of a goal whose sentence says that it is one.

    Times are on the fleet's clock [s], and as clocks show them in the schedule's zone, in ISO 8601:
    since when times count (`begins`), when the `next` run begins, when the `last` one began. `runs`
    counts runs, `latest` is the goal of the last one, `going_on` those that have not ended,
    `queued` the times that wait for it. `missed` times had nobody there and got no run of their
    own, `skipped` ones came while the run before still went on. `reason` is a sentence on what is
    wrong, or why nothing is done.
    """

    schedule: Id
    state: ScheduleState
    text: str = ""
    every: str | None = None
    zone: str | None = None
    of_goal: bool = False
    """It is a goal's (`goals/…`), whose sentence says the times."""
    understood: str | None = None
    begins: str | None = None
    begins_s: float | None = None
    next: str | None = None
    next_s: float | None = None
    last: str | None = None
    last_s: float | None = None
    latest: Id | None = None
    going_on: tuple[Id, ...] = ()
    queued: tuple[str, ...] = ()
    runs: int = 0
    missed: int = 0
    skipped: int = 0
    reason: str | None = None
