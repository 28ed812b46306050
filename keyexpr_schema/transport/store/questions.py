"""What a store is asked besides for the values of keys, and its answers."""

from __future__ import annotations

import time
from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from keyexpr_schema.errors import ForeignKey, SchemaError, StoreFull
from keyexpr_schema.key import Address, Key, Payload
from keyexpr_schema.key_lookup import key_of
from keyexpr_schema.keyspace import (
    STORE_CHANGES,
    STORE_CLOCK,
    STORE_JOURNAL,
    STORE_REPLACE,
    STORE_STAMPS,
)
from keyexpr_schema.payloads.system import (
    JournalEntry,
    StoreAskerAddress,
    StoreChanges,
    StoreChangesQuery,
    StoreClock,
    StoredValue,
    StoreJournal,
    StoreQuery,
    StoreReplaced,
    StoreReplaceQuery,
    StoreStamps,
    StoreStampsQuery,
)
from keyexpr_schema.principals import Principal
from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.samples import Encoded
from keyexpr_schema.transport.stamps import text_of_stamp, time_s_of_stamp
from keyexpr_schema.transport.store.admission import REMEMBERED, Admission
from keyexpr_schema.transport.store.storage import (
    JournalQuery,
    Store,
    Write,
    is_by_receipt,
    is_stored,
)
from keyexpr_schema.transport.store.troubles import Troubles

_MAX_REPLY = 10_000


WriteIf = Callable[[str, str, bytes, Callable[[], bool]], bool]


@dataclass(slots=True)
class Asked:
    """A question: what was asked, on which key of which realm, with which address.

    `data`: its bytes, and `attached` what travelled beside them. `received`: the store's receipt of
    it [µs]. `found`: what its keys had before the last sync.
    """

    realm: str
    key: Key[Any, Any]
    address: Address
    payload: Payload
    data: bytes = b""
    attached: bytes = b""
    received: int = 0
    found: Sequence[Write | None] = ()

    def concerns(self) -> tuple[list[str], list[str]]:
        """The keys and the patterns, realm included, of which the answer tells."""
        keys: tuple[str, ...] = ()
        patterns: tuple[str, ...] = ()
        match self.payload:
            case StoreStampsQuery():
                keys = self.payload.keys
            case StoreReplaceQuery():
                keys = (self.payload.keyexpr,)
            case StoreChangesQuery():
                patterns = self.payload.patterns
            case StoreQuery(limit=limit) if limit > 0:
                patterns = (self.payload.pattern,)
        here = f"{self.realm}/"
        return [here + key for key in keys], [here + pattern for pattern in patterns]


class ClockBehind(Exception):
    """The store's clock has not reached the stamp of a value that is to be replaced yet."""

    def __init__(self, there: int, now: int) -> None:
        self.seconds = max(0.001, time_s_of_stamp(there) - time_s_of_stamp(now))
        super().__init__(f"the store's clock is {self.seconds:.3g} s behind")


class StoreQuestions:
    """Answers for `store`; `keys` are those that it serves.

    `write` writes a key (with its encoding and bytes) if a condition on what is stored holds, and
    says whether it did; `admission` says what was not taken in, `troubles` why nothing can be, and
    `slowing` whose writes were slowed down.
    """

    def __init__(
        self,
        store: Store,
        write: WriteIf,
        admission: Admission,
        troubles: Troubles,
        slowing: Callable[[], str | None],
    ) -> None:
        self._store, self._write, self._admission = store, write, admission
        self._troubles, self._slowing = troubles, slowing
        self._done: dict[tuple[str, str, str], None] = {}
        """Whose requests to write were done: whoever asks again has not heard it."""
        self._answers: dict[str, Callable[[str, Any], Payload]] = {
            STORE_JOURNAL.name: self._journal,
            STORE_CHANGES.name: self._changes,
            STORE_CLOCK.name: lambda _, __: StoreClock(wall_time_s=time.time()),
        }
        self.keys: tuple[Key[Any, Any], ...] = (
            STORE_JOURNAL, STORE_STAMPS, STORE_REPLACE, STORE_CHANGES, STORE_CLOCK,
        )  # fmt: skip

    def find(self, keyexpr: str) -> tuple[Key[Any, Any], Address] | None:
        """Which question a key expression without realm asks, and how it is addressed."""
        for key in self.keys if keyexpr.startswith("store/") else ():
            with suppress(ForeignKey):
                return key, key.parse(keyexpr)
        return None

    def answer(self, asked: Asked) -> Payload:
        """The answer."""
        payload, address = asked.payload, asked.address
        if isinstance(payload, StoreReplaceQuery) and isinstance(address, StoreAskerAddress):
            return self._replace(asked, address.asker, payload)
        if isinstance(payload, StoreStampsQuery):
            return self._stamps(asked, payload)
        return self._answers[asked.key.name](asked.realm, payload)

    def sync(self, asking: Iterable[Asked]) -> None:
        """Have all that was applied on the disk; until that succeeds nothing is confirmed.

        Those who ask for stamps are told what was there before: what is applied meanwhile, or since
        then, may not be on the disk yet.
        """
        try:
            for each in asking:
                each.found = self._store.newest(each.concerns()[0])
            self._store.sync()
        except Exception as error:
            self._troubles.fails_to_sync(error)
        except BaseException as fault:
            self._troubles.fails_to_sync(fault)
            raise
        else:
            self._troubles.synced()

    def _journal(self, realm: str, asked: StoreQuery) -> StoreJournal:
        limit = max(0, min(asked.limit, _MAX_REPLY))
        query = JournalQuery(asked.after, limit, asked.pattern, asked.since_s, asked.newest)
        found, last = self._store.journal(realm, query)
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

    def _stamps(self, question: Asked, asked: StoreStampsQuery) -> StoreStamps:
        keys, now = question.concerns()[0], question.received
        unsynced = self._troubles.unsynced
        found = question.found if unsynced is None else [None] * len(keys)
        refusals = zip(asked.keys, map(self._admission.refused, keys), strict=True)
        refused = {keyexpr: each for keyexpr, each in refusals if each is not None}

        def stamp(write: Write | None, late_us: int) -> str:
            if write is None:
                return ""
            text = text_of_stamp(write.stamp)
            foreign = asked.source and not text.endswith(f"/{asked.source}")
            # What was received before the asker's has not yet been answered by it.
            older = foreign and write.received < now - late_us and is_by_receipt(write.keyexpr)
            return "" if older else text

        late_us = asked.late_us or (0,) * len(found)
        return StoreStamps(
            timestamps=tuple(map(stamp, found, late_us)),
            failing=unsynced or self._troubles.failing,
            refused={keyexpr: each[:2] for keyexpr, each in refused.items()},
            refusing=self._admission.refusing,
            lasting=tuple(keyexpr for keyexpr, each in refused.items() if each.lasting),
            slowing=self._slowing(),
        )

    def _replace(self, question: Asked, asker: str, asked: StoreReplaceQuery) -> StoreReplaced:
        realm = question.realm
        keyexpr = f"{realm}/{asked.keyexpr}"
        if not is_stored(keyexpr):
            raise SchemaError(f"{asked.keyexpr} is not a key that the store keeps")
        # Access control sees the asker's key and not this one: the table is minded here.
        who, key = Principal.of(asker), key_of(asked.keyexpr)
        objection = who.objection_to_write(key, asked.keyexpr)
        if objection is None:
            asks = Encoded(f"{realm}/{question.key.build(question.address)}", question.data, "")
            value = Encoded(keyexpr, asked.value.encode(), asked.encoding)
            attachment = Attachment.read(question.attached)
            objection = self._admission.objection_to_asker(asker, asks, attachment, value)
        if objection is not None:
            raise SchemaError(objection)

        def there() -> Write | None:
            newest = self._store.newest([keyexpr])[0]
            return None if newest is None or newest.deleted else newest

        def as_expected() -> bool:
            found = there()
            return (text_of_stamp(found.stamp) if found is not None else "") == asked.expected

        request = (realm, asker, asked.request or "")
        done = request in self._done
        try:
            if not done:
                done = self._write(keyexpr, asked.encoding, asked.value.encode(), as_expected)
        except ClockBehind as error:
            return StoreReplaced(done=False, behind_s=error.seconds)
        except StoreFull as full:
            # Who does not know the field asks again, for as long as he waits.
            return StoreReplaced(done=False, behind_s=1.0, failing=str(full))
        if done and asked.request:
            self._done[request] = None
            while len(self._done) > REMEMBERED:
                del self._done[next(iter(self._done))]
        try:
            self._store.sync()
        except Exception as error:
            return StoreReplaced(done=done, behind_s=1.0, failing=str(error))
        if (now := there()) is None:
            return StoreReplaced(done=done)
        return StoreReplaced(
            done=done,
            timestamp=text_of_stamp(now.stamp),
            value=now.data.decode(errors="replace"),
            encoding=now.encoding,
        )

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
        return StoredValue(keyexpr=keyexpr, timestamp=timestamp, received=write.received)
    try:
        value, base64 = write.data.decode(), False
    except UnicodeDecodeError:
        value, base64 = b64encode(write.data).decode(), True
    return StoredValue(
        keyexpr=keyexpr,
        timestamp=timestamp,
        encoding=write.encoding,
        value=value,
        base64=base64,
        received=write.received,
    )
