"""Times of goals that are for later, or for again and again."""

from __future__ import annotations

from datetime import UTC

import pytest
from msgspec.structs import replace

from fleet.core.model.recurrence import MOST_MISSED, Recurrence, recurrence_of, said_at, when_shown
from fleet.errors import NotUnderstood
from keyexpr_schema.payloads.goals import Goal

HOUR_S = 3600.0
DAY_S = 24 * HOUR_S


def goal(every: str | None = None, shown: str | None = "2026-05-01T06:00:00+02:00") -> Goal:
    return Goal(goal="g", text="", every=every, said_s=1000.0, said_at=shown)


def test_a_line_of_cron_counts_on_the_clock_that_was_brought() -> None:
    times = recurrence_of(goal("30 7 * * *"))
    first_s = 1000.0 + 1.5 * HOUR_S
    assert times.first() == first_s
    assert times.next_after(first_s) == first_s + DAY_S
    assert times.passed(first_s, first_s + 3 * DAY_S) == [first_s + n * DAY_S for n in (1, 2, 3)]
    # The first of May 2026 is a Friday.
    assert recurrence_of(goal("0 6 * * 1")).first() == 1000.0 + 3 * DAY_S


def test_a_period_counts_from_its_start() -> None:
    times = recurrence_of(goal("PT1H30M", shown=None))
    assert times.first() == 1000.0
    assert times.next_after(1000.0) == 1000.0 + 1.5 * HOUR_S
    assert times.next_after(1000.0 + 1.6 * HOUR_S) == 1000.0 + 3 * HOUR_S
    assert len(times.passed(1000.0, 1000.0 + 6 * HOUR_S)) == 4
    assert len(times.passed(1000.0, 1e12)) == MOST_MISSED


def test_a_time_is_not_counted_again_where_seconds_are_rounded() -> None:
    start_s = 126_570_858.033
    times = Recurrence(start_s, DAY_S)
    due_s = start_s + 467 * DAY_S
    assert (due_s - start_s) // DAY_S == 466.0
    assert times.next_after(due_s) == start_s + 468 * DAY_S
    assert len(times.passed(due_s - 1.0, due_s + 2 * DAY_S)) == 3


def test_it_begins_when_the_goal_may() -> None:
    later = Goal(goal="g", text="", every="0 * * * *", not_before_s=1000.0 + 90 * 60.0,
                 said_s=1000.0, said_at="2026-05-01T06:00:00+02:00")  # fmt: skip
    assert recurrence_of(later).first() == 1000.0 + 2 * HOUR_S


@pytest.mark.parametrize("every", ["", "P", "PT0S", "7", "0 7 * *", "0 7 31 2 *", "99 7 * * *"])
def test_what_is_neither_is_refused(every: str) -> None:
    shown = said_at(goal())
    with pytest.raises(NotUnderstood, match="neither a line of cron nor an ISO 8601 period"):
        Recurrence.of(every, 0.0, shown)


def test_times_in_words_are_as_clocks_will_show_them() -> None:
    assert when_shown(goal(), 1000.0 + HOUR_S) == "07:00"
    assert when_shown(goal(), 1005.0) == "06:00:05"
    assert when_shown(goal(), 1000.0 + DAY_S) == "06:00 on 2026-05-02"
    assert when_shown(goal(shown=None), 1000.4) == "1000 s on the fleet's clock"


@pytest.mark.parametrize("shown", ["0001-01-01T00:00:00+14:00", "9999-12-31T23:59:00-14:00"])
def test_what_is_said_at_an_end_of_the_calendar_is_not_understood(shown: str) -> None:
    wanted = replace(goal("0 8 * * *", shown), zone="UTC")
    with pytest.raises(NotUnderstood, match="is at an end of the calendar"):
        recurrence_of(wanted, {"UTC": UTC})
    last = goal("0 8 * * *", "9999-12-31T23:59:59+00:00")
    with pytest.raises(NotUnderstood, match="no time comes of it"):
        recurrence_of(last)
