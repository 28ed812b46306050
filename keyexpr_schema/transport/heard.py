"""What was signed and taken in lately: said again it is no news.

It is kept by whose certificate has signed it. Who makes up sessions, or keys, and says much of them
loses what he himself has said before, and what is lost counts as said: so nobody gets old words of
anybody taken in again by saying new ones.
"""

from __future__ import annotations

from collections import OrderedDict

from keyexpr_schema.transport.stamps import source_of_stamp, ticks_of_stamp, time_s_of_stamp

MOST = 50_000
"""Words that are remembered, of all together."""
AT_ONCE = 100
"""When there is no room, so large a part of what one has said is forgotten: a hundredth."""


class _Words:
    """What one has said: the last stamp of each session, of each key, the oldest first."""

    __slots__ = ("forgotten", "stamps")

    def __init__(self) -> None:
        self.stamps: OrderedDict[tuple[str, int], int] = OrderedDict()
        self.forgotten = -1
        """Up to this time (NTP64) words are forgotten."""


class Heard:
    """The last stamp of each session, of each key, by the name in the certificate.

    What is older than `fresh_s` is not taken in anyway, and not remembered for more than twice
    that. Of more than `most` who has said most loses his oldest.
    """

    def __init__(self, fresh_s: float, most: int = MOST) -> None:
        self._fresh_s, self._most = fresh_s, most
        self._of: dict[str, _Words] = {}
        self._count = 0
        self._noted: list[tuple[str, tuple[str, int], int | None]] = []

    def __len__(self) -> int:
        """How many words are remembered."""
        return self._count

    def before(self, by: str, keyexpr: str, stamp: int) -> bool:
        """Whether that session has said this of the key before, or something later, or may have."""
        words = self._of.get(by)
        if words is None:
            return False
        last = words.stamps.get((keyexpr, source_of_stamp(stamp)))
        return ticks_of_stamp(stamp) <= words.forgotten if last is None else stamp <= last

    def begin(self) -> None:
        """What was noted was taken in; what is noted from here on `take_back` takes back."""
        self._noted.clear()

    def note(self, by: str, keyexpr: str, stamp: int) -> None:
        """It is taken in."""
        words = self._of.setdefault(by, _Words())
        said = keyexpr, source_of_stamp(stamp)
        before = words.stamps.pop(said, None)
        words.stamps[said] = stamp if before is None else max(stamp, before)
        self._noted.append((by, said, before))
        self._count += before is None
        oldest = next(iter(words.stamps.values()))
        if time_s_of_stamp(stamp) - time_s_of_stamp(oldest) > 2 * self._fresh_s:
            words.stamps.popitem(last=False)
            self._count -= 1
        if self._count > self._most:
            self._forget()

    def _forget(self) -> None:
        """The oldest words of who has said most."""
        words = max(self._of.values(), key=lambda each: len(each.stamps))
        for _ in range(1 + len(words.stamps) // AT_ONCE):
            _, stamp = words.stamps.popitem(last=False)
            words.forgotten = max(words.forgotten, ticks_of_stamp(stamp))
            self._count -= 1

    def take_back(self) -> None:
        """What was noted since `begin` may not have been taken in."""
        for by, said, before in reversed(self._noted):
            stamps = self._of[by].stamps
            if said not in stamps:
                continue  # forgotten since: it counts as said
            if before is None:
                del stamps[said]
                self._count -= 1
            else:
                stamps[said] = before
        self._noted.clear()
