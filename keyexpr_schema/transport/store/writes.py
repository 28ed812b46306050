"""Writes that count when the store has them: sent together, confirmed by one question.

Whatever waits when the link's turn comes is put, and the store is asked behind it which stamps
those keys hold now; it answers after what arrived before was applied and is on disk. A write whose
stamp is not there yet is put again with the same stamp, which does no harm. With a zenohd storage,
which answers no such question, each write is read back instead.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Awaitable, Callable, Sequence

from msgspec.structs import replace

from keyexpr_schema.errors import Overtaken, Unconfirmed, WriteRefused
from keyexpr_schema.payloads.system import StoreStamps, StoreStampsQuery
from keyexpr_schema.transport.link import Link, Put
from keyexpr_schema.transport.samples import Sample
from keyexpr_schema.transport.stamps import (
    same_session,
    stamp_of_text,
    text_of_stamp,
    time_s_of_stamp,
)
from keyexpr_schema.transport.store.pacing import cost

TOGETHER = 256
"""Writes of one question at most, so that the first do not wait long for the last. A large one
counts for as many as with the store, which slows nobody down for so few (`pacing.OWN_AT_ONCE`)."""
ANSWER_S = 2.0
"""How long a store may take for one question, before the writes are put again."""
LONG_S = 60.0
_PAUSE_S = 0.0005
_LONGEST_PAUSE_S = 0.05

Ask = Callable[[Sequence[Put], float], Awaitable[StoreStamps | None]]
ReadBack = Callable[[str, float], Awaitable[tuple[Sample, ...]]]


def question_about(puts: Sequence[Put]) -> StoreStampsQuery:
    """What became of these, of one session."""
    asked = StoreStampsQuery(keys=tuple(put.keyexpr for put in puts))
    if not puts:
        return asked
    stamps = [str(put.timestamp).partition("/") for put in puts]
    waits = tuple(ticks for ticks, _, _ in stamps)
    asked = replace(asked, source=stamps[0][2], waits=waits)
    if all(put.said_s is None for put in puts):
        return asked
    now_s = time.monotonic()
    late_s = (0.0 if put.said_s is None else now_s - put.said_s for put in puts)
    return replace(asked, late_us=tuple(round(each * 1e6) for each in late_s))


class _Write:
    """A put on its way, and who waits for it."""

    __slots__ = ("begun", "by_receipt", "confirmed", "put", "text")

    def __init__(self, put: Put, confirmed: asyncio.Future[None], begun: int) -> None:
        self.put, self.confirmed, self.begun = put, confirmed, begun
        self.text = str(put.timestamp)
        self.by_receipt = put.said_s is not None
        """As far as the store can tell; see `_found`."""

    def judge(
        self, newest: str, refused: tuple[str, str] | None = None, lasting: bool = False
    ) -> bool:
        """Tell who waits what became of it, the key's newest stamp being `newest`.

        `refused`: the stamp of the write that the store has not taken in last, and why; `lasting`:
        it never will. False: the write has not arrived.
        """
        if self.confirmed.done():
            return True
        if newest != self.text:
            ours = stamp_of_text(self.text)
            there = stamp_of_text(newest) if newest else 0
            if refused is not None and refused[0] == self.text:
                why = f"{self.put.keyexpr} is not stored: {refused[1]}"
                self.confirmed.set_exception(WriteRefused(why, lasting))
                return True
            foreign = not same_session(there, ours)
            # Of keys that go by receipt the store names somebody else's only if that came later.
            if not there or (there < ours and not (foreign and self.by_receipt)):
                return False
            # What this session itself wrote later is no surprise to it.
            if foreign:
                self.confirmed.set_exception(self._overtaken(ours, there))
                return True
        self.confirmed.set_result(None)
        return True

    def _overtaken(self, ours: int, there: int) -> Overtaken:
        keyexpr = self.put.keyexpr
        if self.by_receipt:
            return Overtaken(
                f"{keyexpr} was not written: somebody else has said something of it since"
            )
        ahead_s = time_s_of_stamp(there) - time_s_of_stamp(ours)
        was_ahead = ""
        if ahead_s > LONG_S:
            was_ahead = (
                ", or one was ahead for a while (`robotctl store repair-clock` puts that right)"
            )
        return Overtaken(
            f"{keyexpr} was not written: somebody else's write of it has a stamp "
            f"{ahead_s:.3f} s later; if nobody wrote it just now, the clock of this host is behind"
            f"{was_ahead}"
        )


class ConfirmedWrites:
    """Puts what must last, and confirms all that waits by one question.

    `ask` puts writes and brings the newest stamps of their keys, None where no store answers such
    a question; `read_back` brings the values at a key, after it proved that a store is there.
    """

    def __init__(self, link: Link, ask: Ask, read_back: ReadBack) -> None:
        self._link, self._ask, self._read_back = link, ask, read_back
        self._waiting: deque[_Write] = deque()
        self._open = 0
        self._sender: asyncio.Task[None] | None = None

    async def confirmed(self, put: Put) -> None:
        """Return when the store has exactly this write, or a later one of this session.

        Raises:
            Overtaken: somebody else's write of the same key has a later stamp.
            WriteRefused: it is beyond a limit of the store.
            Unconfirmed: the session's stamps have begun anew meanwhile.
        """
        confirmed = asyncio.get_running_loop().create_future()
        write = _Write(put, confirmed, self._link.stamps.begun)
        self._waiting.append(write)
        self._open += 1
        if self._sender is None or self._sender.done():
            self._sender = asyncio.create_task(self._send_all())
        try:
            await write.confirmed
        finally:
            self._open -= 1
            write.confirmed.cancel()
            if not self._open and self._sender is not None:
                self._sender.cancel()
                self._sender = None

    async def _send_all(self) -> None:
        pause_s = _PAUSE_S
        while self._waiting:
            await self._link.router.wait_up()
            batch = self._next()
            try:
                missing = await self._send(batch)
            except Exception as error:
                for write in batch:
                    if not write.confirmed.done():
                        write.confirmed.set_exception(error)
                continue
            self._waiting.extendleft(reversed(missing))
            if missing:
                await asyncio.sleep(pause_s)
                pause_s = min(_LONGEST_PAUSE_S, 2 * pause_s)
            else:
                pause_s = _PAUSE_S

    def _next(self) -> list[_Write]:
        """Those that are put next, of which one question is asked."""
        batch: list[_Write] = []
        together = 0.0
        while self._waiting:
            write = self._waiting[0]
            together += cost(len(write.put.data or b""))
            if batch and together > TOGETHER:
                break
            self._waiting.popleft()
            if self._is_wanted(write):
                batch.append(write)
        return batch

    def _is_wanted(self, write: _Write) -> bool:
        """Whether it has to be put. Not under a stamp of a clock that was ahead: it would come to
        hold when that time has come, over what was written since."""
        if not write.confirmed.done() and write.begun != self._link.stamps.begun:
            why = "the clock of this host was ahead when it was put"
            write.confirmed.set_exception(
                Unconfirmed(f"{write.put.keyexpr} was not confirmed by the store: {why}")
            )
        return not write.confirmed.done()

    async def _send(self, batch: Sequence[_Write]) -> list[_Write]:
        """Put these; those that have not arrived."""
        generation = self._link.router.generation
        newest = await self._ask([write.put for write in batch], ANSWER_S)
        if newest is None:
            arrived = await asyncio.gather(*(self._found(write, generation) for write in batch))
        else:
            arrived = [
                write.judge(each, newest.refused.get(keyexpr), keyexpr in newest.lasting)
                for write, each in zip(batch, newest.timestamps, strict=True)
                for keyexpr in (write.put.keyexpr,)
            ]
        return [write for write, there in zip(batch, arrived, strict=True) if not there]

    async def _found(self, write: _Write, generation: int) -> bool:
        """Read one back from a storage that only keeps values."""
        write.by_receipt = False  # such a storage goes by stamps alone
        samples = await self._read_back(write.put.keyexpr, ANSWER_S)
        if samples:
            stamp = max(sample.stamp for sample in samples)
            return write.judge(text_of_stamp(stamp))
        # Absent proves the deletion only where the query followed it down one link.
        if write.put.data is None and self._link.router.generation == generation:
            return write.judge(write.text)
        return False
