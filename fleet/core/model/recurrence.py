"""When goals are to be begun that are for later, or for again and again.

The core knows the fleet's clock only. Times of day come from what clocks showed when the goal was
said, with its offset from UTC: that offset holds from then on, whatever becomes of daylight saving.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import count, dropwhile, islice, takewhile

from cronsim import CronSim, CronSimError

from fleet.errors import NotUnderstood
from keyexpr_schema.payloads.goals import Goal

MOST_MISSED = 1000
"""More missed times than this are not counted."""
_PERIOD = re.compile(
    r"P(?:(\d+)W)?(?:(\d+)D)?(?:T(?:(\d+)H)?(?:(\d+)M)?(?:(\d+)S)?)?", flags=re.ASCII
)
_UNITS_S = (604_800.0, 86_400.0, 3600.0, 60.0, 1.0)


def said_at(goal: Goal) -> datetime | None:
    """What clocks showed when the goal was said, if it says so.

    Raises:
        NotUnderstood: it says so in a way that is no time with an offset.
    """
    if goal.said_at is None:
        return None
    try:
        shown = datetime.fromisoformat(goal.said_at)
    except ValueError:
        shown = None
    if shown is None or shown.tzinfo is None:
        raise NotUnderstood(
            f"{goal.said_at!r}, when it was said, is no time with an offset: write it like "
            "2026-05-01T14:00:00+02:00"
        )
    return shown


@dataclass(frozen=True)
class Recurrence:
    """Times on the fleet's clock [s]: by a line of cron, or every `period_s` from `start_s` on."""

    start_s: float
    period_s: float | None = None
    cron: str = ""
    shown: datetime | None = None
    """What clocks showed at `start_s`."""

    @classmethod
    def of(cls, every: str, start_s: float, shown: datetime | None) -> Recurrence:
        """What is written in `every`.

        Raises:
            NotUnderstood: it is neither, or nobody knows what time of day it is.
        """
        found = _PERIOD.fullmatch(every)
        if found is not None:
            parts = zip(found.groups(), _UNITS_S, strict=True)
            period_s = sum(int(count or 0) * unit_s for count, unit_s in parts)
            if period_s > 0.0:
                return cls(start_s, period_s)
        if shown is None:
            raise NotUnderstood(
                f"{every!r} is a time of day, and what time it was when it was said is not known"
            )
        try:
            CronSim(every, shown)
        except CronSimError as error:
            raise NotUnderstood(
                f"{every!r} is neither a line of cron nor an ISO 8601 period ({error}): write it "
                "like '0 7 * * 1-5' or PT2H"
            ) from None
        return cls(start_s, cron=every, shown=shown)

    def first(self) -> float | None:
        """The first time: that of a period is when it starts."""
        return self.start_s if self.period_s is not None else self.next_after(self.start_s)

    def next_after(self, time_s: float) -> float | None:
        """The first time after this one; `None` if there is none."""
        return next(self._after(time_s), None)

    def missed(self, since_s: float, until_s: float) -> int:
        """How many times there are after `since_s` up to `until_s`; `MOST_MISSED` at most."""
        passed = takewhile(lambda at_s: at_s <= until_s, self._after(since_s))
        return sum(1 for _ in islice(passed, MOST_MISSED))

    def _after(self, time_s: float) -> Iterator[float]:
        """The times after this one, of which rounding may give the last one before once more."""
        return dropwhile(lambda at_s: at_s <= time_s, self._from(time_s))

    def _from(self, time_s: float) -> Iterator[float]:
        passed_s = time_s - self.start_s
        if self.period_s is not None:
            for number in count(passed_s // self.period_s):
                yield self.start_s + number * self.period_s
            return
        assert self.shown is not None
        for found in CronSim(self.cron, self.shown + timedelta(seconds=passed_s)):
            yield self.start_s + (found - self.shown).total_seconds()


def recurrence_of(goal: Goal) -> Recurrence:
    """When a goal with `every` makes its goals.

    Raises:
        NotUnderstood: see `Recurrence.of`.
    """
    assert goal.every is not None
    shown, start_s = said_at(goal), goal.said_s
    begins_s = start_s if goal.not_before_s is None else goal.not_before_s
    if shown is not None:
        shown += timedelta(seconds=begins_s - start_s)
    return Recurrence.of(goal.every, begins_s, shown)


def when_shown(goal: Goal, at_s: float) -> str:
    """A time on the fleet's clock [s] in words: as clocks will show it, where that is known."""
    try:
        shown = said_at(goal)
    except NotUnderstood:
        shown = None
    if shown is None:
        return f"{at_s:.0f} s on the fleet's clock"
    then = shown + timedelta(seconds=at_s - goal.said_s)
    day = "" if then.date() == shown.date() else f" on {then:%Y-%m-%d}"
    return f"{then:%H:%M}{f':{then:%S}' if then.second else ''}{day}"
