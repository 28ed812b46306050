"""The links of a chain of reasons, and the words that several kinds of them share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import msgspec

from cli.times import iso, moment
from cli.views.text import last_s
from keyexpr_schema.payloads.goals import GoalStatus
from keyexpr_schema.payloads.plans import PlanStatus
from keyexpr_schema.payloads.tasks import TaskRecord, TaskState

if TYPE_CHECKING:
    from keyexpr_schema.payloads.system import Diagnostic


class Explained(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """One link: what it is about, how that stands, since when (ISO 8601), and what lies behind.

    `kind` is `goal`, `plan`, `task`, or that of a `WaitReason`; `hint` a command that ends it.
    """

    about: str
    kind: str
    sentence: str
    state: str | None = None
    since: str | None = None
    hint: str | None = None
    because: tuple[Explained, ...] = ()


def wrong_with(found: Diagnostic) -> Explained:
    """What a process says is wrong."""
    return Explained(
        about=found.component,
        kind="diagnostic",
        sentence=f"{found.component}: {found.sentence}",
        since=iso_of(found.since_s),
    )


def told_above(kind: str, about: str, name: str, state: str) -> Explained:
    """What was told already."""
    sentence = f"{name} is {state}, as said above"
    return Explained(about=about, kind=kind, sentence=sentence, state=state)


def in_a_circle(goal: str, state: str) -> Explained:
    """A goal that waits for one which waits for it."""
    return Explained(
        about=goal,
        kind="goal",
        sentence=f"goal {goal} waits for this in turn: by themselves none of them is ever begun",
        state=state,
        hint=f"robotctl goal delete {goal}",
    )


def how_many_done(tasks: Iterable[TaskRecord]) -> str:
    """`: 2 of its 4 tasks are done`; nothing where there are none."""
    counted = list(tasks)
    done = sum(record.state is TaskState.SUCCEEDED for record in counted)
    return f": {done} of its {len(counted)} tasks are done" if counted else ""


def how_ended(of: GoalStatus | PlanStatus | TaskRecord) -> str:
    """`failed today 14:03: no finger`, `was reached today 14:03`."""
    state = of.state.value
    ended = state if state in ("failed", "succeeded") else f"was {state.replace('-', ' ')}"
    return f"{ended}{since_when(of)}{said_of(of.reason)}"


def since_when(of: GoalStatus | PlanStatus | TaskRecord, before: str = " ") -> str:
    """Since when it is so, with what stands before that; nothing where nobody knows."""
    at_s = last_s(of) if isinstance(of, TaskRecord) else of.time_s
    at = moment(of.wall_time_s, at_s)
    return f"{before}{at}" if at else ""


def iso_of(wall_s: float | None) -> str | None:
    """A Unix time [s] in ISO 8601, where there is one."""
    return None if wall_s is None else iso(wall_s)


def said_of(reason: str | None) -> str:
    """A reason behind what it is for; nothing where none is given."""
    return f": {reason}" if reason else ""
