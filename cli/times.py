"""How a person writes a time or a span of time on the command line."""

from __future__ import annotations

import re
from datetime import datetime, timedelta
from typing import TYPE_CHECKING

from cli.errors import BadArgument

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

_UNITS_S = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86_400.0, "w": 604_800.0}
_SPAN = re.compile(r"(?:[0-9]+(?:\.[0-9]+)?(?:s|min|m|h|d|w))+")
_PART = re.compile(r"([0-9.]+)(s|min|m|h|d|w)")
_CLOCK = re.compile(r"([01]?[0-9]|2[0-3]):([0-5][0-9])")


def zone_said(name: str | None) -> ZoneInfo | None:
    """The time zone of this name, else this host's; `None` where the host does not say.

    Raises:
        BadArgument: there is no zone of that name.
    """
    from fleet.service.time_zones import UnknownZone, host_zone, zone_named

    try:
        chosen = name or host_zone()
        return None if chosen is None else zone_named(chosen)
    except UnknownZone as error:
        raise BadArgument(f"--zone: {error}") from None


def parse_span(written: str, option: str) -> float:
    """A span such as `90s`, `15min`, `2h`, `7d`, `1d12h`, in seconds.

    Raises:
        BadArgument: it is none; the message names the `option`.
    """
    if not _SPAN.fullmatch(written):
        raise BadArgument(f"{option} {written!r} is no span of time such as 90s, 15min, 2h, 7d")
    return sum(float(number) * _UNITS_S[unit] for number, unit in _PART.findall(written))


def parse_since(written: str, option: str, now: datetime) -> float:
    """A time (`2026-11-28`, `2026-11-28T14:30`, `14:30` today) or a span before `now`, in Unix s.

    A time without an offset from UTC is one of `now`'s zone.

    Raises:
        BadArgument: it is neither; the message names the `option`.
    """
    if _SPAN.fullmatch(written):
        return now.timestamp() - parse_span(written, option)
    if clock := _CLOCK.fullmatch(written):
        hour, minute = map(int, clock.groups())
        return now.replace(hour=hour, minute=minute, second=0, microsecond=0).timestamp()
    try:
        time = datetime.fromisoformat(written)
    except ValueError:
        raise BadArgument(
            f"{option} {written!r} is neither a time such as 2026-11-28, 2026-11-28T14:30 or 14:30 "
            "nor a span such as 15min, 2h, 7d"
        ) from None
    return (time if time.tzinfo is not None else time.replace(tzinfo=now.tzinfo)).timestamp()


def parse_until(written: str, option: str, now: datetime) -> float:
    """How long it is from `now` until a time (`2026-11-28T14:30`, `14:30`, which is tomorrow's if
    it is over today), or a span (`90s`, `15min`, `2h`), in seconds.

    Raises:
        BadArgument: it is neither, or over; the message names the `option`.
    """
    if _SPAN.fullmatch(written):
        return parse_span(written, option)
    ahead_s = parse_since(written, option, now) - now.timestamp()
    if ahead_s <= 0.0 and _CLOCK.fullmatch(written):
        return parse_since(written, option, now + timedelta(days=1)) - now.timestamp()
    if ahead_s <= 0.0:
        raise BadArgument(f"{option} {written!r} is over already; it is {now:%Y-%m-%d %H:%M} now")
    return ahead_s


def parse_every(written: str, option: str, now: datetime) -> str:
    """How often: a line of cron, an ISO 8601 period (`PT2H`), or a span (`2h`), which becomes one.

    Raises:
        BadArgument: it is none of these; the message names the `option`.
    """
    from fleet.core.model.recurrence import Recurrence
    from fleet.errors import NotUnderstood

    if _SPAN.fullmatch(written):
        seconds = parse_span(written, option)
        if seconds < 1.0 or seconds % 1.0:
            raise BadArgument(f"{option} {written!r} is not a whole number of seconds")
        days, rest_s = divmod(int(seconds), 86_400)
        return f"PT{rest_s + 86_400 * days}S" if rest_s else f"P{days}D"
    try:
        Recurrence.of(written, now.timestamp(), now)
    except NotUnderstood as error:
        raise BadArgument(f"{option}: {error}, or as a span such as 2h") from None
    return written
