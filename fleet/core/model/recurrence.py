"""When goals are to be begun that are for later, or for again and again.

The core knows the fleet's clock only. Times of day come from what clocks showed when the goal was
said, and from the rules of the time zone where it was said. Where that is not said, the offset from
UTC holds from then on, whatever becomes of daylight saving.

- A line of cron with hours and minutes, and a period of whole days, are times of day. One that
  clocks skip is the first minute after what they skip; of one that they show twice it is the first.
- A line of cron in which the minute or the hour begins with `*`, and any other period, counts real
  time: each hour that clocks show twice is two.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime, timedelta, tzinfo
from itertools import count, dropwhile, islice, takewhile

from cronsim import CronSim, CronSimError

from fleet.core.model.time_zones import apart_s, existing, moved
from fleet.errors import NotUnderstood
from keyexpr_schema.payloads.goals import Goal

MOST_MISSED = 1000
"""More missed times than this are not counted."""
NO_ZONES: Mapping[str, tzinfo] = {}
_PERIOD = re.compile(
    r"P(?:(\d+)W)?(?:(\d+)D)?(?:T(?:(\d+)H)?(?:(\d+)M)?(?:(\d+)S)?)?", flags=re.ASCII
)
_UNITS_S = (604_800.0, 86_400.0, 3600.0, 60.0, 1.0)
_DAY_S = 86_400.0


def said_at(goal: Goal, zones: Mapping[str, tzinfo] = NO_ZONES) -> datetime | None:
    """What clocks showed when the goal was said, in its time zone, if it says so.

    Raises:
        NotUnderstood: it says so in a way that is no time with an offset, or in no known zone.
    """
    if goal.zone is not None and goal.zone not in zones:
        raise NotUnderstood(
            f"{goal.zone!r}, the time zone where it was said, is none that is known: zones have "
            "names such as Europe/Berlin or UTC"
        )
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
    try:
        return shown.astimezone(shown.tzinfo if goal.zone is None else zones[goal.zone])
    except OverflowError:
        raise NotUnderstood(
            f"{goal.said_at!r}, when it was said, is at an end of the calendar"
        ) from None


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
                days = period_s % _DAY_S == 0.0 and not any(found.groups()[2:])
                return cls(start_s, period_s, shown=shown if days else None)
        if shown is None:
            raise NotUnderstood(
                f"{every!r} is a time of day, and what time it was when it was said is not known"
            )
        first = None
        try:
            with suppress(OverflowError):  # the calendar ends with the year 9999
                first = next(CronSim(every, shown), None)
        except CronSimError as error:
            raise NotUnderstood(
                f"{every!r} is neither a line of cron nor an ISO 8601 period ({error}): write it "
                "like '0 7 * * 1-5' or PT2H"
            ) from None
        if first is None:
            raise NotUnderstood(f"{every!r} names days that there never are: no time comes of it")
        return cls(start_s, cron=every, shown=shown)

    def first(self) -> float | None:
        """The first time: that of a period is when it starts."""
        return self.start_s if self.period_s is not None else self.next_after(self.start_s)

    def next_after(self, time_s: float) -> float | None:
        """The first time after this one; `None` if there is none."""
        return next(self.after(time_s), None)

    def passed(self, since_s: float, until_s: float) -> list[float]:
        """The times after `since_s` up to `until_s`; `MOST_MISSED` at most."""
        found = takewhile(lambda at_s: at_s <= until_s, self.after(since_s))
        return list(islice(found, MOST_MISSED))

    def after(self, time_s: float) -> Iterator[float]:
        """The times after this one, in order, none of them twice."""
        last_s = time_s
        if time_s < self.start_s:  # a period begins when it starts, a line of cron after that
            last_s = self.start_s if self.period_s is None else time_s
        since_s = last_s
        try:
            for at_s in dropwhile(lambda at_s: at_s <= since_s, self._from(since_s)):
                if at_s > last_s:
                    last_s = at_s
                    yield at_s
        except OverflowError:  # the calendar ends with the year 9999
            return

    def _from(self, time_s: float) -> Iterator[float]:
        """The times from about this one on; rounding may give the last one before once more."""
        passed_s = time_s - self.start_s
        if self.period_s is not None and self.shown is not None:
            yield from self._on_days(int(passed_s // self.period_s))
        elif self.period_s is not None:
            for number in count(max(0.0, passed_s // self.period_s)):
                yield self.start_s + number * self.period_s
        else:
            assert self.shown is not None
            for found in CronSim(self.cron, moved(self.shown, passed_s)):
                yield self.start_s + apart_s(found, self.shown)

    def _on_days(self, number: int) -> Iterator[float]:
        """A period of whole days goes by what clocks show."""
        assert self.period_s is not None
        assert self.shown is not None
        for days in count(max(0, number - 1)):
            day = self.shown + timedelta(seconds=days * self.period_s)
            yield self.start_s + apart_s(existing(day.replace(fold=0)) if days else day, self.shown)


def recurrence_of(goal: Goal, zones: Mapping[str, tzinfo] = NO_ZONES) -> Recurrence:
    """When a goal with `every` makes its goals.

    Raises:
        NotUnderstood: see `Recurrence.of`.
    """
    assert goal.every is not None
    shown, start_s = said_at(goal, zones), goal.said_s
    begins_s = start_s if goal.not_before_s is None else goal.not_before_s
    try:
        begins = None if shown is None else moved(shown, begins_s - start_s)
    except OverflowError:
        raise NotUnderstood(f"it begins at {begins_s:g} s, for which there is no date") from None
    return Recurrence.of(goal.every, begins_s, begins)


def clock_at(goal: Goal, at_s: float, zones: Mapping[str, tzinfo] = NO_ZONES) -> datetime | None:
    """What clocks show, where the goal was said, at a time on the fleet's clock [s]."""
    try:
        shown = said_at(goal, zones)
        return None if shown is None else moved(shown, at_s - goal.said_s)
    except (NotUnderstood, OverflowError):
        return None


def when_shown(goal: Goal, at_s: float, zones: Mapping[str, tzinfo] = NO_ZONES) -> str:
    """A time on the fleet's clock [s] in words: as clocks will show it, where that is known."""
    then, said = clock_at(goal, at_s, zones), clock_at(goal, goal.said_s, zones)
    if then is None or said is None:
        return f"{at_s:.0f} s on the fleet's clock"
    day = "" if then.date() == said.date() else f" on {then:%Y-%m-%d}"
    return f"{then:%H:%M}{f':{then:%S}' if then.second else ''}{day}"
