"""What a store is asked besides for the values of keys, and its answers. No Zenoh here."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable
from typing import Any

from keyexpr_schema.key import Key, Payload
from keyexpr_schema.keyspace import STORE_CHANGES, STORE_JOURNAL
from keyexpr_schema.payloads.system import (
    JournalEntry,
    StoreAddress,
    StoreChanges,
    StoreChangesQuery,
    StoredValue,
    StoreJournal,
    StoreQuery,
)
from keyexpr_schema.transport.samples import text_of_stamp
from keyexpr_schema.transport.storage import Store, Write

_MAX_REPLY = 10_000


class StoreQuestions:
    """Answers for `store`; `keys` are those that it serves, by key expression without realm."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._answers: dict[str, Callable[[str, Any], Payload]] = {
            STORE_JOURNAL.name: self._journal,
            STORE_CHANGES.name: self._changes,
        }
        self.keys: dict[str, Key[StoreAddress, Any]] = {
            key.build(StoreAddress()): key for key in (STORE_JOURNAL, STORE_CHANGES)
        }

    def answer(self, realm: str, key: Key[StoreAddress, Any], asked: Payload) -> Payload:
        """The answer to `asked`, which came on `key` of that realm."""
        return self._answers[key.name](realm, asked)

    def _journal(self, realm: str, asked: StoreQuery) -> StoreJournal:
        limit = max(0, min(asked.limit, _MAX_REPLY))
        found, last = self._store.journal(realm, asked.after, limit)
        entries = tuple(
            JournalEntry(
                number=one.number,
                wall_time_s=one.wall_time_s,
                keyexpr=one.keyexpr.removeprefix(realm + "/"),
                deleted=one.deleted,
                timestamp=text_of_stamp(one.stamp),
                value=None if one.deleted else one.data.decode(errors="replace"),
            )
            for one in found
        )
        return StoreJournal(entries=entries, last=last)

    def _changes(self, realm: str, asked: StoreChangesQuery) -> StoreChanges:
        patterns = [f"{realm}/{pattern}" for pattern in asked.patterns]
        limit = max(1, min(asked.limit, _MAX_REPLY))
        found = self._store.changes(patterns, asked.position, limit)
        values = tuple(_stored_value(realm, write) for write in found.writes)
        return StoreChanges(
            values=values, position=found.position, whole=found.whole, more=found.more
        )


def _stored_value(realm: str, write: Write) -> StoredValue:
    keyexpr, timestamp = write.keyexpr[len(realm) + 1 :], text_of_stamp(write.stamp)
    if write.deleted:
        return StoredValue(keyexpr=keyexpr, timestamp=timestamp)
    try:
        value, base64 = write.data.decode(), False
    except UnicodeDecodeError:
        value, base64 = b64encode(write.data).decode(), True
    return StoredValue(
        keyexpr=keyexpr, timestamp=timestamp, encoding=write.encoding, value=value, base64=base64
    )
