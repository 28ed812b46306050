"""What `robotctl schedule` lists: schedules, goals that stand by, and goals for later."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from zoneinfo import ZoneInfo

import pytest
from rich.console import Console

from cli.client.fleet_view import FleetView
from cli.client.schedules import ScheduleRow, chosen, next_runs, schedule_rows
from cli.errors import BadArgument, Unknown
from cli.views.schedules import next_lines, schedule_page, schedules_table
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.schedules import Schedule, ScheduleState, ScheduleStatus

SAID = datetime(2026, 3, 27, 6, tzinfo=ZoneInfo("Europe/Berlin"))
SAID_S = SAID.timestamp()
DAY_S = 86_400.0
OPEN = Condition(relation="is_open", subject="door", value=True)


def goal(name: str, **more: Any) -> Goal:
    at = {"said_s": SAID_S, "said_at": SAID.isoformat(), "zone": "Europe/Berlin"}
    return Goal(goal=name, text=f"do {name}", **{**at, **more})


def status(name: str, state: GoalState, **more: Any) -> GoalStatus:
    return GoalStatus(goal=name, state=state, **more)


@pytest.fixture
def view() -> FleetView:
    first_s = SAID_S + 2 * 3600.0
    daily = ScheduleStatus(
        schedule="daily",
        state=ScheduleState.ACTIVE,
        text="do daily",
        every="0 8 * * *",
        zone="Europe/Berlin",
        begins=SAID.isoformat(),
        begins_s=SAID_S,
        next="2026-03-27T08:00:00+01:00",
        next_s=first_s,
        runs=2,
        missed=3,
    )
    return FleetView(
        schedules={"daily": Schedule(schedule="daily", goal=goal("daily", every="0 8 * * *"))},
        schedule_status={"daily": daily},
        goals={name: goal(name) for name in ("door", "later", "plain", "kept", "when")},
        goal_status={
            "daily": status("daily", GoalState.STANDING, next_s=first_s, runs=2),
            "door": status("door", GoalState.STANDING, whenever=(OPEN,), paused=True),
            "later": status("later", GoalState.PENDING, next_s=SAID_S + 60.0, reason="begins soon"),
            "when": status("when", GoalState.PENDING, reason="it waits until the door is open"),
            "plain": status("plain", GoalState.RUNNING),
            "kept": status("kept", GoalState.STANDING),
            "daily.2": status("daily.2", GoalState.RUNNING, part_of="daily"),
        },
        holds={"h": Hold(hold="h", kind=HoldKind.PAUSE, schedules=("door",))},
    )


def named(view: FleetView, name: str) -> ScheduleRow:
    (row,) = chosen(schedule_rows(view), [name])
    return row


def test_what_is_listed_comes_in_the_order_of_what_is_next(view: FleetView) -> None:
    rows = schedule_rows(view)
    assert [(row.schedule, row.kind, row.state) for row in rows] == [
        ("later", "once", "waits"),
        ("daily", "every", "active"),
        ("door", "whenever", "paused"),
        ("when", "once", "waits"),
    ]
    assert rows[0].next == "2026-03-27T06:01:00+01:00"
    with pytest.raises(Unknown, match="no schedule or goal for later 'plain'"):
        chosen(rows, ["plain"])


def test_the_next_runs_are_those_of_clocks_that_are_changed_meanwhile(view: FleetView) -> None:
    runs = next_runs(named(view, "daily"), SAID_S + DAY_S, 3)
    assert [run.at for run in runs] == [
        "2026-03-28T08:00:00+01:00",
        "2026-03-29T08:00:00+02:00",
        "2026-03-30T08:00:00+02:00",
    ]
    assert runs[1].at_s - runs[0].at_s == DAY_S - 3600.0
    assert [run.at_s for run in next_runs(named(view, "later"), SAID_S, 3)] == [SAID_S + 60.0]


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("door", "door has no times: it is done each time that is_open(door) = true"),
        ("when", "when has no time: it waits until the door is open"),
    ],
)
def test_what_has_no_times_says_why(view: FleetView, name: str, says: str) -> None:
    with pytest.raises(BadArgument) as raised:
        next_runs(named(view, name), SAID_S, 1)
    assert str(raised.value) == says


def test_tables_and_pages_have_it_all(view: FleetView, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "America/New_York")
    page = Console(width=160)
    with page.capture() as captured:
        page.print(schedules_table(schedule_rows(view)))
        page.print(schedule_page(named(view, "daily")))
        page.print(schedule_page(named(view, "door")))
        page.print(*next_lines(view.schedule_status.values()))
    text = captured.get()
    assert "0 8 * * * Europe/Berlin" in text
    assert "whenever is_open(door) = true" in text
    assert "times       0 8 * * *  (at 08:00 every day)" in text
    assert "runs        2 (3 missed)\n            daily.2 running\n" in text
    assert "next        Fri 2026-03-27 08:00\n" in text
    assert "schedule daily: next Fri 2026-03-27 08:00" in text
