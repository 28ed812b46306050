"""How fast those may go on who write and wait for no confirmation.

Token buckets (Turner, 1986; RFC 2697 has the same law): one for each writer, and one for all who
have used up their own. So a burst goes through at once, whoever goes on goes on at a rate, those
who do so together share it, and nobody has less than his own.

No Zenoh here, no clock and no thread.
"""

from __future__ import annotations

from collections.abc import Iterable

OWN_AT_ONCE = 300
"""What each writer has for himself. A session of ours has at most `writes.TOGETHER` writes on their
way of which it has not heard, so it never comes to its end."""
OWN_SHARE = 0.1
"""Of what all together may write a second, what each may in any case."""
PIECE = 16_384
"""A write counts once, and once more for each so many bytes of its value."""
MOST_PIECES = 16
"""Of what is larger the store judges, not we."""
LATEST_COST = 0.25
"""Where only the latest matters, readers take in the last of many: a process with a thousand robots
tells of each of them twice a second."""
LEAST_S = 0.1
"""Who would have to wait for less [s] goes on, and waits for longer the next time."""
REMEMBERED = 1_000
"""Writes of each writer of which it is remembered what they counted for; who waits for an answer
asks right behind at most `writes.TOGETHER` of them."""
MOST_S = 0.5
"""Nobody has to wait for longer [s] at a time, whatever came before."""


def cost(size: int, latest: bool = False) -> float:
    """What a value of `size` bytes counts for; `latest`: of its key only the latest matters."""
    pieces = 1 if size < PIECE else 1 + min(size // PIECE, MOST_PIECES)
    return pieces * LATEST_COST if latest else pieces


class _Bucket:
    """Tokens: at most `most`, and `per_s` more each second; fewer than none are owed."""

    __slots__ = ("at_s", "most", "per_s", "tokens")

    def __init__(self, most: float, per_s: float, now_s: float) -> None:
        self.most, self.per_s = most, per_s
        self.tokens, self.at_s = most, now_s

    def fill(self, now_s: float) -> None:
        self.tokens = min(self.most, self.tokens + max(0.0, now_s - self.at_s) * self.per_s)
        self.at_s = now_s

    def wait_s(self, spent: float) -> float:
        return max(0.0, spent - self.tokens) / self.per_s

    def spend(self, spent: float) -> None:
        self.tokens = max(self.tokens - spent, -MOST_S * self.per_s)


class Pacing:
    """Who has to wait, and for how long; for one thread at a time."""

    def __init__(self, at_once: float, per_s: float) -> None:
        """All who are over their own may write `at_once`, and `per_s` a second, together."""
        self._at_once, self._per_s = at_once, per_s
        self._own: dict[str, _Bucket] = {}
        self._unanswered: dict[str, dict[int, float]] = {}
        """What writes counted for of which their writers have not asked what became of them."""
        self._common: _Bucket | None = None

    def spend(self, writer: str, write: int, spent: float, now_s: float) -> float:
        """A `write` of `writer` comes, that counts for `spent`; how long it has to wait [s]."""
        own = self._own.get(writer)
        if own is None:
            own = self._own[writer] = _Bucket(OWN_AT_ONCE, OWN_SHARE * self._per_s, now_s)
        own.fill(now_s)
        writes = self._unanswered.setdefault(writer, {})
        if own.tokens >= own.most:
            writes.clear()  # nothing of them is missing any more
        writes[write] = writes.pop(write, 0.0) + spent  # it may be put again
        if len(writes) > REMEMBERED:
            del writes[next(iter(writes))]
        if own.tokens >= spent:
            own.spend(spent)
            return 0.0
        if self._common is None:
            self._common = _Bucket(self._at_once, self._per_s, now_s)
        self._common.fill(now_s)
        bucket = min(self._common, own, key=lambda each: each.wait_s(spent))
        wait_s = bucket.wait_s(spent)
        bucket.spend(spent)
        return 0.0 if wait_s < LEAST_S else min(wait_s, MOST_S)

    def answered(self, writer: str, writes: Iterable[int]) -> None:
        """`writer` waits for an answer about these writes, and has it now, whatever it says: he is
        limited by that, and has what they counted for again."""
        own, common = self._own.get(writer), self._common
        if own is None:
            return
        unanswered = self._unanswered[writer]
        spent = sum(unanswered.pop(write, 0.0) for write in writes)
        room = own.most - own.tokens
        own.tokens += min(spent, room)
        if common is not None and spent > room:
            common.tokens = min(common.most, common.tokens + spent - room)

    def forget(self, writer: str) -> None:
        """`writer` is gone."""
        self._own.pop(writer, None)
        self._unanswered.pop(writer, None)

    def __len__(self) -> int:
        """How many writers are remembered."""
        return len(self._own)

    @property
    def unanswered(self) -> int:
        """Of how many writes it is remembered what they counted for."""
        return sum(map(len, self._unanswered.values()))
