"""The rules of time zones as events of the core.

Apart from `fleet.service.time_zones`, by which robotctl shows times: it needs nothing of the core.
"""

from __future__ import annotations

from datetime import UTC, datetime

from fleet.core.events import At, TimeZoneRead
from fleet.service.time_zones import UnknownZone, offsets_of


class ZonesTold:
    """Tells the core the rules of each time zone once, before the first who speaks of it."""

    def __init__(self) -> None:
        self._told: set[str] = set()

    def news(self, zone: str | None, at: At) -> TimeZoneRead | None:
        """The zone's rules; `None` if the core has them, or nobody does."""
        if zone is None or zone in self._told:
            return None
        self._told.add(zone)
        try:
            offsets = offsets_of(zone, datetime.fromtimestamp(at["wall_time_s"], UTC))
        except UnknownZone:
            return None
        return TimeZoneRead(zone=zone, offsets=offsets, **at)
