"""Time zones as values: a zone's rules are files, which the core does not read.

Whoever reads them (`fleet.service.time_zones`) tells the core the offsets from UTC that a zone has
and will have, so that a journal replays to the same times wherever, and whatever rules hold there.
"""

from __future__ import annotations

from bisect import bisect_right
from datetime import UTC, datetime, timedelta, tzinfo
from functools import lru_cache

UTC = UTC
Offsets = tuple[tuple[float, int], ...]
"""From when on (Unix time, s) clocks are how far ahead of UTC [s], in order. The first one also
holds before, the last one from then on."""
_EPOCH = datetime(1970, 1, 1)


class TimeZone(tzinfo):
    """A time zone by its offsets; `fold` says which of two equal times is meant (PEP 495)."""

    def __init__(self, name: str, offsets: Offsets) -> None:
        """`offsets` has one at least."""
        self._name = name
        self._from_s = [from_s for from_s, _ in offsets[1:]]
        self._ahead_s = [ahead_s for _, ahead_s in offsets]
        around = list(zip(self._from_s, self._ahead_s, self._ahead_s[1:], strict=False))
        # On the clock, an offset holds from the later of both readings on where the earlier of two
        # equal times is meant, else from the earlier one.
        self._shown_s = (
            [at_s + max(before_s, after_s) for at_s, before_s, after_s in around],
            [at_s + min(before_s, after_s) for at_s, before_s, after_s in around],
        )

    def utcoffset(self, dt: datetime | None, /) -> timedelta | None:
        """How far clocks that show `dt` are ahead of UTC."""
        if dt is None:
            return None
        shown_s = (dt.replace(tzinfo=None) - _EPOCH).total_seconds()
        return timedelta(seconds=self._ahead_s[bisect_right(self._shown_s[dt.fold], shown_s)])

    def dst(self, dt: datetime | None, /) -> timedelta | None:
        """Not known: offsets do not tell daylight saving from anything else."""
        return None

    def tzname(self, dt: datetime | None, /) -> str:
        """The zone's name, whatever the time."""
        return self._name

    def fromutc(self, dt: datetime, /) -> datetime:
        """What clocks show at `dt`, which is UTC under the name of this zone."""
        utc_s = (dt.replace(tzinfo=None) - _EPOCH).total_seconds()
        number = bisect_right(self._from_s, utc_s)
        ahead_s = self._ahead_s[number]
        back_s = self._ahead_s[number - 1] - ahead_s if number else 0
        again = back_s > 0 and utc_s < self._from_s[number - 1] + back_s
        return (dt + timedelta(seconds=ahead_s)).replace(fold=int(again))


@lru_cache(256)
def time_zone(name: str, offsets: Offsets) -> TimeZone:
    """The zone that has these offsets: one object, as times of one zone are compared often."""
    return TimeZone(name, offsets)


def apart_s(later: datetime, earlier: datetime) -> float:
    """What lies between two times of which each has a zone [s]. (A plain difference is that of
    clocks where both have the same.)"""
    return (later.astimezone(UTC) - earlier.astimezone(UTC)).total_seconds()


def moved(shown: datetime, by_s: float) -> datetime:
    """What the same clocks show so much later [s]."""
    return (shown.astimezone(UTC) + timedelta(seconds=by_s)).astimezone(shown.tzinfo)


def existing(shown: datetime) -> datetime:
    """The same time, or the first minute that there is after it, where clocks skip it."""
    while shown != shown.astimezone(UTC).astimezone(shown.tzinfo):
        shown = shown.replace(second=0) + timedelta(minutes=1)
    return shown
