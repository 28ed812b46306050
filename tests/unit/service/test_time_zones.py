"""What the planner is told of time zones, and how a host says its own."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from fleet.core.model.time_zones import time_zone
from fleet.service.event_translation import zone_in
from fleet.service.time_zones import UnknownZone, host_zone, offsets_of, zone_named
from fleet.service.zones_told import ZonesTold
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.schedules import Schedule

NOW = datetime(2026, 11, 29, tzinfo=UTC)
AT = {"time_s": 1.0, "wall_time_s": NOW.timestamp(), "monotonic_s": 1.0}


def test_a_zones_rules_are_told_once_and_what_is_none_never() -> None:
    told = ZonesTold()
    event = told.news("Europe/Berlin", AT)
    assert event is not None
    assert (event.zone, event.offsets) == ("Europe/Berlin", offsets_of("Europe/Berlin", NOW))
    assert told.news("Europe/Berlin", AT) is None
    assert told.news("Europe/Nowhere", AT) is None
    assert told.news(None, AT) is None


def test_whoever_speaks_of_a_zone_is_heard() -> None:
    goal = Goal(goal="g", text="", zone="UTC")
    assert zone_in(goal) == "UTC"
    assert zone_in(Schedule(schedule="g", goal=goal)) == "UTC"
    assert zone_in(None) is None


def test_rules_reach_ten_years_ahead_and_are_few() -> None:
    offsets = offsets_of("Europe/Berlin", NOW)
    assert len(offsets) < 40
    summer = datetime(2036, 7, 1, 12, tzinfo=UTC).astimezone(time_zone("Europe/Berlin", offsets))
    assert summer.isoformat() == "2036-07-01T14:00:00+02:00"
    assert offsets_of("UTC", NOW) == (offsets_of("UTC", NOW)[0],)


@pytest.mark.parametrize("name", ["Europe/Berln", "", "../etc/passwd", "/etc/passwd", "x" * 5000])
def test_what_is_no_zone_is_said(name: str) -> None:
    with pytest.raises(UnknownZone, match="is no time zone"):
        zone_named(name)


def test_the_hosts_zone_is_what_its_environment_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", ":Asia/Kolkata")
    assert host_zone() == "Asia/Kolkata"
    monkeypatch.setenv("TZ", "CET-1CEST")
    assert host_zone() is None
