"""Times on the command line: how a person writes one, and how one is shown.

Persons read and write clocks of this machine's zone. In JSON each Unix time has the same in ISO
8601 beside it, with the offset from UTC. What a simulation calls the time, seconds from the
beginning of its mission, stands behind where it is another clock.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

from cli.errors import BadArgument

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

_UNITS_S = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86_400.0, "w": 604_800.0}
LONGEST_S = 1000 * 366 * 86_400.0
"""The longest span that a person may write [s]."""
_ISO_UNITS = ((3600.0, "H"), (60.0, "M"), (1.0, "S"))
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


def now_here() -> datetime:
    """What clocks show here, in a zone that knows on which days they are changed, where the host
    says which one that is."""
    return datetime.now(zone_said(None)).astimezone(zone_said(None))


def parse_span(written: str, option: str) -> float:
    """A span such as `90s`, `15min`, `2h`, `7d`, `1d12h`, in seconds.

    Raises:
        BadArgument: it is none, or longer than calendars go; the message names the `option`.
    """
    if not _SPAN.fullmatch(written):
        raise BadArgument(f"{option} {written!r} is no span of time such as 90s, 15min, 2h, 7d")
    span_s = sum(float(number) * _UNITS_S[unit] for number, unit in _PART.findall(written))
    if span_s > LONGEST_S:
        raise BadArgument(f"{option} {written!r} is longer than a thousand years")
    return span_s


def span_said(span_s: float) -> str:
    """`8 h`, `1 d 12 h`, `1 min 30 s`: a span in words."""
    parts, left_s = [], round(span_s, 1)
    for unit, size_s in (("d", 86_400.0), ("h", 3600.0), ("min", 60.0)):
        count, left_s = divmod(left_s, size_s)
        if count:
            parts.append(f"{int(count)} {unit}")
    if left_s or not parts:
        parts.append(f"{left_s:.10g} s")
    return " ".join(parts)


def until_said(written: str, until_s: float, now: datetime) -> str:
    """So long from `now` [s], as it was `written`: `in 8 h`, or `tomorrow 17:00`."""
    if _SPAN.fullmatch(written):
        return f"in {span_said(until_s)}"
    return moment(round(now.timestamp() + until_s), now=now)


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
        if seconds % 86_400 == 0.0:
            return f"P{int(seconds // 86_400)}D"
        size_s, unit = next(each for each in _ISO_UNITS if seconds % each[0] == 0.0)
        return f"PT{int(seconds // size_s)}{unit}"
    try:
        Recurrence.of(written, now.timestamp(), now)
    except NotUnderstood as error:
        raise BadArgument(f"{option}: {error}, or as a span such as 2h") from None
    return written


SAME_CLOCK_S = 86_400.0
"""The fleet's clock is Unix time where the two are no further apart than this [s]."""


def moment(wall_s: float | None, fleet_s: float | None = None, now: datetime | None = None) -> str:
    """`today 14:03`, `yesterday 14:03`, `28 Nov 14:03`; the year where it is another one.

    `fleet_s` is the same moment on the fleet's clock: with a simulation's, `today 14:03 (mission
    12.3 s)`, and that alone where nobody has said what time it was for people.
    """
    if wall_s is None and fleet_s is not None and fleet_s > SAME_CLOCK_S:
        wall_s = fleet_s  # as long as a mission no simulation runs: it is Unix time
    if wall_s is None:
        return "" if fleet_s is None else f"mission {fleet_s:.1f} s"
    here = now or datetime.now().astimezone()
    at = _on_the_calendar(wall_s, now)
    if at is None:
        return _off_the_calendar(wall_s)
    day = f"{at.day} {at:%b}" if at.year == here.year else f"{at.day} {at:%b %Y}"
    for ago, name in ((0, "today"), (1, "yesterday"), (-1, "tomorrow")):
        if at.date() == here.date() - timedelta(days=ago):
            day = name
    simulated = fleet_s is not None and abs(fleet_s - wall_s) > SAME_CLOCK_S
    return f"{day} {at:%H:%M}" + (f" (mission {fleet_s:.1f} s)" if simulated else "")


def iso(wall_s: float) -> str:
    """`2026-11-29T14:03:12+01:00`: a Unix time [s] in this machine's zone."""
    at = _on_the_calendar(wall_s)
    return _off_the_calendar(wall_s) if at is None else at.isoformat(timespec="seconds")


def _on_the_calendar(wall_s: float, now: datetime | None = None) -> datetime | None:
    """`None`: no calendar goes that far. Whoever puts something may say any time, milliseconds in
    place of seconds, say."""
    try:
        return datetime.fromtimestamp(wall_s).astimezone(None if now is None else now.tzinfo)
    except (OverflowError, ValueError, OSError):
        return None


def _off_the_calendar(wall_s: float) -> str:
    return f"Unix time {wall_s:.6g} s"


def with_iso(shown: Any) -> Any:
    """What is shown as JSON, plain values as `msgspec.to_builtins` gives them, with each Unix time
    in ISO 8601 behind it: `time` beside `wall_time_s`, `given` beside `given_wall_s`."""
    if isinstance(shown, dict):
        return dict(_entries(shown))
    if isinstance(shown, list | tuple):
        return [with_iso(each) for each in shown]
    return shown


def _entries(shown: dict[Any, Any]) -> Iterator[tuple[Any, Any]]:
    for name, value in shown.items():
        yield name, with_iso(value)
        if isinstance(name, str) and isinstance(value, int | float) and value > 0.0:
            if name == "wall_time_s":
                yield "time", iso(value)
            elif name.endswith("_wall_s"):
                yield name.removesuffix("_wall_s"), iso(value)
