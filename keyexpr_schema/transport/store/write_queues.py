"""Writes on their way into a store: whoever writes much holds up himself, and nobody else.

No Zenoh here, and no thread: a plain structure for whoever takes in, applies and answers.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from typing import Generic, TypeVar

import msgspec

from keyexpr_schema.transport.attachments import Attachment
from keyexpr_schema.transport.stamps import source_of_stamp
from keyexpr_schema.transport.store.patterns import Patterns
from keyexpr_schema.transport.store.storage import Write, tree_over

Q = TypeVar("Q")
NOTHING = Attachment()
Judge = Callable[[Write, Attachment], Write | None]
"""What a write is taken for; `None`: it is not taken in."""

MOST = 10_000
"""Writes that wait at most; whoever brings more has to wait before he can."""
MOST_BYTES = 64 * 2**20
"""Of values that wait, if it is more than one."""
BATCH = 256
"""Writes that are applied together, at most."""
BATCH_BYTES = 2**20
"""Of values that are applied together, if it is more than one."""
REFUSED = 32
"""Writes that are not taken in while others are that come together with them, at most: to refuse a
bent certificate takes 0.1 to 0.2 ms."""


class _Held(Generic[Q]):
    """A question, and for how many writes it waits yet."""

    __slots__ = ("question", "writes")

    def __init__(self, question: Q, writes: int) -> None:
        self.question, self.writes = question, writes


class _Waiting(msgspec.Struct, gc=False):
    """A write, whose it is, what of it is in order (see `WriteQueues`), what came beside it, and
    the questions that wait until it is applied."""

    write: Write
    writer: int
    about: str
    beside: Attachment
    held: list[_Held] | None = None  # type: ignore[type-arg]  # a struct knows no variables

    @property
    def size(self) -> int:
        """Bytes that it takes."""
        return len(self.write.data) + self.beside.size


class WriteQueues(Generic[Q]):
    """Writes that wait, one queue for each writer, and the questions `Q` that wait for them.

    A batch takes one write of each writer in turn. So who has one write to bring waits for one
    of every other writer, however many those have. What one has written stays in its order, and so
    does what is written of one key, or of the keys that are deleted together with it: a writer
    whose next write is of something of which somebody else's came before waits for that one. It
    came before, so the oldest of all can always be taken.

    Whose a write is its stamp says, which without certificates can be forged.
    """

    def __init__(self, most: int = MOST, most_bytes: int = MOST_BYTES) -> None:
        self._most, self._most_bytes = most, most_bytes
        self._of: dict[int, deque[_Waiting]] = {}
        self._turns: deque[int] = deque()
        """Writers whose next write can be taken."""
        self._order: dict[str, deque[int]] = {}
        """Of what is in order, whose writes wait, as they came."""
        self._last: dict[str, _Waiting] = {}
        """Of each key that has writes that are not applied yet, the last of them."""
        self._taken: list[_Waiting] = []
        self._waiting = self._bytes = 0

    def __len__(self) -> int:
        """How many writes wait to be taken."""
        return self._waiting

    @property
    def full(self) -> bool:
        """Whether nothing more should be put before something was taken."""
        return self._waiting >= self._most or self._bytes >= self._most_bytes

    def put(self, write: Write, beside: Attachment = NOTHING) -> None:
        """Have a write wait for its turn, with what came beside it."""
        writer = source_of_stamp(write.stamp)
        about = tree_over(write.keyexpr) or write.keyexpr
        waiting = _Waiting(write, writer, about, beside)
        order = self._order.setdefault(about, deque())
        order.append(writer)
        queue = self._of.setdefault(writer, deque())
        queue.append(waiting)
        if len(queue) == 1 and len(order) == 1:
            self._turns.append(writer)
        self._last[write.keyexpr] = waiting
        self._waiting += 1
        self._bytes += waiting.size

    def take(
        self, most: int = BATCH, most_bytes: int = BATCH_BYTES, judge: Judge | None = None
    ) -> list[Write]:
        """The next writes to be applied, before any others are taken; see `applied`.

        A deletion with wildcards comes first in a batch: so what it concerns is in the store.
        `judge` sees each when its turn has come, and a batch ends after `REFUSED` that it does not
        take in: so who sends what takes long to be judged holds up himself.
        """
        size = 0
        judged: list[Write] = []
        while self._turns and len(self._taken) < most and size < most_bytes:
            if len(self._taken) - len(judged) >= REFUSED:
                break
            writer = self._turns[0]
            queue = self._of[writer]
            if self._taken and "*" in queue[0].write.keyexpr:
                break
            self._turns.popleft()
            waiting = queue.popleft()
            self._taken.append(waiting)
            size += waiting.size
            self._waiting -= 1
            self._bytes -= waiting.size
            self._pass_on(waiting.about, writer)
            if not queue:
                del self._of[writer]
            elif self._order[queue[0].about][0] == writer:
                self._turns.append(writer)
            write = waiting.write if judge is None else judge(waiting.write, waiting.beside)
            if write is not None:
                judged.append(write)
        return judged

    def _pass_on(self, about: str, writer: int) -> None:
        """`writer`'s write was taken: whose comes next may have been held up by it."""
        order = self._order[about]
        order.popleft()
        if not order:
            del self._order[about]
        elif order[0] != writer and self._of[order[0]][0].about == about:
            self._turns.append(order[0])

    def applied(self) -> list[Q]:
        """What was taken is applied, or cannot be; the questions that waited for nothing else."""
        ready: list[Q] = []
        for waiting in self._taken:
            if self._last[waiting.write.keyexpr] is waiting:
                del self._last[waiting.write.keyexpr]
            for held in waiting.held or ():
                held.writes -= 1
                if not held.writes:
                    ready.append(held.question)
        self._taken = []
        return ready

    def hold(self, question: Q, keys: Iterable[str], patterns: Sequence[str]) -> bool:
        """Have a question wait for the writes that came before it, of those keys and of what the
        patterns match, deletions with wildcards included; False: there are none."""
        if not self._last:
            return False
        concerned = {}
        asked = Patterns(patterns)
        for key in chain(keys, asked.keys):
            for keyexpr in (key, tree_over(key)):
                if (last := self._last.get(keyexpr)) is not None:
                    concerned[keyexpr] = last
        if asked.wild:
            for keyexpr, last in self._last.items():
                if "*" in keyexpr or asked.matches(keyexpr):
                    concerned[keyexpr] = last
        if not concerned:
            return False
        held = _Held(question, len(concerned))
        for last in concerned.values():
            if last.held is None:
                last.held = []
            last.held.append(held)
        return True
