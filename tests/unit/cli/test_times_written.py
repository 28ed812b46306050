"""Times and spans as people write them on the command line."""

from __future__ import annotations

from datetime import UTC, datetime
from zoneinfo import ZoneInfo

import pytest

from cli.errors import BadArgument
from cli.times import now_here, parse_every, parse_until, span_said, until_said, zone_said

BERLIN = ZoneInfo("Europe/Berlin")
HOUR_S = 3600.0


def test_a_time_with_no_date_is_the_next_such_time() -> None:
    now = datetime(2026, 11, 29, 16, 30, tzinfo=BERLIN)
    assert parse_until("17:00", "--at", now) == HOUR_S / 2
    assert parse_until("16:30", "--at", now) == 24 * HOUR_S
    assert parse_until("2026-11-29T18:30", "--at", now) == 2 * HOUR_S
    assert parse_until("2026-11-29T18:30+00:00", "--at", now) == 3 * HOUR_S


def test_the_next_such_time_is_that_of_clocks_that_are_changed_meanwhile() -> None:
    spring = datetime(2026, 3, 28, 12, 0, tzinfo=BERLIN)
    assert parse_until("11:00", "--at", spring) == 22 * HOUR_S
    autumn = datetime(2026, 10, 24, 12, 0, tzinfo=BERLIN)
    assert parse_until("11:00", "--at", autumn) == 24 * HOUR_S


def test_times_of_other_days_are_those_of_this_place_on_these_days(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TZ", "Europe/Berlin")
    now = now_here()
    for written, utc in (("2090-06-01T17:00", 15), ("2090-12-01T17:00", 16)):
        at_s = now.timestamp() + parse_until(written, "--due", now)
        assert datetime.fromtimestamp(at_s, UTC).hour == utc, written


def test_until_when_is_said_as_it_was_written() -> None:
    now = datetime(2026, 11, 29, 16, 30, 12, 345678, tzinfo=BERLIN)
    for written, words in (
        ("8h", "in 8 h"),
        ("20min", "in 20 min"),
        ("1d12h", "in 1 d 12 h"),
        ("90s", "in 1 min 30 s"),
        ("17:00", "today 17:00"),
        ("16:00", "tomorrow 16:00"),
        ("2026-12-24T18:30", "24 Dec 18:30"),
    ):
        assert until_said(written, parse_until(written, "--due", now), now) == words
    assert (span_said(0.0), span_said(0.5)) == ("0 s", "0.5 s")


def test_no_span_is_longer_than_calendars_go() -> None:
    now = datetime(2026, 11, 29, 16, 30, tzinfo=BERLIN)
    for written in ("9999999999999999999w", f"{'9' * 400}s"):
        with pytest.raises(BadArgument, match="is longer than a thousand years"):
            parse_until(written, "--until", now)


def test_what_is_over_is_said_with_what_it_is_now() -> None:
    now = datetime(2026, 11, 29, 16, 30, tzinfo=BERLIN)
    with pytest.raises(BadArgument, match="is over already; it is 2026-11-29 16:30 now"):
        parse_until("2026-11-29T16:00", "--at", now)


@pytest.mark.parametrize(
    ("written", "means"),
    [
        *(("2h", "PT2H"), ("7d", "P7D"), ("1d12h", "PT36H"), ("90s", "PT90S")),
        *(("0 8 * * 1-5", "0 8 * * 1-5"), ("@daily", None), ("0.5s", None), ("0 8 31 2 *", None)),
        *(("60 8 * * *", None), ("0 8 * *", None), ("", None), ("soon", None)),
    ],
)
def test_how_often_is_a_line_of_cron_or_a_span(written: str, means: str | None) -> None:
    now = datetime(2026, 11, 29, 16, 30, tzinfo=BERLIN)
    if means is not None:
        assert parse_every(written, "--every", now) == means
        return
    with pytest.raises(BadArgument, match=r"^--every"):
        parse_every(written, "--every", now)


def test_a_zone_is_said_or_the_hosts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "America/New_York")
    assert str(zone_said(None)) == "America/New_York"
    assert str(zone_said("Europe/Berlin")) == "Europe/Berlin"
    monkeypatch.setenv("TZ", "EST5EDT4,M3.2.0,M11.1.0")
    assert zone_said(None) is None
    with pytest.raises(
        BadArgument, match=r"'Europe/Berln' is no time zone \(did you mean Europe/B"
    ):
        zone_said("Europe/Berln")
