"""Who has done what: the planner's log of what people put and delete, which only grows."""

from __future__ import annotations

from enum import Enum

from keyexpr_schema.authors import Author
from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload


class DeletionAddress(Address, frozen=True):
    """One deletion that somebody has announced."""

    deletion: str


class Deletion(Payload, frozen=True, kw_only=True):
    """Who is about to delete `key`, a key expression: a deletion itself names nobody."""

    deletion: Id
    key: str
    by: Author
    wall_time_s: float = 0.0
    """Unix time [s]."""


class AuditAction(str, Enum):
    """What was done to a key."""

    PUT = "put"
    DELETED = "deleted"


class AuditEntry(Payload, frozen=True, kw_only=True):
    """One thing that somebody did, as the planner heard of it: when (ISO 8601, Unix time [s], and
    `time_s` on the fleet's clock [s]), who (empty: it was not said), to which key, in words."""

    at: str
    wall_time_s: float
    time_s: float
    by: str
    action: AuditAction
    key: str
    summary: str
    digest: str = ""
    """Of the value: the same one heard of again is no other deed."""


class AuditQuery(Payload, frozen=True, kw_only=True):
    """Asks the planner who did what, newest first: since a Unix time [s], by whoever's name has
    `by` in it, about a name that stands in the key or the summary; at most the newest `limit`."""

    since_wall_s: float | None = None
    by: str | None = None
    about: str | None = None
    limit: int = 100


class AuditPage(Payload, frozen=True, kw_only=True):
    """What was asked for; `more`: there is older of the same."""

    entries: tuple[AuditEntry, ...] = ()
    more: bool = False
