"""What an event has changed in the state: what effects are read off, and whom dispatch looks at."""

from __future__ import annotations

from enum import IntEnum, auto
from typing import Any, NamedTuple


class Part(IntEnum):
    """A part of the state; names within it say what of it was changed."""

    EPOCH = auto()
    GOAL = auto()
    SCHEDULE = auto()
    STATEMENT = auto()
    ANSWER = auto()
    DURATIONS = auto()
    FACT = auto()
    PREVIEW = auto()
    INTERPRETING = auto()
    PLAN = auto()
    """A plan's entry, its records aside."""
    RECORDS = auto()
    """Many records of a plan."""
    RECORD = auto()
    """A plan, and one of its tasks."""
    ROBOT = auto()
    """Whether a robot is there, or may be free."""
    TEAM = auto()


class Touch(NamedTuple):
    """One change."""

    part: Part
    name: Any = None
    task: str = ""


class Touches:
    """The changes of an event so far. Immutable; one more costs the same however many there are."""

    __slots__ = ("_before", "_touch")

    def __init__(self, touch: Touch | None = None, before: Touches | None = None) -> None:
        self._touch, self._before = touch, before

    def and_(self, touch: Touch) -> Touches:
        """These changes and one more."""
        return Touches(touch, self)

    def since(self, earlier: Touches) -> tuple[Touch, ...]:
        """What came after `earlier`, each change once, in order."""
        found: dict[Touch, None] = {}
        now: Touches | None = self
        while now is not None and now is not earlier and now._touch is not None:
            found[now._touch] = None
            now = now._before
        return tuple(reversed(found))


UNTOUCHED = Touches()
