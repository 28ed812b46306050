"""Times that a sentence names: "at 5 pm", "in ten minutes", "before noon", "every morning"."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

from fleet.language.words.tokens import Token, number_of, ordinal_of

_UNITS_S = {"second": 1.0, "sec": 1.0, "minute": 60.0, "min": 60.0, "hour": 3600.0, "day": 86400.0}
_UNITS_S |= {"week": 604800.0}
_HOURS = {"noon": 12, "midday": 12, "midnight": 0}
_PARTS = {"morning": 8, "afternoon": 15, "evening": 18, "night": 22, "day": 8}
_DAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
_DAILY = {"daily": "day", "hourly": "hour", "weekly": "week", "nightly": "night"}
_DAILY |= {f"{part}s": part for part in ("morning", "afternoon", "evening", "night")}
_MANY = {"weekday": range(5), "weekend": range(5, 7)}
_HALVES = frozenset(
    {"am", "pm", "a", "p", ",", "o", "oclock", "o'clock", "hours", "morning", "night"}
)
_HALVES |= {"afternoon", "evening", "noon", "midday", "midnight"}
_PER = ("a", "an", "per", "every", "each")
_CYCLES = ("second", "minute", "hour", "day", "week", "month", "year")
_EXCEPT = (["except", "for"], ["except"], ["excluding"], ["but", "not"], ["apart", "from"])


@dataclass(frozen=True)
class TimePhrase:
    """What a phrase of time says.

    `kind`: `start` (not before), `due` (done by), `every`; `often` and `for` say how often and how
    long in a way that goals cannot. `after_s` counts from now; `hour` and `minute` are on the
    clock, `days` whole days ahead; `weekday` counts from Monday, as do `on`, the days on which it
    is done again and again. `every` is a period in seconds, or with a clock time a day or week
    (`cron`).
    """

    kind: str
    after_s: float | None = None
    hour: int | None = None
    minute: int = 0
    days: int = 0
    weekday: int | None = None
    on: tuple[int, ...] = ()
    every_s: float | None = None
    part: str = ""
    until: tuple[int, int] | None = None
    """Hour and minute by which it shall be done: "between 10 and 11"."""
    exact: bool = True
    """Whether the half of the day was said."""
    since: str = ""
    """What it begins with, where that says from when on: `after`, `from`, `at`, `in`."""

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
        if now.tzinfo is not None:  # and not what clocks show, which may be put forward meanwhile
            at, now = at.astimezone(UTC), now.astimezone(UTC)
        return (at - now).total_seconds()

    @property
    def recurrence(self) -> str:
        """A line of cron, or an ISO 8601 period for what no clock time belongs to."""
        if self.every_s is not None:
            whole = int(self.every_s)
            return f"PT{whole // 3600}H" if whole % 3600 == 0 else f"PT{whole // 60}M"
        days = sorted((day + 1) % 7 for day in self.on)
        day = "1-5" if days == [1, 2, 3, 4, 5] else ",".join(map(str, days)) or "*"
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
    words = [token.word for token in tokens[at : at + 20]]
    found = _how_often(words) or _every(words) or _relative(words) or _of_day(words)
    return None if found is None else (at + found[0], found[1])


def _how_often(words: Sequence[str]) -> tuple[int, TimePhrase] | None:
    """`three times a day`, `for ten minutes`: what says no times at which something is done."""
    if words[0] == "for" and (period := _period(words, 1)) is not None:
        return period[1], TimePhrase("for")
    end = 1 if words[0] in ("twice", "thrice") else 0
    if words[1:2] == ["times"] and (number_of(words[0]) or 0) > 1:
        end = 2
    if not end:
        return None
    if len(words) > end + 1 and words[end] in _PER and words[end + 1] in _CYCLES:
        end += 2
    return end, TimePhrase("often")


def _every(words: Sequence[str]) -> tuple[int, TimePhrase] | None:
    first = words[0]
    if first in _DAILY:
        unit, end = _DAILY[first], 1
    elif first in ("on", "at", "during") and (days := _days(words, 1, several=True)) is not None:
        return _at_clock(words, days[1], TimePhrase("every", hour=8, on=days[0], part="day"))
    elif list(words[:2]) == ["in", "the"] and words[2:3] and words[2][:-1] in _PARTS:
        unit, end = words[2][:-1], 3  # "in the mornings"
    elif first == "once" and len(words) > 2 and words[1] in _PER and words[2] in _CYCLES:
        unit, end = words[2], 3
    elif first in ("every", "each") and len(words) > 1:
        if (period := _rare(words) or _period(words, 1)) is not None:
            return period[1], TimePhrase("every", every_s=period[0])
        if (days := _days(words, 1)) is not None:
            return _at_clock(words, days[1], TimePhrase("every", hour=8, on=days[0], part="day"))
        unit, end = words[1], 2
    else:
        return None
    if unit in ("hour", "minute", "second"):
        return end, TimePhrase("every", every_s=_UNITS_S[unit])
    if unit not in (*_PARTS, "week"):
        return None
    on = (0,) if unit == "week" else ()
    return _at_clock(words, end, TimePhrase("every", hour=_PARTS.get(unit, 8), on=on, part=unit))


def _rare(words: Sequence[str]) -> tuple[float, int] | None:
    """`every other day`, `every third hour`: seconds, and where it ends."""
    if len(words) < 3 or words[2] not in _UNITS_S:
        return None
    count = 2 if words[1] == "other" else ordinal_of(words[1])
    return None if count is None else (count * _UNITS_S[words[2]], 3)


def _days(
    words: Sequence[str], at: int, several: bool = False
) -> tuple[tuple[int, ...], int] | None:
    """`Mondays, Wednesdays and Fridays`: the days, and where it ends; `several`: each is said so
    that it is meant again and again."""
    found: list[int] = []
    end = at
    while at < len(words):
        name = words[at].removesuffix("s")
        if (several and name == words[at]) or name not in (*_DAYS, "weekday", "weekend"):
            break
        found += _MANY[name] if name in _MANY else [_DAYS.index(name)]
        at = end = at + 1
        while at < len(words) and words[at] in ("and", ","):
            at += 1
    return (tuple(dict.fromkeys(found)), end) if found else None


def _at_clock(words: Sequence[str], end: int, time: TimePhrase) -> tuple[int, TimePhrase]:
    """The same, with what is said behind it: the time of day, and the days that are left out."""
    for _ in range(2):
        if (left_out := _but_days(words, end)) is not None:
            kept = tuple(day for day in time.on or range(7) if day not in left_out[0])
            time, end = replace(time, on=kept), left_out[1]
        if words[end : end + 1] == ["at"] and (clock := _clock(words, end + 1, bare=True)):
            time = replace(time, hour=hour_in(time.part, clock[0]), minute=clock[1])
            end = clock[2]
    return end, time


def hour_in(part: str, hour: int) -> int:
    """The hour that is meant of a part of the day: 22 of "every evening at 10"."""
    first = {"afternoon": 0, "evening": 0, "night": 6}.get(part, 12)
    return hour + 12 if first <= hour < 12 else hour


def _but_days(words: Sequence[str], at: int) -> tuple[tuple[int, ...], int] | None:
    at += list(words[at : at + 1]) == [","]
    said = next((p for p in _EXCEPT if list(words[at : at + len(p)]) == p), None)
    if said is None:
        return None
    at += len(said)
    return _days(words, at + (list(words[at : at + 1]) in (["on"], ["at"])))


def _relative(words: Sequence[str]) -> tuple[int, TimePhrase] | None:
    kind = {"in": "start", "after": "start", "within": "due"}.get(words[0])
    period = _period(words, 1) if kind else None
    if kind is None or period is None:
        return None
    end = period[1] + (words[period[1] : period[1] + 2] == ["from", "now"]) * 2
    return end, TimePhrase(kind, after_s=period[0], since=words[0])


def _of_day(words: Sequence[str]) -> tuple[int, TimePhrase] | None:
    if words[0] in ("today", "tomorrow", "tonight"):
        days = int(words[0] == "tomorrow")
        clock = _of_day(words[1:]) if len(words) > 1 else None
        if clock is not None and clock[1].weekday is None:
            phrase = clock[1]
            hour = phrase.hour or 0
            return clock[0] + 1, TimePhrase(
                phrase.kind,
                hour=hour_in("night", hour) if words[0] == "tonight" else hour,
                minute=phrase.minute,
                days=days,
                part=phrase.part,
                exact=phrase.exact or words[0] == "tomorrow",
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
    if (window := _window(words)) is not None or words[0] == "between":
        return window
    if words[:2] in (["not", "before"], ["never", "before"]):
        on_clock = _clock(words, 2, bare=True)
        return on_clock and (on_clock[2], TimePhrase("start", hour=on_clock[0], minute=on_clock[1]))
    kinds = {"at": "start", "after": "start", "from": "start", "before": "due", "by": "due"}
    meant = kinds.get(words[0])
    on_clock = _clock(words, 1, bare=True) if meant else None
    if meant is None or on_clock is None:
        return None
    days = 0
    hour, minute, end = on_clock
    if words[end : end + 1] in (["today"], ["tomorrow"], ["tonight"]):
        hour = hour_in("night", hour) if words[end] == "tonight" else hour
        days, end = int(words[end] == "tomorrow"), end + 1
    bare = not any(word in _HALVES for word in words[1:end]) and 0 < hour < 12
    return end, TimePhrase(
        meant, hour=hour, minute=minute, days=days, since=words[0], exact=not bare or bool(days)
    )


def _window(words: Sequence[str]) -> tuple[int, TimePhrase] | None:
    """`between 10 and 11`, `from 9 to 5`."""
    joints = {"between": ("and",), "from": ("to", "until", "till")}.get(words[0], ())
    ends = (i for i in range(2, min(len(words), 6)) if words[i] in joints)
    for i in ends:
        first, last = _clock(words[:i], 1, bare=True), _clock(words, i + 1, bare=True)
        if first and last and first[2] == i:
            hour, bare = first[0], not any(word in _HALVES for word in words[1:i])
            hour += 12 * (bare and hour + 12 < last[0])  # "between 5 and 6 pm"
            return last[2], TimePhrase("start", hour=hour, minute=first[1], until=last[:2])
    return None
