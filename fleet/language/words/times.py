"""Times that a sentence names: "at 5 pm", "in ten minutes", "before noon", "every morning"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from fleet.language.words.tokens import Token, number_of

_UNITS_S = {"second": 1.0, "sec": 1.0, "minute": 60.0, "min": 60.0, "hour": 3600.0, "day": 86400.0}
_UNITS_S |= {"week": 604800.0}
_HOURS = {"noon": 12, "midday": 12, "midnight": 0}
_PARTS = {"morning": 8, "afternoon": 15, "evening": 18, "night": 22, "day": 8}
_DAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
_DAILY = {"daily": "day", "hourly": "hour", "weekly": "week", "nightly": "night"}


@dataclass(frozen=True)
class TimePhrase:
    """What a phrase of time says.

    `kind`: `start` (not before), `due` (done by), `every`. `after_s` counts from now; `hour` and
    `minute` are on the clock, `days` whole days ahead; `weekday` counts from Monday. `every` is a
    period in seconds, or with a clock time a day or week (`cron`).
    """

    kind: str
    after_s: float | None = None
    hour: int | None = None
    minute: int = 0
    days: int = 0
    weekday: int | None = None
    every_s: float | None = None
    part: str = ""
    until: tuple[int, int] | None = None
    """Hour and minute by which it shall be done: "between 10 and 11"."""
    exact: bool = True
    """Whether the half of the day was said."""

    def seconds(self, now: datetime) -> float:
        """How long from now, in seconds; a time of day that is over today is tomorrow's."""
        if self.after_s is not None:
            return self.after_s
        at = now.replace(hour=self.hour or 0, minute=self.minute, second=0, microsecond=0)
        at += timedelta(days=self.days)
        if self.weekday is not None:
            at += timedelta(days=(self.weekday - at.weekday()) % 7)
            if at <= now:
                at += timedelta(days=7)
        elif at <= now and not self.exact and at + timedelta(hours=12) > now:
            at += timedelta(hours=12)
        elif at <= now:
            at += timedelta(days=1)
        return (at - now).total_seconds()

    @property
    def recurrence(self) -> str:
        """A line of cron, or an ISO 8601 period for what no clock time belongs to."""
        if self.every_s is not None:
            whole = int(self.every_s)
            return f"PT{whole // 3600}H" if whole % 3600 == 0 else f"PT{whole // 60}M"
        day = "*" if self.weekday is None else str((self.weekday + 1) % 7)
        day = "1-5" if self.part == "weekdays" else day
        return f"{self.minute} {self.hour or 0} * * {day}"


def _part_of_day(words: Sequence[str], at: int) -> tuple[int, str]:
    """`in the morning`: where it ends, and `am` or `pm`."""
    for said, half in (("in the morning", "am"), ("in the afternoon", "pm"),
                       ("in the evening", "pm"), ("at night", "pm")):  # fmt: skip
        if list(words[at : at + len(said.split())]) == said.split():
            return at + len(said.split()), half
    return at, ""


def _past(words: Sequence[str], at: int) -> tuple[int, int, int] | None:
    """`half past 8`, `quarter to 9`, `10 past 8 pm`: hour, minute, and where it ends."""
    at += list(words[at : at + 1]) == ["a"]
    said = words[at] if at < len(words) else ""
    minutes = {"half": 30, "quarter": 15}.get(said, number_of(said))
    way = words[at + 1] if at + 1 < len(words) else ""
    if minutes is None or way not in ("past", "to") or minutes > 59:
        return None
    clock = _clock(words, at + 2, bare=True)
    if clock is None or clock[1]:
        return None
    hour = clock[0] if way == "past" else (clock[0] - 1) % 24
    return hour, minutes if way == "past" else 60 - minutes, clock[2]


def _clock(words: Sequence[str], at: int, bare: bool = False) -> tuple[int, int, int] | None:
    """`5 pm`, `17 , 30`, `5 o'clock`, `noon`: hour, minute, and where it ends."""
    word = words[at] if at < len(words) else ""
    if (past := _past(words, at)) is not None:
        return past
    if word in _HOURS:
        return _HOURS[word], 0, at + 1
    hour = number_of(word)
    if hour is None or hour > 24:
        return None
    at, minute = at + 1, 0
    marked = False
    if words[at : at + 1] == [","] and at + 1 < len(words):
        digits = words[at + 1]
        if digits.isdecimal() and len(digits) == 2 and int(digits) < 60:
            minute, at, marked = int(digits), at + 2, True
    rest = list(words[at : at + 4])
    if rest[:1] in (["am"], ["pm"]):
        half, at = rest[0], at + 1
    elif rest[:3] in (["a", ".", "m"], ["p", ".", "m"]):
        half, at = f"{rest[0]}m", at + (4 if rest[3:] == ["."] else 3)
    elif rest[:2] == ["o", "clock"]:
        return hour % 24, minute, at + 2
    elif rest[:1] in (["oclock"], ["o'clock"], ["hours"]):
        return hour % 24, minute, at + 1
    else:
        end, half = _part_of_day(words, at)
        if not half:
            return (hour % 24, minute, at) if marked or bare else None
        at = end
    return hour % 12 + (12 if half == "pm" else 0), minute, at


def _period(words: Sequence[str], at: int) -> tuple[float, int] | None:
    """`ten minutes`, `an hour`, `half an hour`: seconds, and where it ends."""
    rest = list(words[at : at + 4])
    if rest[:3] == ["half", "an", "hour"]:
        return 1800.0, at + 3
    count: float | None = 1.0 if rest[:1] in (["a"], ["an"]) else None
    if rest and (number := number_of(rest[0])) is not None:
        count = float(number)
    unit = rest[1].removesuffix("s") if len(rest) > 1 else ""
    return (count * _UNITS_S[unit], at + 2) if count and unit in _UNITS_S else None


def time_at(tokens: Sequence[Token], at: int) -> tuple[int, TimePhrase] | None:
    """The phrase of time that starts at a token: where it ends, and what it says."""
    words = [token.word for token in tokens[at : at + 10]]
    found = _every(words) or _relative(words) or _of_day(words)
    return None if found is None else (at + found[0], found[1])


def _every(words: Sequence[str]) -> tuple[int, TimePhrase] | None:
    first = words[0]
    if first in _DAILY:
        unit, end = _DAILY[first], 1
    elif list(words[:2]) == ["on", "weekdays"]:
        unit, end = "weekdays", 2
    elif first in ("every", "each") and len(words) > 1:
        if (period := _period(words, 1)) is not None:
            return period[1], TimePhrase("every", every_s=period[0])
        unit, end = words[1], 2
    else:
        return None
    if unit in ("hour", "minute", "second"):
        return end, TimePhrase("every", every_s=_UNITS_S[unit])
    weekday = _DAYS.index(unit) if unit in _DAYS else 0 if unit == "week" else None
    if unit not in (*_PARTS, *_DAYS, "week", "weekday", "weekdays"):
        return None
    hour, minute = _PARTS.get(unit, 8), 0
    if words[end : end + 1] == ["at"] and (clock := _clock(words, end + 1, bare=True)) is not None:
        hour, minute, end = clock
    part = "weekdays" if unit in ("weekday", "weekdays") else unit
    return end, TimePhrase("every", hour=hour, minute=minute, weekday=weekday, part=part)


def _relative(words: Sequence[str]) -> tuple[int, TimePhrase] | None:
    kind = {"in": "start", "after": "start", "within": "due"}.get(words[0])
    period = _period(words, 1) if kind else None
    if kind is None or period is None:
        return None
    end = period[1] + (words[period[1] : period[1] + 2] == ["from", "now"]) * 2
    return end, TimePhrase(kind, after_s=period[0])


def _of_day(words: Sequence[str]) -> tuple[int, TimePhrase] | None:
    if words[0] in ("today", "tomorrow", "tonight"):
        days = int(words[0] == "tomorrow")
        clock = _of_day(words[1:]) if len(words) > 1 else None
        if clock is not None and clock[1].weekday is None:
            phrase = clock[1]
            return clock[0] + 1, TimePhrase(
                phrase.kind, hour=phrase.hour, minute=phrase.minute, days=days, part=phrase.part
            )
        if words[0] == "tomorrow" and len(words) > 1 and words[1] in _PARTS:
            return 2, TimePhrase("start", hour=_PARTS[words[1]], days=1, part=words[1])
        hour = 18 if words[0] == "tonight" else 0 if words[0] == "today" else 8
        kind = "due" if words[0] == "today" else "start"
        return 1, TimePhrase(kind, hour=hour, days=1 if kind == "due" else days, part=words[0])
    if words[0] == "this" and len(words) > 1 and words[1] in _PARTS and words[1] != "day":
        return 2, TimePhrase("start", hour=_PARTS[words[1]], part=words[1])
    if words[:2] in (["in", "the"], ["by", "the"]) and len(words) > 2 and words[2] in _PARTS:
        return 3, TimePhrase("start", hour=_PARTS[words[2]], part=words[2])
    if words[0] in ("on", "next") and len(words) > 1 and words[1] in _DAYS:
        day, end = _DAYS.index(words[1]), 2
        clock_at = _clock(words, 3, bare=True) if words[2:3] == ["at"] else None
        hour, minute, end = clock_at or (8, 0, end)
        return end, TimePhrase("start", hour=hour, minute=minute, weekday=day)
    if words[0] == "between":
        first = _clock(words, 1, bare=True)
        last = _clock(words, first[2] + 1, bare=True) if first else None
        if first and last and words[first[2]] == "and":
            return last[2], TimePhrase("start", hour=first[0], minute=first[1], until=last[:2])
        return None
    kinds = {"at": "start", "after": "start", "from": "start", "before": "due", "by": "due"}
    meant = kinds.get(words[0])
    on_clock = _clock(words, 1, bare=True) if meant else None
    if meant is None or on_clock is None:
        return None
    days = 0
    hour, minute, end = on_clock
    if words[end : end + 1] in (["today"], ["tomorrow"]):
        days, end = int(words[end] == "tomorrow"), end + 1
    return end, TimePhrase(meant, hour=hour, minute=minute, days=days)
