"""Payloads about the running system itself."""

from __future__ import annotations

from keyexpr_schema.ids import Id
from keyexpr_schema.key import Address, Payload


class PlannerAddress(Address, frozen=True):
    """The central planner; there is one to a realm."""


class PlannerAliveAddress(Address, frozen=True):
    """One run of the planner."""

    incarnation: str


class RecorderAliveAddress(Address, frozen=True):
    """One run of a recorder."""

    incarnation: str


class AuthorityAddress(Address, frozen=True):
    """One authority that certifies who takes part."""

    authority: str


class Revocations(Payload, frozen=True, kw_only=True):
    """Which of its certificates an authority has taken back, as it has signed that.

    `crl` is an X.509 certificate revocation list (RFC 5280), DER in base64.
    """

    crl: str


LARGEST_EPOCH = 2**53
"""One that is higher was not counted up to by any planner, and counts for nothing."""
LARGEST_OVERTAKEN = LARGEST_EPOCH // 2
"""Which epoch of a robot's orders a planner still takes one above: there must be room for those
that come after it. Of one that is higher the robot has to be told by a person."""


class PlannerStatus(Payload, frozen=True, kw_only=True):
    """Who plans in this realm. A planner that sees a higher `epoch` than its own stops."""

    epoch: int
    incarnation: Id
    planners: tuple[str, ...] = ()
    strategies: tuple[str, ...] = ()
    allocators: tuple[str, ...] = ()
    skills: tuple[str, ...] = ()


class UndecodableAddress(Address, frozen=True):
    """A payload that `component` could not decode; `digest` names the key it was on."""

    component: str
    digest: str


class UndecodableValue(Payload, frozen=True, kw_only=True):
    """A value that was put on a key and is not what the key promises.

    `digest` is set where it can be decoded, and could not be used all the same: the SHA-256 of the
    value as it is written. While the key holds that value, the report stands.
    """

    component: Id
    keyexpr: str
    reason: str
    count: int = 1
    digest: str | None = None


class DiagnosticAddress(Address, frozen=True):
    """One thing that `component` looks after, named by `check`."""

    component: str
    check: str


class Diagnostic(Payload, frozen=True, kw_only=True):
    """What is wrong with a component now, in a sentence; the key is deleted when it is over.

    `since_s` is Unix time, `count` how often it happened in this run of the component.
    """

    component: Id
    check: Id
    sentence: str
    since_s: float
    count: int = 1


class StoreAddress(Address, frozen=True):
    """The store of the realm."""


class StoreAskerAddress(Address, frozen=True):
    """The store of the realm, asked by `asker`: a certificate's common name, else a component."""

    asker: str


class StoreAliveAddress(Address, frozen=True):
    """One run of a store."""

    incarnation: str


class StoreClockQuery(Payload, frozen=True, kw_only=True):
    """Asks what time it is on the store's host."""


class StoreClock(Payload, frozen=True, kw_only=True):
    """The clock of the store's host [s, Unix]."""

    wall_time_s: float


class StoreQuery(Payload, frozen=True, kw_only=True):
    """Asks the store for its journal: changes numbered above `after`, at most `limit` of them.

    Of keys that `pattern` matches (`*`, `**`), applied at `since_s` (Unix seconds) or later; the
    first of them, or with `newest` the last.
    """

    after: int = 0
    limit: int = 1000
    pattern: str = "**"
    since_s: float | None = None
    newest: bool = False


class JournalEntry(Payload, frozen=True, kw_only=True):
    """One applied change: when the store applied it (Unix seconds) and what it was."""

    number: int
    wall_time_s: float
    keyexpr: str
    deleted: bool
    timestamp: str
    value: str | None


class StoreJournal(Payload, frozen=True, kw_only=True):
    """A piece of the store's journal. `last` is the number of the newest entry there is."""

    entries: tuple[JournalEntry, ...]
    last: int


class StoreStampsQuery(Payload, frozen=True, kw_only=True):
    """Asks the store for the newest write of each of these keys.

    `source` is the asker's part of its own stamps, and `late_us` how long ago it said of each key
    what it has just put [µs]. With these the store leaves out, of keys that go by receipt, a write
    of somebody else which it received before that. `waits`: the times (NTP64) of those stamps, of
    the writes that the asker has just put and waits for.
    """

    keys: tuple[str, ...]
    source: str = ""
    late_us: tuple[int, ...] = ()
    waits: tuple[str, ...] = ()


class StoreStamps(Payload, frozen=True, kw_only=True):
    """The timestamp of each key's newest write, deletions included; empty: there is none.

    `failing`: why the store can write nothing at the moment (its disk is full, say). `refused`: by
    key, the timestamp of a write that was not taken in lately, and why. `lasting`: those of them
    that never will be, whatever room there comes to be. `refusing`: how many were not lately, of
    all keys, in a sentence. `slowing`: how many writers were slowed down lately, in another.
    """

    timestamps: tuple[str, ...]
    failing: str | None = None
    refused: dict[str, tuple[str, str]] = {}
    refusing: str | None = None
    lasting: tuple[str, ...] = ()
    slowing: str | None = None


class StoreReplaceQuery(Payload, frozen=True, kw_only=True):
    """Asks the store to write a key if it holds what the asker has seen there, and not otherwise.

    `expected`: the timestamp of the value that the asker has seen; empty: none. `request`: the
    name, the asker's own, under which this is asked again whenever no answer came; it is done once.
    """

    keyexpr: str
    value: str
    encoding: str = ""
    expected: str = ""
    request: Id | None = None


class StoreReplaced(Payload, frozen=True, kw_only=True):
    """Whether the store has written the key, and what it holds now (`value` missing: nothing).

    `behind_s` [s]: it could not, because whoever wrote the key last had a clock that far ahead;
    ask again after that time. `failing`: why it can write nothing at the moment, or, if it is done,
    cannot have it on the disk.
    """

    done: bool
    behind_s: float = 0.0
    timestamp: str = ""
    value: str | None = None
    encoding: str = ""
    failing: str | None = None


class StoreChangesQuery(Payload, frozen=True, kw_only=True):
    """Asks the store for what changed since `position`, which an earlier answer gave.

    Of keys that one of `patterns` matches (`*`, `**`), at most `limit` of them. `position` empty:
    from the beginning, which lists what is there now.
    """

    patterns: tuple[str, ...]
    position: str = ""
    limit: int = 1000


class StoredValue(Payload, frozen=True, kw_only=True):
    """What the store holds at one key; `value` missing: it was deleted.

    `base64`: `value` is written in it, because the bytes are not UTF-8. `received` orders what the
    store has received [µs]; 0: it does not say.
    """

    keyexpr: str
    timestamp: str
    encoding: str = ""
    value: str | None = None
    base64: bool = False
    received: int = 0


class StoreChanges(Payload, frozen=True, kw_only=True):
    """The newest value of each key that changed, in the order of change.

    `whole`: the position that was asked for says nothing of this store (it was emptied, replaced,
    or has forgotten deletions since), so this begins with nothing: what is in no page from here on
    is gone. `more`: ask again, from the `position` given here.
    """

    values: tuple[StoredValue, ...]
    position: str
    whole: bool
    more: bool
