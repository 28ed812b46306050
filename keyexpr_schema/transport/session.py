"""The typed Zenoh session on asyncio: keys and payloads in, keys and payloads out."""

from __future__ import annotations

import asyncio
import time
import uuid
from collections.abc import AsyncIterator, Awaitable, Callable, Iterable
from contextlib import AbstractAsyncContextManager, asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from keyexpr_schema.errors import ForeignKey, Unconfirmed, UndecodablePayload, Unreachable
from keyexpr_schema.key import A, Address, Component, Delivery, Key, KeyTree, P, Payload
from keyexpr_schema.keyspace import DELETION, KEYSPACE
from keyexpr_schema.payloads.audit import Deletion, DeletionAddress
from keyexpr_schema.payloads.system import StoreStamps
from keyexpr_schema.transport.clock_skew import ClockWatch
from keyexpr_schema.transport.connecting import open_link
from keyexpr_schema.transport.credentials import Credentials, attaching, judging, of_client
from keyexpr_schema.transport.identity import CheckedTrace, RouterAccess
from keyexpr_schema.transport.link import Link, Put
from keyexpr_schema.transport.liveliness import TokenChange, TokenWatch
from keyexpr_schema.transport.queries import QueryServer, send_query
from keyexpr_schema.transport.samples import Sample, decode_value, encode_value, encoding_of
from keyexpr_schema.transport.session_config import SessionConfig
from keyexpr_schema.transport.store.client import PRESENT_S, SETTLE_S, StoreClient
from keyexpr_schema.transport.trace import Operation, Trace
from keyexpr_schema.transport.undecodable import UndecodableReports
from keyexpr_schema.transport.watch import Change, Narrowed, OnLost, Watch
from keyexpr_schema.transport.zenoh_file import read_zenoh_file

__all__ = [
    "Change",
    "Narrowed",
    "Session",
    "SessionConfig",
    "TokenChange",
    "TokenWatch",
    "Watch",
    "open_session",
]


_ANNOUNCED = frozenset(
    key
    for key in KEYSPACE
    if key.stored and Component.PERSON in key.writers and Component.PLANNER in key.readers
) - {DELETION}
"""Keys of which the planner's audit log says who has deleted them."""


@asynccontextmanager
async def open_session(config: SessionConfig) -> AsyncIterator[Session]:
    """A session that is closed at the end of the block, whatever happens in it.

    Raises:
        Unreachable: no router answered within `config.connect_timeout_s`.
        BadZenohConfig: `config.zenoh_config` cannot be read or used.
        NotAllowed: the router does not know who has this certificate; who waits for a router waits.
        ClockSkewed: the clock of this host is off; who waits for a router waits for that, too.
    """
    named = config.zenoh_config
    file = read_zenoh_file(named) if isinstance(named, Path) else named
    if file is not None and not config.endpoints:
        config = replace(config, endpoints=file.connects("client"))
    async with open_link(
        config.endpoints, config.realm, config.lease_s, config.connect_timeout_s, file
    ) as link:
        session = Session(config, link, of_client(file))
        access = RouterAccess(session.principal, config.endpoints, session.store_present)
        if config.connect_timeout_s is not None:
            told = config.urgent or await session.clock.check()
            # A link that is new may not know the store yet.
            if not told and await access.check(SETTLE_S, config.connect_timeout_s):
                await session.clock.check()
            yield session
            return
        await session.clock.until_right()
        await access.wait()
        watching = asyncio.create_task(session.clock.watch())
        try:
            yield session
        finally:
            watching.cancel()


class Session:
    """Puts, gets, watches and queries typed values; made by `open_session`."""

    def __init__(
        self, config: SessionConfig, link: Link, credentials: Credentials | None = None
    ) -> None:
        self.config, self.link, name = config, link, config.component
        link.attach = attaching(credentials, config.realm)
        self.principal = who = None if credentials is None else credentials.principal
        self._trace = CheckedTrace(name, who)
        self._judges = judging(credentials, config.realm, link.router, self._trace)
        self._undecodable = UndecodableReports(link, name, Trace(name))
        self._store = StoreClient(link, config.endpoints, Trace(name), who or name)
        self.clock = ClockWatch(self._store.clock_s, link.stamps)
        """How far the clock of this host is from that of the store's."""

    @property
    def connected(self) -> bool:
        """Whether a router is visible now."""
        return self.link.router.up

    @property
    def connections(self) -> int:
        """How often a router came into view so far."""
        return self.link.router.generation

    async def wait_connected(self, timeout_s: float | None = None) -> None:
        """Wait until a router is visible.

        Raises:
            Unreachable: none was within `timeout_s`.
        """
        try:
            await self.link.router.wait_up(timeout_s)
        except TimeoutError:
            raise Unreachable.no_router(self.config.endpoints, timeout_s) from None

    async def wait_reconnected(self, connections: int) -> None:
        """Wait until a router comes into view once more than `connections` says."""
        await self.link.router.wait_after(connections)

    # --- writing ---------------------------------------------------------------------------------

    def put(self, key: Key[A, P], address: A, payload: P) -> None:
        """Put and forget: lost without a word while no router is there.

        A stream is dropped when the link is full, anything else waits its turn.
        """
        keyexpr = key.build(address)
        self._trace.note("put", key, keyexpr)
        self.link.send_soon(
            keyexpr,
            key.encode(payload),
            encoding_of(key),
            block=key.delivery is not Delivery.STREAM,
        )

    async def confirm(
        self, key: Key[A, P], address: A, payload: P, timeout_s: float = 10.0, *, age_s: float = 0.0
    ) -> None:
        """Put, and return when the store holds exactly this value, or a later one of this session.

        The put is repeated with the same timestamp, so repeating it does no harm. Calls that wait
        at the same time are confirmed by one question to the store. `age_s`: so long ago it was
        said; where the key goes by receipt it counts as received then.

        Raises:
            Overtaken: somebody else's value has a later timestamp, or was received later; this one
                is not stored.
            WriteRefused: it is beyond a limit of the store.
            Unconfirmed: it was not confirmed within `timeout_s`; it may still arrive.
            UndecodablePayload: no reader could read it, so it is not put at all.
        """
        await self._confirm(key, address, encode_value(key, payload, address), timeout_s, age_s)

    async def confirm_new(
        self, key: Key[A, P], address: A, payload: P, timeout_s: float = 10.0
    ) -> None:
        """As `confirm`, of a key that nobody has written before: if it was not confirmed, who has
        heard of it hears that it is gone. Else they would obey what nobody can list or end.

        Raises:
            Unconfirmed, UndecodablePayload: as `confirm`.
        """
        try:
            await self.confirm(key, address, payload, timeout_s)
        except Unconfirmed:
            keyexpr = key.build(address)
            self._trace.note("delete", key, keyexpr)
            stamp = self.link.new_timestamp()
            await self.link.send(Put(keyexpr, None, encoding_of(key), stamp))
            raise

    async def delete(self, key: Key[A, P], address: A, timeout_s: float = 10.0) -> None:
        """Delete, and return when the store has done so.

        Raises:
            Overtaken: somebody else's value has a later timestamp; it is still there.
            Unconfirmed: it was not confirmed within `timeout_s`; it may still be carried out.
        """
        if self.config.by and key in _ANNOUNCED:
            name = f"del-{uuid.uuid4().hex[:12]}"
            announced = Deletion(
                deletion=name, key=key.build(address), by=self.config.by, wall_time_s=time.time()
            )
            await self.confirm(DELETION, DeletionAddress(name), announced, timeout_s)
        await self._confirm(key, address, None, timeout_s)

    async def delete_tree(self, tree: KeyTree, name: str, timeout_s: float = 10.0) -> None:
        """Delete every value about `name`, and return when the store has none, or newer ones.

        Raises:
            Unconfirmed: there were old values after `timeout_s`.
        """
        keyexpr = tree.build(name)
        for key in tree.keys:
            self._trace.note("delete", key, keyexpr)
        if "*" in keyexpr:
            await self._store.delete_matching(tree.keys[0], keyexpr, timeout_s)
        else:
            await self._store.write(tree.keys[0], keyexpr, None, timeout_s)

    async def create(self, key: Key[A, P], address: A, payload: P, timeout_s: float = 10.0) -> bool:
        """Put if there is no value yet; whether it was put. Of several at once one succeeds.

        With a zenohd storage, which cannot compare and set, that is not certain. Nor is it where
        the store was started again before it answered, and somebody has written since.

        Raises:
            Unconfirmed: it was not known within `timeout_s`; it may have been put.
            UndecodablePayload: no reader could read it, so it is not put at all.
        """
        keyexpr, data = self._noted("put", key, address), encode_value(key, payload, address)
        return (await self._store.replace(key, keyexpr, data, None, timeout_s)).done

    async def update(
        self, key: Key[A, P], address: A, change: Callable[[P | None], P], timeout_s: float = 10.0
    ) -> P:
        """Put `change` of the value there (None: none, or one that does not decode), and return it.

        Nobody else's value is overwritten unseen: when somebody has written in the meantime,
        `change` is called again. With a zenohd storage that is not certain. Where the answer was
        lost with its store, and somebody has written since, it may be made twice: what counts
        must bear that.

        Raises:
            Unconfirmed: it was not known within `timeout_s`; it may have been put.
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        keyexpr = self._noted("put", key, address)
        seen = next(iter(await self._read(key, keyexpr, timeout_s)), None)
        while True:
            value = None
            if seen is not None:
                with suppress(UndecodablePayload):
                    value = decode_value(key, seen)
            changed = change(value)
            data = encode_value(key, changed, address)
            replaced = await self._store.replace(key, keyexpr, data, seen, timeout_s)
            if replaced.done:
                return changed
            seen = replaced.there

    def _noted(self, operation: Operation, key: Key[A, Any], address: A) -> str:
        """The key expression of what is about to be written."""
        if not key.stored:
            raise TypeError(f"{key.name} is {key.delivery.value}: it cannot be confirmed")
        keyexpr = key.build(address)
        self._trace.note(operation, key, keyexpr)
        return keyexpr

    async def _confirm(
        self,
        key: Key[A, Any],
        address: A,
        data: bytes | None,
        timeout_s: float,
        age_s: float = 0.0,
    ) -> None:
        keyexpr = self._noted("delete" if data is None else "put", key, address)
        await self._store.write(key, keyexpr, data, timeout_s, age_s)

    # --- reading ---------------------------------------------------------------------------------

    async def get(self, key: Key[A, P], address: A, timeout_s: float = 3.0) -> P | None:
        """The stored value, or None when there is none.

        Raises:
            UndecodablePayload: there is one, but not of the type that the key promises.
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        samples = await self._read(key, key.build(address), timeout_s)
        return decode_value(key, samples[0]) if samples else None

    async def list(
        self, key: Key[A, P], timeout_s: float | None = None, **fixed: str | int
    ) -> dict[A, P]:
        """Every stored value whose named address fields have these values, in order of address.

        Values that do not decode are reported and left out.

        Raises:
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        found: dict[A, P] = {}
        within_s = self.config.answer_s if timeout_s is None else timeout_s
        for sample in await self._read(key, key.pattern(**fixed), within_s):
            try:
                found[key.parse(sample.keyexpr)] = decode_value(key, sample)
            except (ForeignKey, UndecodablePayload) as error:
                self._undecodable.report(sample.keyexpr, sample.data, str(error))
        return dict(sorted(found.items()))

    async def _read(self, key: Key[Any, Any], keyexpr: str, timeout_s: float) -> tuple[Sample, ...]:
        if not key.stored:
            raise TypeError(f"{key.name} is {key.delivery.value}: there is nothing to get")
        self._trace.note("read", key, keyexpr)
        return await self._store.list(keyexpr, timeout_s)

    async def store_troubles(self, timeout_s: float = 3.0) -> StoreStamps:
        """Why the store is `failing`, what it is `refusing`, whom `slowing`; zenohd never says."""
        return await self._store.troubles(timeout_s)

    async def store_present(self, within_s: float = PRESENT_S) -> bool:
        """Whether a store or a storage is there, or comes to be known within that time."""
        return await self._store.present(within_s)

    def report_unusable(self, key: Key[A, P], address: A, value: P, reason: str) -> None:
        """Report a value that can be read, but not be used, once for each distinct one."""
        self._undecodable.report(key.build(address), key.encode(value), reason, decodes=True)

    def watch(
        self,
        *selections: Key[Any, Any] | tuple[Key[Any, Any], dict[str, str | int]] | Narrowed,
        known: Iterable[tuple[Key[Any, Any], Address]] = (),
        on_trouble: Callable[[str | None], None] | None = None,
        collect_s: float | None = None,
        in_order: bool = False,
        on_lost: OnLost | None = None,
    ) -> AbstractAsyncContextManager[Watch]:
        """Watch keys, or `(key, {field: value})`: first all that is stored, then what changes.

        `known` are keys that had a value when it was looked last: those that have none any more
        are shown as deleted. `on_trouble` hears why what is stored cannot be read, and None when
        it can be again. Where nobody is in a hurry, `collect_s` saves much: what came is taken
        together, every so many seconds, by its timestamps. `in_order`: what goes by receipt
        comes in the order in which the store received it, a question later than it passes.
        `on_lost` hears of known keys of which the store has lost the value, and not heard since.
        """
        patterns: list[tuple[Key[Any, Any], str, Narrowed | None]] = []
        for selection in selections:
            narrowed = selection if isinstance(selection, Narrowed) else None
            named = selection.key if isinstance(selection, Narrowed) else selection
            key, fixed = named if isinstance(named, tuple) else (named, {})
            if key.delivery in (Delivery.TOKEN, Delivery.QUERY):
                raise TypeError(f"{key.name} is a {key.delivery.value}: it cannot be watched")
            patterns.append((key, key.pattern(**fixed), narrowed))
            self._trace.note("watch", key, key.pattern(**fixed))
        return Watch(
            self.link,
            self._store,
            self._undecodable,
            patterns,
            known,
            on_trouble,
            collect_s,
            in_order,
            on_lost,
            self._judges,
        ).running()

    # --- tokens ----------------------------------------------------------------------------------

    def token(self, key: Key[A, Any], address: A) -> AbstractAsyncContextManager[None]:
        """Be seen as alive at `address` until the block ends or the link is gone."""
        keyexpr = key.build(address)
        self._trace.note("token", key, keyexpr)
        return self.link.token(keyexpr)

    def watch_tokens(
        self, key: Key[A, Any], debounce_s: float = 0.5, **fixed: str | int
    ) -> AbstractAsyncContextManager[TokenWatch[A]]:
        """Watch who is alive; a token counts as lost when it stays away for `debounce_s`."""
        pattern = key.pattern(**fixed)
        self._trace.note("watch-tokens", key, pattern)
        return TokenWatch(self.link, key, pattern, debounce_s).running()

    # --- queries ---------------------------------------------------------------------------------

    def serve(
        self,
        key: Key[A, P],
        handler: Callable[[A, P], Awaitable[Payload]],
        **fixed: str | int,
    ) -> AbstractAsyncContextManager[None]:
        """Reply to queries until the block ends, several at a time.

        What `handler` raises becomes an error reply; the client sees its text.
        """
        pattern = key.pattern(**fixed)
        self._trace.note("serve", key, pattern)
        component = self.config.component
        return QueryServer(self.link, component, self._undecodable, key, handler).running(pattern)

    async def query(self, key: Key[A, P], address: A, payload: P, timeout_s: float = 5.0) -> Any:
        """Query whoever serves `key` at `address`; the reply has the type `key.reply`.

        Raises:
            NoReply: nobody serves it, it failed, or it took longer than `timeout_s`.
        """
        self._trace.note("query", key, key.build(address))
        return await send_query(self.link, key, address, payload, timeout_s)
