"""Events as lines of a journal, of this version and of earlier ones."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from fleet.core import events
from fleet.core.events import Event, decode_event, encode_event
from keyexpr_schema.payloads.goals import Goal
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.requests import (
    Control,
    ControlRequest,
    PlanRequest,
    ReplanRequest,
)
from keyexpr_schema.payloads.tasks import Report, ReportState
from keyexpr_schema.payloads.world import Fact, Object, Place, Statement
from tests.support.household import carrier

AT = {"time_s": 1.5, "wall_time_s": 2.5}
PLAN = Plan(plan="p", goals=("g",), conditions=(), tasks=())
REPORT = Report(
    robot="r", plan="p", revision=1, task="t1", attempt=1, epoch=1, incarnation="i",
    state=ReportState.STARTED,
)  # fmt: skip
OLD_TAGS: dict[str, tuple[type[Event], dict[str, Any]]] = {
    "GoalTold": (events.GoalPut, {"goal": Goal(goal="g", text="rest")}),
    "GoalForgotten": (events.GoalDeleted, {"goal": "g"}),
    "FactTold": (
        events.FactPut,
        {"fact": Fact(subject="c", relation="at", value="k", source="s", time_s=1.0)},
    ),
    "FactForgotten": (events.FactDeleted, {"subject": "c", "relation": "at"}),
    "StatementTold": (events.StatementPut, {"statement": Statement(statement="s", text="so")}),
    "StatementForgotten": (events.StatementDeleted, {"statement": "s"}),
    "PlaceTold": (events.PlacePut, {"place": Place(place="k", label="K")}),
    "PlaceForgotten": (events.PlaceDeleted, {"place": "k"}),
    "ObjectTold": (events.ObjectPut, {"object": Object(object="c", kind="cup", label="C")}),
    "ObjectForgotten": (events.ObjectDeleted, {"object": "c"}),
    "RobotTold": (events.RobotRegistered, {"spec": carrier("r")}),
    "RobotForgotten": (events.RobotUnregistered, {"robot": "r"}),
    "RobotSeen": (events.WorkerConnected, {"robot": "r", "incarnation": "i"}),
    "RobotGone": (events.WorkerDisconnected, {"robot": "r", "incarnation": "i"}),
    "ReportTold": (events.ReportReceived, {"report": REPORT}),
    "PlanAsked": (events.PlanRequested, {"request": PlanRequest(request="q", goals=("g",))}),
    "ReplanAsked": (
        events.ReplanRequested,
        {"request": ReplanRequest(request="q", plan="p", reason="so")},
    ),
    "ControlAsked": (
        events.ControlRequested,
        {"request": ControlRequest(request="q", control=Control.START, plan="p")},
    ),
    "PlanMade": (
        events.PlanningSucceeded,
        {
            "job": 1,
            "plan": PLAN,
            "allocation": {"a": "r"},
            "sequence": {"r": ("a",)},
            "extra_after": {},
            "durations_s": {"t1": 2.0},
            "predicted_makespan_s": 3.0,
            "planning_time_s": 0.5,
        },
    ),
    "PlanNotMade": (events.PlanningFailed, {"job": 1, "reason": "so"}),
    "Remembered": (events.PriorStateLoaded, {"plans": ("p",)}),
    "TimePassed": (events.TimerFired, {}),
}
"""What each event was called once, and an example of it."""
UNCHANGED = {
    *("PlannerStarted", "EpochRaised", "PlanProposed", "GoalInterpreted"),
    *("HoldPut", "HoldDeleted", "ClosurePut", "ClosureDeleted"),
    *("SchedulePut", "ScheduleDeleted", "TimeZoneRead"),
    *("StopPut", "StopDeleted", "StopReleased", "StopReleaseDeleted"),
}


@pytest.mark.parametrize("old", OLD_TAGS)
def test_an_old_tag_decodes_as_what_it_is_called_now(old: str) -> None:
    kind, fields = OLD_TAGS[old]
    event = kind(**AT, **fields)
    line = encode_event(event)
    new_tag = f'{{"event":"{kind.__name__}"'.encode()
    assert line.startswith(new_tag)
    assert decode_event(line) == event
    assert decode_event(line.replace(new_tag, f'{{"event":"{old}"'.encode(), 1)) == event


def test_every_event_has_an_old_tag_or_never_had_another() -> None:
    renamed = {kind.__name__ for kind, _ in OLD_TAGS.values()}
    every = {kind.__name__ for kind in Event.__subclasses__()}
    assert every == renamed | UNCHANGED
    assert not renamed & UNCHANGED


def test_an_old_tag_elsewhere_in_a_line_is_left_alone() -> None:
    event = events.GoalPut(**AT, goal=Goal(goal="g", text='say {"event":"GoalTold"'))
    assert decode_event(encode_event(event)) == event


@pytest.mark.parametrize("line", [b"", b"{}", b'{"event":"GoalSung"}', b'{"event":"GoalTold"}'])
def test_what_is_no_event_is_refused(line: bytes) -> None:
    with pytest.raises(msgspec.DecodeError):
        decode_event(line)
