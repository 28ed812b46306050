"""The typed Zenoh session on asyncio: keys and payloads in, keys and payloads out.

What holds on any Zenoh storage, the embedded one or zenohd's:

* A put while the router is away is lost without an error, so what must last goes through `confirm`.
* Empty is not absent: `get` and `list` believe an empty answer only when the store proved to be
  there after the link came up (it answers for its journal), or, with a zenohd storage that has no
  journal, when the link has been up for `SETTLE_S`.
"""

from __future__ import annotations

import asyncio
import hashlib
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from keyexpr_schema.errors import (
    ForeignKey,
    Unconfirmed,
    UndecodablePayload,
    Unreachable,
)
from keyexpr_schema.ids import check_id
from keyexpr_schema.key import A, Delivery, Key, P, Payload
from keyexpr_schema.keyspace import REJECT, STORE_JOURNAL
from keyexpr_schema.payloads.service import Reject, RejectAddress, StoreAddress, StoreQuery
from keyexpr_schema.transport.connecting import open_link
from keyexpr_schema.transport.link import Link
from keyexpr_schema.transport.questions import Service, ask
from keyexpr_schema.transport.tokens import TokenChange, TokenWatch
from keyexpr_schema.transport.trace import Operation, Trace
from keyexpr_schema.transport.watch import Change, Watch
from keyexpr_schema.transport.wire import Wire, decode_wire, encoding_of, stamp_of_text

__all__ = [
    "Change",
    "Session",
    "SessionConfig",
    "TokenChange",
    "TokenWatch",
    "Watch",
    "open_session",
]

SETTLE_S = 0.5
_RESEND_S = 0.25


@dataclass(frozen=True)
class SessionConfig:
    """Where the routers are, in which realm we act, and who we are.

    `component` signs reports of undecodable values. `connect_timeout_s` None: wait for a router
    for ever. `lease_s`: after this long without a sign of life the other side is gone.
    """

    endpoints: tuple[str, ...]
    realm: str = "robotfleet"
    component: str = "client"
    connect_timeout_s: float | None = 3.0
    lease_s: float = 2.0

    def __post_init__(self) -> None:
        check_id(self.realm, "realm")
        check_id(self.component, "component")


@asynccontextmanager
async def open_session(config: SessionConfig) -> AsyncIterator[Session]:
    """A session that is closed at the end of the block, whatever happens in it.

    Raises:
        Unreachable: no router answered within `config.connect_timeout_s`.
    """
    async with open_link(
        config.endpoints, config.realm, config.lease_s, config.connect_timeout_s
    ) as link:
        yield Session(config, link)


class Session:
    """Puts, gets, watches and asks for typed values; made by `open_session`."""

    def __init__(self, config: SessionConfig, link: Link) -> None:
        self.config = config
        self.link = link
        self._rejects: dict[str, tuple[str, int]] = {}
        self._trace = Trace(config.component)

    @property
    def component(self) -> str:
        """Who we are."""
        return self.config.component

    @property
    def connected(self) -> bool:
        """Whether a router is visible now."""
        return self.link.up

    async def wait_connected(self, timeout_s: float | None = None) -> None:
        """Wait until a router is visible.

        Raises:
            Unreachable: none was within `timeout_s`.
        """
        try:
            await self.link.wait_up(timeout_s)
        except TimeoutError:
            raise self._unreachable(f"for {timeout_s:g} s" if timeout_s else "") from None

    # --- writing ---------------------------------------------------------------------------------

    def put(self, key: Key[A, P], address: A, payload: P) -> None:
        """Put and forget: lost without a word while no router is there.

        A stream is dropped when the link is full, anything else waits its turn.
        """
        keyexpr = key.build(address)
        self._trace.note(Operation.PUT, key, keyexpr)
        self.link.send_soon(
            keyexpr,
            key.encode(payload),
            encoding_of(key.schema),
            block=key.delivery is not Delivery.STREAM,
        )

    async def confirm(
        self, key: Key[A, P], address: A, payload: P, timeout_s: float = 10.0
    ) -> None:
        """Put, and return when the store holds this value or a newer one.

        The put is repeated with the same timestamp, so repeating it does no harm.

        Raises:
            Unconfirmed: it was not read back within `timeout_s`; it may still arrive.
            UndecodablePayload: no reader could read it, so it is not put at all.
        """
        await self._confirm(key, address, key.check(payload, address), timeout_s)

    async def delete(self, key: Key[A, P], address: A, timeout_s: float = 10.0) -> None:
        """Delete, and return when the store has no value of this key, or a newer one.

        Raises:
            Unconfirmed: the old value was still there after `timeout_s`.
        """
        await self._confirm(key, address, None, timeout_s)

    async def _confirm(
        self, key: Key[A, Any], address: A, data: bytes | None, timeout_s: float
    ) -> None:
        if not key.stored:
            raise TypeError(f"{key.name} is {key.delivery.value}: it cannot be confirmed")
        keyexpr = key.build(address)
        self._trace.note(Operation.DELETE if data is None else Operation.PUT, key, keyexpr)
        timestamp = self.link.new_timestamp()
        ours = stamp_of_text(str(timestamp))
        try:
            async with asyncio.timeout(timeout_s):
                while True:
                    await self.link.wait_up()
                    generation = self.link.generation
                    await self.link.send(keyexpr, data, encoding_of(key.schema), timestamp)
                    if await self._read_back(keyexpr, ours, data is None, generation):
                        return
        except TimeoutError:
            raise Unconfirmed(
                f"{'deleting ' if data is None else ''}{keyexpr} was not confirmed by the store "
                f"within {timeout_s:g} s: {self._why_not()}"
            ) from None

    async def _read_back(self, keyexpr: str, ours: int, gone: bool, generation: int) -> bool:
        loop = asyncio.get_running_loop()
        resend_at_s = loop.time() + _RESEND_S
        pause_s = 0.0005
        while self.link.up and self.link.generation == generation:
            replies = await self.link.query(keyexpr, 2.0)
            stored = max((w.stamp for w in replies.values if not w.deleted), default=None)
            if stored is not None and stored >= ours:
                return True
            if gone and stored is None and not replies.timed_out and not replies.errors:
                wires = await self._settled(keyexpr, 2.0)
                newest = max((w.stamp for w in wires), default=ours)
                # Absent proves the deletion only where the query followed it down one link.
                if newest >= ours and self.link.generation == generation:
                    return True
            if loop.time() >= resend_at_s:
                return False
            await asyncio.sleep(pause_s)
            pause_s = min(0.05, pause_s * 2)
        return False

    def _why_not(self) -> str:
        if self.link.up:
            return "a router is there, but no store answers for this key"
        return f"no router answers at {', '.join(self.config.endpoints)}"

    def _unreachable(self, after: str = "") -> Unreachable:
        return Unreachable(
            f"no router answers at {', '.join(self.config.endpoints)}"
            f"{' ' if after else ''}{after}: "
            "start one with `robotctl router` or name another with --router"
        )

    # --- reading ---------------------------------------------------------------------------------

    async def get(self, key: Key[A, P], address: A, timeout_s: float = 3.0) -> P | None:
        """The stored value, or None when there is none.

        Raises:
            UndecodablePayload: there is one, but not of the type that the key promises.
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        self._check_stored(key)
        keyexpr = key.build(address)
        self._trace.note(Operation.READ, key, keyexpr)
        wires = await self.listing(keyexpr, timeout_s)
        return self.decode(key, wires[0]) if wires else None

    async def list(self, key: Key[A, P], timeout_s: float = 3.0, **fixed: str | int) -> dict[A, P]:
        """Every stored value whose named address fields have these values, in order of address.

        Values that do not decode are reported on the reject key and left out.

        Raises:
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        self._check_stored(key)
        pattern = key.pattern(**fixed)
        self._trace.note(Operation.READ, key, pattern)
        found: dict[A, P] = {}
        for wire in await self.listing(pattern, timeout_s):
            try:
                found[key.parse(wire.keyexpr)] = self.decode(key, wire)
            except (ForeignKey, UndecodablePayload) as error:
                self.reject(wire.keyexpr, wire.data, str(error))
        return dict(sorted(found.items()))

    def _check_stored(self, key: Key[Any, Any]) -> None:
        if not key.stored:
            raise TypeError(f"{key.name} is {key.delivery.value}: there is nothing to get")

    async def listing(self, pattern: str, timeout_s: float) -> tuple[Wire, ...]:
        """The newest stored value of every key that matches `pattern`, undecoded.

        Raises:
            Unreachable: no router and store could be asked within `timeout_s`.
        """
        try:
            async with asyncio.timeout(timeout_s):
                return await self._settled(pattern, timeout_s)
        except TimeoutError:
            if not self.link.up:
                raise self._unreachable(f"for {timeout_s:g} s") from None
            raise Unreachable(
                f"the store did not answer for {pattern!r} within {timeout_s:g} s"
            ) from None

    async def _settled(self, pattern: str, timeout_s: float) -> tuple[Wire, ...]:
        proven = -1
        while True:
            await self.link.wait_up()
            generation = self.link.generation
            replies = await self.link.query(pattern, timeout_s)
            newest: dict[str, Wire] = {}
            for wire in replies.values:
                if wire.keyexpr not in newest or newest[wire.keyexpr].stamp < wire.stamp:
                    newest[wire.keyexpr] = wire
            complete = not replies.timed_out and not replies.errors
            values = tuple(wire for wire in newest.values() if not wire.deleted)
            if complete and (values or proven == generation == self.link.generation):
                return values
            if complete and (self.link.age_s >= SETTLE_S or await self.store_answers(timeout_s)):
                proven = generation
                continue
            await asyncio.sleep(0.05)

    async def store_answers(self, timeout_s: float) -> bool:
        """Whether a store that keeps a journal answers now; a zenohd storage never does."""
        keyexpr = STORE_JOURNAL.build(StoreAddress())
        self._trace.note(Operation.QUERY, STORE_JOURNAL, keyexpr)
        replies = await self.link.query(
            keyexpr,
            timeout_s,
            STORE_JOURNAL.encode(StoreQuery(limit=0)),
            encoding_of(STORE_JOURNAL.schema),
            first=True,
        )
        return bool(replies.values)

    def decode(self, key: Key[Any, P], wire: Wire) -> P:
        """The payload of `wire`.

        Raises:
            UndecodablePayload: it is not one that `key` promises.
        """
        return decode_wire(
            wire.data, wire.encoding, key.payload, key.name, key.version, wire.keyexpr
        )

    def reject(self, keyexpr: str, data: bytes, reason: str) -> None:
        """Report a value that did not decode, once for each distinct bad value of a key."""
        value = hashlib.sha256(reason.encode() + b"\0" + data).hexdigest()
        last, count = self._rejects.get(keyexpr, ("", 0))
        if last == value:
            return
        self._rejects[keyexpr] = (value, count + 1)
        digest = hashlib.sha256(keyexpr.encode()).hexdigest()[:12]
        self.put(
            REJECT,
            RejectAddress(self.config.component, digest),
            Reject(
                component=self.config.component, keyexpr=keyexpr, reason=reason, count=count + 1
            ),
        )

    @asynccontextmanager
    async def watch(
        self, *selections: Key[Any, Any] | tuple[Key[Any, Any], dict[str, str | int]]
    ) -> AsyncIterator[Watch]:
        """Watch keys, or `(key, {field: value})`: first all that is stored, then what changes."""
        patterns = []
        for selection in selections:
            key, fixed = selection if isinstance(selection, tuple) else (selection, {})
            if key.delivery in (Delivery.TOKEN, Delivery.QUERY):
                raise TypeError(f"{key.name} is a {key.delivery.value}: it cannot be watched")
            pattern = key.pattern(**fixed)
            self._trace.note(Operation.WATCH, key, pattern)
            patterns.append((key, pattern))
        async with Watch(self, patterns).running() as watch:
            yield watch

    # --- tokens ----------------------------------------------------------------------------------

    @asynccontextmanager
    async def token(self, key: Key[A, Any], address: A) -> AsyncIterator[None]:
        """Be seen as alive at `address` until the block ends or the link is gone."""
        keyexpr = key.build(address)
        self._trace.note(Operation.TOKEN, key, keyexpr)
        async with self.link.token(keyexpr):
            yield

    @asynccontextmanager
    async def watch_tokens(
        self, key: Key[A, Any], debounce_s: float = 0.5, **fixed: str | int
    ) -> AsyncIterator[TokenWatch[A]]:
        """Watch who is alive; a token counts as lost when it stays away for `debounce_s`."""
        pattern = key.pattern(**fixed)
        self._trace.note(Operation.WATCH_TOKENS, key, pattern)
        async with TokenWatch(self.link, key, pattern, debounce_s).running() as watch:
            yield watch

    # --- questions -------------------------------------------------------------------------------

    @asynccontextmanager
    async def serve(
        self,
        key: Key[A, P],
        handler: Callable[[A, P], Awaitable[Payload]],
        **fixed: str | int,
    ) -> AsyncIterator[None]:
        """Answer questions until the block ends, several at a time.

        What `handler` raises becomes an error reply; the asker sees its text.
        """
        service = Service(self, key, handler)
        pattern = key.pattern(**fixed)
        self._trace.note(Operation.SERVE, key, pattern)
        async with service.running(pattern):
            yield

    async def ask(self, key: Key[A, P], address: A, payload: P, timeout_s: float = 5.0) -> Any:
        """Ask whoever serves `key` at `address`; the answer has the type `key.reply`.

        Raises:
            NoAnswer: nobody serves it, it failed, or it took longer than `timeout_s`.
        """
        self._trace.note(Operation.QUERY, key, key.build(address))
        return await ask(self.link, key, address, payload, timeout_s)
