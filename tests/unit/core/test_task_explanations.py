"""What a task that goals can name would mean, and what becomes of goals that call one."""

from __future__ import annotations

import msgspec

from fleet.core import events
from fleet.core.events import decode_event, encode_event
from fleet.core.named_tasks import tasks_known
from fleet.core.state import LOGIC, Policy
from fleet.language.methods.task_file import tasks_from_data
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.methods import TasksQuery, TasksReply
from tests.support.fleet_model import FleetModel, fleet

TASKS = tasks_from_data(
    {
        "tasks": {
            "round": {
                "about": "Cups where people are.",
                "says": "do the round to {place: place}",
                "methods": [
                    {"needs": "9 cup", "do": "bring all cups to {place}"},
                    {"do": "bring the first cup to {place}"},
                ],
            },
            "a_cup": {"says": "get a cup out", "do": "bring the cup to the hallway"},
            "unicorns": {"says": "feed the unicorns", "do": "find the unicorn"},
            "later": {"says": "do it later", "do": "keep the first cup in the kitchen"},
        }
    },
    "mine.yaml",
)


def taught() -> FleetModel:
    model = fleet()
    model.receive(
        events.PlannerStarted,
        epoch=9,
        incarnation="taught",
        policy=Policy(tasks=TASKS),
        skills=model.state.skills,
        logic=LOGIC,
    )
    return model


def explained(text: str) -> TasksReply:
    return tasks_known(taught().state, TasksQuery(text=text))


def test_every_task_is_told_with_its_phrases() -> None:
    first, *_ = tasks_known(taught().state, TasksQuery()).tasks
    assert (first.task, first.says, first.methods, first.file) == (
        "round",
        ("do the round to {place: place}",),
        2,
        "mine.yaml",
    )


def test_what_is_no_task_points_to_those_there_are() -> None:
    said = "'foo' is not understood as a task: `robotctl tasks` lists the tasks that have a name"
    assert explained("foo").reason == said


def test_what_it_would_mean_is_told_with_the_methods_gone_through() -> None:
    reply = explained("Do the round to the hallway, then bring the second cup to the kitchen")
    (called,) = reply.called
    assert called.said == "Do the round to the hallway"
    assert [(m.taken, m.reason) for m in called.methods] == [
        (False, "it takes 9 cups, and there are only 2"),
        (True, None),
    ]
    assert [[str(c) for c in stage] for stage in reply.stages] == [
        ["at(cup_1) = hallway"],
        ["at(cup_2) = kitchen"],
    ]
    assert reply.reason is None


def test_why_it_means_nothing_here_is_told_method_by_method() -> None:
    reply = explained("feed the unicorns")
    (called,) = reply.called
    (method,) = called.methods
    assert not method.taken
    assert "'the unicorn' is not a known object" in (method.reason or "")
    assert (reply.understood, reply.stages) == (None, ())
    assert explained("zorgle").called == ()


def test_what_it_leaves_open_is_told_with_all_that_it_can_mean() -> None:
    reply = explained("get a cup out")
    assert len(reply.candidates) == 2
    assert [call.task for call in reply.called] == ["a_cup"]
    assert "cup_1" in (reply.reason or "")


def test_nothing_comes_to_be_by_explaining() -> None:
    model = taught()
    before = model.state
    tasks_known(model.state, TasksQuery(text="do the round to the hallway"))
    assert model.state == before
    assert not model.goal_states


def test_a_goal_says_what_its_task_was_taken_for() -> None:
    model = taught()
    model.receive(events.GoalPut, goal=Goal(goal="g", text="do the round to the hallway"))
    status = model.goal_states["g"]
    assert status.state is GoalState.WAITING
    assert [str(c) for c in status.conditions] == ["at(cup_1) = hallway"]
    assert status.note == (
        "'do the round to the hallway' is taken for: bring the first cup to the hallway."
    )


def test_a_journal_brings_the_tasks_along() -> None:
    started = events.PlannerStarted(
        time_s=1.0, wall_time_s=1.0, epoch=1, incarnation="a", policy=Policy(tasks=TASKS)
    )
    assert decode_event(encode_event(started)) == started
    assert msgspec.json.decode(b"{}", type=Policy).tasks == ()
