"""Schedules on keys of their own: their runs, what is missed or overlaps, pauses, names."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import pytest
from msgspec.structs import replace

from fleet.core import events
from fleet.core.dispatch.standing.runs import LATE_S, MOST_QUEUED
from fleet.core.events import decode_event
from fleet.core.step import replay
from fleet.service.time_zones import offsets_of
from keyexpr_schema.keyspace import SCHEDULE_STATUS
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.holds import Hold, HoldKind
from keyexpr_schema.payloads.schedules import (
    Missed,
    Overlap,
    Schedule,
    ScheduleAddress,
    ScheduleState,
    ScheduleStatus,
)
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import at, manipulator

HOUR_S = 3600.0
DAY_S = 24 * HOUR_S
SIX = "2026-05-01T06:00:00+02:00"
NOT_NEEDED = {"only_if": (at("cup_2", "hallway"),)}
"""A run of this is over at once, as long as cup 2 is in the kitchen."""


def put(model: FleetModel, every: str | None = "0 7 * * *", **more: Any) -> float:
    """Put schedule `s`; when it was said, by the fleet's clock [s]."""
    said_s = model.time_s + 1.0
    own = {name: more.pop(name) for name in ("missed", "overlap") if name in more}
    text = more.pop("text", "Bring cup 1 to the hallway")
    more = {"said_at": SIX, **more}
    goal = Goal(goal="s", text=text, every=every, said_s=said_s, **more)
    model.receive(events.SchedulePut, schedule=Schedule(schedule="s", goal=goal, **own))
    return said_s


def until(model: FleetModel, time_s: float) -> None:
    model.time_s = time_s - 1.0
    model.receive(events.TimerFired)


def status(model: FleetModel, name: str = "s") -> ScheduleStatus:
    found = model.documents[SCHEDULE_STATUS.build(ScheduleAddress(name))]
    assert isinstance(found, ScheduleStatus)
    return found


def hold(model: FleetModel, *names: str) -> None:
    paused = Hold(hold="h", kind=HoldKind.PAUSE, schedules=names, by="ana", reason="holidays")
    model.receive(events.HoldPut, hold=paused)


def test_a_schedule_says_what_comes_next_and_what_it_has_run() -> None:
    model = fleet()
    first_s = put(model) + HOUR_S
    found = status(model)
    assert (found.state, found.runs, found.latest, found.last) == (
        ScheduleState.ACTIVE,
        0,
        None,
        None,
    )
    assert (found.next, found.next_s) == ("2026-05-01T07:00:00+02:00", first_s)
    assert found.every == "0 7 * * *"
    assert not found.of_goal
    until(model, first_s)
    found = status(model)
    assert (found.latest, found.going_on, found.runs) == ("s.1", ("s.1",), 1)
    assert (found.last, found.last_s) == ("2026-05-01T07:00:00+02:00", first_s)
    assert found.next == "2026-05-02T07:00:00+02:00"
    model.finish()
    assert model.goal_state("s.1") is GoalState.REACHED
    assert status(model).going_on == ()
    assert replay(map(decode_event, model.journal)) == model.state


def test_each_run_has_as_long_as_was_said() -> None:
    model = fleet()
    first_s = put(model, due_s=model.time_s + 1.0 + 600.0) + HOUR_S
    until(model, first_s)
    assert model.state.goals["s.1"].due_s == first_s + 600.0
    model.finish()
    model.learn("cup_1", "at", "kitchen")
    until(model, first_s + DAY_S)
    assert model.state.goals["s.2"].due_s == first_s + DAY_S + 600.0
    assert replay(map(decode_event, model.journal)) == model.state
    text = "Within 5 minutes, every 2 hours, bring cup 1 to the hallway"
    model.receive(events.GoalPut, goal=Goal(goal="g", text=text, said_at=SIX, said_s=9.0))
    reason = model.state.goal_states["g"].reason
    assert reason is not None and "says when it is due" in reason, "of which run, nobody says"


def test_a_goal_whose_words_say_how_often_is_a_schedule() -> None:
    model = fleet()
    goal = Goal(
        goal="g", text="Every day at 7, bring cup 1 to the hallway", said_at=SIX, said_s=9.0
    )
    model.receive(events.GoalPut, goal=goal)
    found = status(model, "g")
    assert (found.of_goal, found.every, found.next_s) == (True, "0 7 * * *", 9.0 + HOUR_S)
    model.receive(events.GoalDeleted, goal="g")
    assert SCHEDULE_STATUS.build(ScheduleAddress("g")) not in model.documents


@pytest.mark.parametrize(
    ("missed", "runs", "left_out"), [(Missed.ONCE, 1, 3), (Missed.SKIP, 0, 4), (Missed.ALL, 4, 0)]
)
def test_what_nobody_was_there_for_is_done_as_the_schedule_says(
    missed: Missed, runs: int, left_out: int
) -> None:
    model = fleet()
    first_s = put(model, missed=missed, **NOT_NEEDED) + HOUR_S
    model.crash()
    until(model, first_s + 3 * DAY_S + LATE_S + 1.0)
    found = status(model)
    assert (found.runs, found.missed, found.skipped) == (runs, left_out, 0)
    assert found.next_s == first_s + 4 * DAY_S
    model.crash()
    model.receive(events.TimerFired)
    assert status(model).runs == runs, "made up for a second time"
    until(model, first_s + 4 * DAY_S)
    assert status(model).runs == runs + 1


def test_where_every_time_gets_its_run_they_come_one_after_the_other() -> None:
    model = fleet()
    first_s = put(model, missed=Missed.ALL) + HOUR_S
    until(model, first_s + 2 * DAY_S + HOUR_S)
    found = status(model)
    assert (found.going_on, len(found.queued)) == (("s.1",), 2)
    assert found.queued[0] == "2026-05-02T07:00:00+02:00"
    assert model.goal_states["s.1"].note == "it is the run of 07:00"
    model.finish()
    assert status(model).runs == 3
    assert {n: model.goal_state(n) for n in ("s.1", "s.2", "s.3")} == dict.fromkeys(
        ("s.1", "s.2", "s.3"), GoalState.REACHED
    )
    assert status(model).queued == ()


def test_more_runs_than_can_wait_are_missed() -> None:
    model = fleet()
    put(model, "PT1H", missed=Missed.ALL)
    until(model, model.time_s + 200 * HOUR_S)
    found = status(model)
    assert len(found.queued) == MOST_QUEUED
    assert found.runs + len(found.queued) + found.missed + found.skipped == 201


def test_a_time_that_is_late_by_less_than_a_minute_is_no_missed_one() -> None:
    model = fleet()
    first_s = put(model, missed=Missed.SKIP) + HOUR_S
    until(model, first_s + LATE_S)
    assert (status(model).runs, status(model).missed) == (1, 0)


@pytest.mark.parametrize(("overlap", "left_out"), [(Overlap.SKIP, 1), (Overlap.QUEUE, 0)])
def test_a_time_at_which_the_run_before_goes_on_is_left_out_or_waits(
    overlap: Overlap, left_out: int
) -> None:
    model = fleet()
    first_s = put(model, overlap=overlap) + HOUR_S
    until(model, first_s)
    until(model, first_s + DAY_S)
    found = status(model)
    assert (found.runs, found.skipped, len(found.queued)) == (1, left_out, 1 - left_out)
    says = "s.1 still went on at 07:00 on 2026-05-02, so that this time was left out"
    assert found.reason == (says if left_out else None)
    model.finish()
    assert status(model).runs == 2 - left_out
    assert status(model).reason is None


def test_nothing_begins_while_a_schedule_is_paused() -> None:
    model = fleet()
    first_s = put(model, overlap=Overlap.QUEUE) + HOUR_S
    until(model, first_s)
    hold(model, "s")
    found = status(model)
    assert (found.state, found.reason) == (ScheduleState.PAUSED, "it is paused by ana (holidays)")
    model.finish()
    assert model.goal_state("s.1") is GoalState.REACHED, "what goes on does so"
    until(model, first_s + 3 * DAY_S)
    assert status(model).next_s == first_s + 4 * DAY_S
    model.receive(events.HoldDeleted, hold="h")
    found = status(model)
    assert (found.state, found.runs, found.missed, found.reason) == (
        ScheduleState.ACTIVE,
        1,
        0,
        None,
    )
    until(model, first_s + 4 * DAY_S)
    assert status(model).runs == 2


def test_what_stands_by_sees_nothing_while_it_is_paused_and_then_what_holds() -> None:
    model = fleet()
    text = "Whenever cup 1 is in the hallway, bring it to the kitchen"
    model.receive(events.GoalPut, goal=Goal(goal="w", text=text))
    hold(model, "w")
    model.learn("cup_1", "at", "hallway")
    assert model.goal_states["w"].parts == ()
    assert model.goal_states["w"].reason == "it is paused by ana (holidays)"
    model.receive(events.HoldDeleted, hold="h")
    assert model.goal_states["w"].parts == ("w.1",)


def test_a_goal_for_later_that_is_paused_begins_when_it_is_resumed() -> None:
    model = fleet()
    text = "Bring cup 1 to the hallway"
    model.receive(events.GoalPut, goal=Goal(goal="g", text=text, not_before_s=500.0))
    hold(model, "g")
    until(model, 600.0)
    assert model.goal_state("g") is GoalState.PENDING
    model.receive(events.HoldDeleted, hold="h")
    assert model.goal_state("g") is GoalState.RUNNING


def test_a_schedule_that_is_deleted_leaves_its_run() -> None:
    model = fleet()
    first_s = put(model) + HOUR_S
    until(model, first_s)
    model.receive(events.ScheduleDeleted, schedule="s")
    assert list(model.state.goals) == ["s.1"]
    assert SCHEDULE_STATUS.build(ScheduleAddress("s")) not in model.documents
    model.finish()
    assert model.goal_state("s.1") is GoalState.REACHED
    until(model, first_s + DAY_S)
    assert not model.state.goals
    assert not model.state.schedules


def test_in_journals_of_before_a_run_went_with_its_schedule() -> None:
    model = FleetModel((manipulator(),), cups=2, logic=5)
    first_s = put(model) + HOUR_S
    until(model, first_s)
    model.receive(events.ScheduleDeleted, schedule="s")
    assert not model.state.goals


def test_a_schedule_that_is_changed_goes_on_counting() -> None:
    model = fleet()
    first_s = put(model) + HOUR_S
    until(model, first_s)
    known = model.state.schedules["s"]
    later = replace(known, goal=replace(known.goal, every="0 9 * * *"))
    model.receive(events.SchedulePut, schedule=later)
    found = status(model)
    assert (found.going_on, found.runs) == (("s.1",), 1)
    assert found.next_s == first_s + 2 * HOUR_S
    model.finish()
    until(model, first_s + 2 * HOUR_S)
    assert status(model).latest == "s.2"


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"every": None}, "does not say how often"),
        ({"every": "61 7 * * *"}, "neither a line of cron"),
        ({"zone": "Europe/Nowhere"}, "'Europe/Nowhere', the time zone where it was said"),
        ({"text": "Bring cup 9 to the hallway"}, "cup"),
        ({"text": "Bring cup 1 to the hallway. In an hour, bring cup 2 there"}, "several goals"),
    ],
)
def test_what_is_no_schedule_is_rejected_with_a_sentence(more: dict[str, Any], says: str) -> None:
    model = fleet()
    put(model, **more)
    found = status(model)
    assert found.state is ScheduleState.REJECTED
    assert says in (found.reason or "")
    model.receive(events.ScheduleDeleted, schedule="s")
    assert not model.state.goals


def test_the_words_of_a_schedule_can_say_how_often() -> None:
    model = fleet()
    first_s = put(model, None, text="Bring cup 1 to the hallway every day at 7") + HOUR_S
    assert (status(model).every, status(model).next_s) == ("0 7 * * *", first_s)


def test_a_goal_and_a_schedule_do_not_share_a_name() -> None:
    model = fleet()
    model.receive(events.GoalPut, goal=Goal(goal="s", text="Bring cup 2 to the hallway"))
    put(model)
    assert status(model).state is ScheduleState.REJECTED
    assert "there is a goal s already" in (status(model).reason or "")
    assert model.goal_state("s") is GoalState.WAITING
    model.receive(events.GoalDeleted, goal="s")
    assert status(model).state is ScheduleState.ACTIVE


def test_a_planner_without_its_journal_does_no_run_a_second_time() -> None:
    model = fleet()
    first_s = put(model) + HOUR_S
    until(model, first_s)
    model.finish()
    other = fleet()
    other.time_s = first_s + HOUR_S
    other.receive(events.PriorStateLoaded, goals=(model.goal_states["s"],))
    other.receive(events.SchedulePut, schedule=model.state.schedules["s"])
    found = status(other)
    assert (found.next_s, found.runs, found.latest) == (first_s + DAY_S, 1, "s.1")


def test_clocks_are_put_forward_and_back_between_runs() -> None:
    said = datetime(2026, 3, 27, 5, tzinfo=UTC)
    model = fleet()
    model.time_s = said.timestamp() - 1.0
    offsets = offsets_of("Europe/Berlin", said)
    model.receive(events.TimeZoneRead, zone="Europe/Berlin", offsets=offsets)
    put(model, "30 7 * * *", zone="Europe/Berlin", said_at=said.isoformat(), **NOT_NEEDED)
    seen = []
    for _ in range(4):
        found = status(model)
        assert found.next_s is not None
        seen.append(found.next)
        until(model, found.next_s)
    assert seen == [
        "2026-03-27T07:30:00+01:00",
        "2026-03-28T07:30:00+01:00",
        "2026-03-29T07:30:00+02:00",
        "2026-03-30T07:30:00+02:00",
    ]
    model.time_s += 2 * HOUR_S
    # There is summer time no more: what comes next comes when clocks will show it.
    model.receive(events.TimeZoneRead, zone="Europe/Berlin", offsets=((0.0, 3600),))
    assert status(model).next == "2026-03-31T07:30:00+01:00"


def test_a_time_of_tomorrow_is_that_of_clocks_that_are_put_forward_meanwhile() -> None:
    said = datetime(2026, 3, 28, 11, tzinfo=UTC)
    model = fleet()
    offsets = offsets_of("Europe/Berlin", said)
    model.receive(events.TimeZoneRead, zone="Europe/Berlin", offsets=offsets)
    text = "Tomorrow at 7, bring cup 1 to the hallway"
    goal = Goal(goal="g", text=text, said_s=9.0, said_at=said.isoformat(), zone="Europe/Berlin")
    model.receive(events.GoalPut, goal=goal)
    assert model.goal_states["g"].next_s == 9.0 + 18 * HOUR_S
    assert model.goal_states["g"].reason == "it is begun at 07:00 on 2026-03-29"


def test_a_zone_that_becomes_known_is_good_for_what_was_rejected() -> None:
    model = fleet()
    put(model, zone="Europe/Berlin")
    assert status(model).state is ScheduleState.REJECTED
    model.receive(events.TimeZoneRead, zone="Europe/Berlin", offsets=((0.0, 7200),))
    assert status(model).state is ScheduleState.ACTIVE
