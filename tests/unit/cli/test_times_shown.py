"""Times as people and programs are shown them."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone

import pytest

from cli.times import iso, moment, with_iso

ZONE = timezone(timedelta(hours=1))
NOW = datetime(2026, 11, 29, 14, 30, tzinfo=ZONE)


@pytest.mark.parametrize(
    ("at", "shown"),
    [
        (datetime(2026, 11, 29, 14, 3, tzinfo=ZONE), "today 14:03"),
        (datetime(2026, 11, 28, 23, 59, tzinfo=ZONE), "yesterday 23:59"),
        (datetime(2026, 11, 30, 0, 1, tzinfo=ZONE), "tomorrow 00:01"),
        (datetime(2026, 11, 5, 8, 0, tzinfo=ZONE), "5 Nov 08:00"),
        (datetime(2025, 11, 5, 8, 0, tzinfo=ZONE), "5 Nov 2025 08:00"),
    ],
)
def test_a_moment_is_said_by_the_day_and_the_clock_of_this_place(at: datetime, shown: str) -> None:
    assert moment(at.timestamp(), None, NOW) == shown
    assert moment(at.timestamp(), at.timestamp() + 1.0, NOW) == shown, (
        "the fleet's clock is the same"
    )
    assert moment(at.timestamp(), 12.34, NOW) == f"{shown} (mission 12.3 s)"


def test_without_a_wall_clock_the_fleets_clock_is_said_for_what_it_is() -> None:
    assert moment(None, 12.34, NOW) == "mission 12.3 s"
    assert moment(None, NOW.timestamp(), NOW) == "today 14:30"
    assert moment(None, None, NOW) == ""


def test_in_json_unix_times_have_iso_times_beside_them() -> None:
    shown = with_iso(
        {"wall_time_s": 60.0, "time_s": 1.0, "parts": [{"given_wall_s": 120.0}], "wall_s": 2.0}
    )
    assert shown == {
        "wall_time_s": 60.0,
        "time": iso(60.0),
        "time_s": 1.0,
        "parts": [{"given_wall_s": 120.0, "given": iso(120.0)}],
        "wall_s": 2.0,
    }
    assert datetime.fromisoformat(iso(60.0)).timestamp() == 60.0
    assert datetime.fromisoformat(iso(60.0)).tzinfo is not None


@pytest.mark.parametrize("wall_s", [1.7e12, 1e300, -1e300])
def test_a_time_beyond_every_calendar_is_shown_as_the_number_that_it_is(wall_s: float) -> None:
    """Whoever puts something says its times: in milliseconds, say."""
    for shown in (moment(wall_s), moment(wall_s, 12.0, NOW), iso(wall_s)):
        assert shown == f"Unix time {wall_s:.6g} s"
    assert moment(None, 1e300, NOW) == "Unix time 1e+300 s"
