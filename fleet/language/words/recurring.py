"""Times that come again, in words."""

from __future__ import annotations

from datetime import UTC, datetime

from cronsim import CronSim, CronSimError


def times_in_words(every: str) -> str:
    """A line of cron, or a period, in words."""
    if every.startswith("PT") and every[2:-1].isdigit() and every[-1] in "HMS":
        unit = {"H": "hours", "M": "minutes", "S": "seconds"}[every[-1]]
        return f"every {every[2:-1]} {unit}"
    try:
        told = CronSim(every, datetime(2000, 1, 1, tzinfo=UTC)).explain()
    except CronSimError:
        return f"every {every}"
    return told[:1].lower() + told[1:]
