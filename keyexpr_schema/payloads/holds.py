"""Pauses and drains: what the planner gives no further orders to, until somebody ends that."""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.authors import Author
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload


class HoldAddress(Address, frozen=True):
    """One pause or drain."""

    hold: str


class HoldKind(str, Enum):
    """What is done about what goes on: a pause keeps work where it is, a drain gives it away."""

    PAUSE = "pause"
    DRAIN = "drain"


class Hold(Payload, frozen=True, kw_only=True):
    """While its key is there, `robots` and `plans` get no new order, and `schedules` begin nothing.

    A pause that names none is of the whole fleet, also of what comes later. `schedules` are also
    goals that stand by for something, or are for later. With `interrupt`
    what runs is interrupted, and done again afterwards. A drain is of robots: each ends its task,
    and delivers what it carries; the rest goes to others, and nothing is planned with it.
    """

    hold: Id
    kind: HoldKind
    robots: tuple[Id, ...] = ()
    plans: tuple[Id, ...] = ()
    schedules: tuple[Id, ...] = ()
    interrupt: bool = False
    by: Author = ""
    reason: str = ""
    wall_time_s: float = 0.0
    """When it was given, Unix time [s]."""

    @property
    def of_all(self) -> bool:
        """Whether it is a pause of the whole fleet."""
        return self.kind is HoldKind.PAUSE and not (self.robots or self.plans or self.schedules)

    def __str__(self) -> str:
        done = "drained" if self.kind is HoldKind.DRAIN else "paused"
        whom = f" by {self.by}" if self.by else ""
        why = f" ({self.reason})" if self.reason else ""
        return f"{done}{whom}{why}"
