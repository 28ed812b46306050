"""The rules of time zones as this host has them: for the core, and for people."""

from __future__ import annotations

import os
from datetime import UTC, datetime, timedelta
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError, available_timezones

from fleet.core.model.time_zones import Offsets
from fleet.errors import FleetError
from keyexpr_schema.payloads.goals import Goal

FIRST_YEAR = 2020
"""No goal was said before."""
YEARS_AHEAD = 10
"""For how long from now a zone's rules are told; each start of a planner tells them anew."""
_LOCALTIME = Path("/etc/localtime")
_NAMED = Path("/etc/timezone")
_FOLDER = "zoneinfo/"
_STEP = timedelta(days=7)


class UnknownZone(FleetError):
    """There is no time zone of that name."""


@lru_cache(64)
def zone_named(name: str) -> ZoneInfo:
    """The time zone of this IANA name.

    Raises:
        UnknownZone: there is none; one sentence.
    """
    try:
        return ZoneInfo(name)
    except (ZoneInfoNotFoundError, ValueError, OSError):
        near = get_close_matches(name, available_timezones(), n=3)
        meant = f" (did you mean {' or '.join(near)}?)" if near else ""
        raise UnknownZone(
            f"{name[:60]!r} is no time zone{meant}; they have names such as Europe/Berlin or UTC"
        ) from None


def zones_of(goal: Goal) -> dict[str, ZoneInfo]:
    """The zone that a goal's times of day are of, where it says one that there is."""
    try:
        return {} if goal.zone is None else {goal.zone: zone_named(goal.zone)}
    except UnknownZone:
        return {}


def offsets_of(name: str, now: datetime) -> Offsets:
    """How far a zone's clocks are ahead of UTC, from `FIRST_YEAR` until `YEARS_AHEAD` of now.

    Raises:
        UnknownZone: there is no such zone.
    """
    zone = zone_named(name)
    at = datetime(FIRST_YEAR, 1, 1, tzinfo=UTC)
    until = datetime(now.year + YEARS_AHEAD + 1, 1, 1, tzinfo=UTC)
    found = [(at.timestamp(), _ahead_s(at, zone))]
    while at < until:
        later = at + _STEP
        if _ahead_s(later, zone) != found[-1][1]:
            found.append(_change(at, later, zone))
        at = later
    return tuple(found)


def host_zone() -> str | None:
    """The IANA name of this host's time zone; `None` where that is not said."""
    for named in _names():
        try:
            return zone_named(named).key
        except UnknownZone:
            continue
    return None


def _names() -> list[str]:
    """What may be the name of the host's zone, the best first."""
    if (said := os.environ.get("TZ", "")) != "":
        return [said.removeprefix(":")]
    found = []
    if _LOCALTIME.is_symlink():
        target = os.fspath(_LOCALTIME.resolve())
        found += [target.rpartition(_FOLDER)[2]] if _FOLDER in target else []
    if _NAMED.is_file():
        found.append(_NAMED.read_text(encoding="utf-8", errors="replace").strip())
    return found


def _ahead_s(at: datetime, zone: ZoneInfo) -> int:
    offset = at.astimezone(zone).utcoffset()
    return round(offset.total_seconds()) if offset is not None else 0


def _change(before: datetime, after: datetime, zone: ZoneInfo) -> tuple[float, int]:
    """When clocks are changed between two times, to the second, and what they are then."""
    was = _ahead_s(before, zone)
    low, high = round(before.timestamp()), round(after.timestamp())
    while high - low > 1:
        middle = (low + high) // 2
        same = _ahead_s(datetime.fromtimestamp(middle, UTC), zone) == was
        low, high = (middle, high) if same else (low, middle)
    return float(high), _ahead_s(datetime.fromtimestamp(high, UTC), zone)
