"""Facts that the store has not taken in, for a reason that passes: they wait beside the queue."""

from __future__ import annotations

import sqlite3

import msgspec

from keyexpr_schema.decoding import decode
from keyexpr_schema.facts import FactKey
from keyexpr_schema.full_disk import is_full
from keyexpr_schema.payloads.world import Fact
from workers.host_clock import running_s, since
from workers.seen_facts import SeenFacts

MOST = 1000
"""Of so many variables the latest word is kept; a robot knows of fewer."""


SAME_S = 0.1
"""What is tried again was noted at the same time [s], and is not written once more."""


class RefusedFacts:
    """The last word of each variable, in a table of a journal; the first is to be tried next."""

    def __init__(self, db: sqlite3.Connection, seen: SeenFacts) -> None:
        """`seen` gets what waits, and when it was seen."""
        self._db, self._seen = db, seen
        self._waiting: dict[FactKey, tuple[Fact, float | None]] = {}
        for payload, noted_s in db.execute("SELECT payload, noted_s FROM refused"):
            fact = decode(payload, Fact)
            self._waiting[fact.key] = fact, noted_s
            seen.note(fact, running_s() - since(noted_s))
            seen.wait(fact.key, fact.key)

    def __len__(self) -> int:
        return len(self._waiting)

    def __contains__(self, fact: Fact) -> bool:
        waiting = self._waiting.get(fact.key)
        return waiting is not None and waiting[0] == fact

    def next(self) -> tuple[Fact, float] | None:
        """The one that is to be tried next, and how long ago it was noted [s]."""
        for fact, noted_s in self._waiting.values():
            return fact, since(noted_s)
        return None

    def keep(self, fact: Fact, age_s: float) -> Fact | None:
        """Have a fact wait, behind the others; which does not any more, if they are too many.

        Raises:
            sqlite3.Error: there is no room.
        """
        noted_s = running_s() - age_s
        known, known_s = self._waiting.get(fact.key, (None, None))
        if known != fact or known_s is None or noted_s > known_s + SAME_S:
            self._db.execute(
                "INSERT OR REPLACE INTO refused VALUES (?, ?, ?, ?)",
                (fact.relation, fact.subject, msgspec.json.encode(fact), noted_s),
            )
        self._waiting.pop(fact.key, None)
        self._waiting[fact.key] = fact, noted_s
        self._seen.wait(fact.key, fact.key)
        if len(self._waiting) <= MOST:
            return None
        oldest, _ = next(iter(self._waiting.values()))
        self.drop(oldest.key)
        return oldest

    def drop(self, key: FactKey) -> None:
        """Nothing of it waits any more: it was sent, or something later was said of it."""
        if self._waiting.pop(key, None) is None:
            return
        self._seen.sent(key)
        try:
            self._db.execute(
                "DELETE FROM refused WHERE (relation, subject) = (?, ?)",
                (key.relation, key.subject),
            )
        except sqlite3.Error as error:  # said once more it is overtaken
            if not is_full(error):
                raise
