"""Payloads about skill programs: a sentence for a robot, the program that means it, its trace."""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.facts import Value
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Payload
from keyexpr_schema.payloads.goals import Condition

DO = "do"
"""The skill of a task that is a sentence for a robot: it is carried out as a program."""


class ProgramStep(Payload, frozen=True, kw_only=True):
    """One skill call that a program comes to. In `args`, `robot` is the robot that runs it."""

    skill: Id
    args: dict[str, str]


class ProgramPart(Payload, frozen=True, kw_only=True):
    """A part of a sentence for a robot: what shall hold, one stage after the other, if something
    holds when the program comes to it.

    `otherwise` is for when the condition of the part before it does not; it has none of its own.
    """

    stages: tuple[tuple[Condition, ...], ...] = ()
    only_if: tuple[Condition, ...] = ()
    otherwise: bool = False


class Program(Payload, frozen=True, kw_only=True):
    """A sentence for a robot, and the program over its skills that carries it out.

    `stages` are the facts that shall hold, one stage after the other. `code` is empty until
    somebody has written it; `made_by` names who did. What the whole of it needs and makes true
    follows from its `steps`, if it is a sequence of calls; of another one, `after` says what it
    makes true. In both, `robot` stands for the robot that runs it.

    A sentence with an "if" has `parts`, in order; `stages` are then what shall hold in the end
    whatever is found. On its way `always` holds, and of `never` nothing.
    """

    text: str
    stages: tuple[tuple[Condition, ...], ...] = ()
    code: str = ""
    made_by: str = ""
    steps: tuple[ProgramStep, ...] = ()
    after: tuple[Condition, ...] = ()
    duration_s: float = 0.0
    """Predicted, ways included; 0: not said."""
    parts: tuple[ProgramPart, ...] = ()
    always: tuple[Condition, ...] = ()
    never: tuple[Condition, ...] = ()


class ProgramEnd(str, Enum):
    """Why a program ended."""

    DONE = "done"
    FAILED = "failed"
    """By its own word, or because a call of it failed."""
    REPLAN = "replan"
    """It asked for another plan."""
    REFUSED = "refused"
    """It did not pass the checks before its start."""
    STOPPED = "stopped"
    """It broke a limit of the sandbox, or asked for what no program may have."""
    INTERRUPTED = "interrupted"
    """Its worker went down or was stopped, its order was cancelled, or its time was over."""


class ProgramCall(Payload, frozen=True, kw_only=True):
    """One call of a program: what it gave, or why it failed (`reason`).

    `line` is that of the program's text, from 1; 0: not known. `tries` counts those of a skill.
    """

    number: int
    name: str
    args: dict[str, Value] = {}
    line: int = 0
    result: Value = None
    reason: str | None = None
    retryable: bool = True
    tries: int = 0
    started_s: float = 0.0
    ended_s: float = 0.0


class ProgramTrace(Payload, frozen=True, kw_only=True):
    """What a program did, call by call, and why it ended (`None`: it runs)."""

    code: str
    calls: tuple[ProgramCall, ...] = ()
    end: ProgramEnd | None = None
    reason: str | None = None
