"""Time: clocks that are set back, absences by a clock that nobody sets, and who spoke last."""

from __future__ import annotations

from typing import Any

from fleet.core import events
from fleet.core.dispatch.dispatcher import next_timer
from fleet.core.dispatch.lost_robots import lost
from fleet.core.state import LOGIC, State
from fleet.core.step import step
from keyexpr_schema.facts import AT, Value
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.payloads.world import Fact, Statement, StatementStatus
from tests.support.fleet_model import BOTH, FleetModel, fleet
from tests.support.household import bring

KITCHEN = "Cup 1 is in the kitchen."


def where(model: FleetModel, thing: str = "cup_1") -> Value:
    known = model.state.fact(AT, thing)
    return None if known is None else known.value


def seen(place: str, time_s: float, source: str = "hsr") -> Fact:
    return Fact(subject="cup_1", relation=AT, value=place, source=source, time_s=time_s)


def say(model: FleetModel, text: str, said_s: float, name: str = "s") -> None:
    statement = Statement(statement=name, text=text, said_s=said_s)
    model.receive(events.StatementPut, statement=statement)


def hear(model: FleetModel, fact: Fact) -> None:
    """A robot reports what it has seen, by an attempt that is of no other interest."""
    (order, *_) = model.orders()
    model.report(order, ReportState.STARTED, facts=(fact,), started_s=model.time_s)


def test_a_simulation_that_begins_anew_makes_nothing_late() -> None:
    model = fleet()
    model.time_s = 4000.0
    model.plan(*BOTH)
    model.start(model.orders()[0])
    model.time_s = 0.0
    model.finish()
    assert model.state.era == 1
    assert model.state.time_s < 100.0
    assert model.plans["plan-1"].plan.revision == 1
    assert model.goal_state("g2") is GoalState.REACHED


def test_what_runs_when_the_clock_is_set_back_counts_from_there() -> None:
    model = fleet()
    model.time_s = 4000.0
    model.plan(*BOTH)
    model.start(model.orders()[0])
    model.time_s = 0.0
    model.receive(events.TimerFired)
    started = [r.started_s for r in model.plans["plan-1"].records.values()]
    assert 1.0 in started
    assert all(s is None or s < 10.0 for s in started)


def test_answers_of_planning_jobs_from_before_set_no_clock_back() -> None:
    model = FleetModel(tuple(fleet().state.robots.values()), cups=2, late=True)
    model.plan(*BOTH)
    model.time_s += 1000.0
    model.learn("cup_2", AT, "kitchen")
    model.answer()
    assert model.state.era == 0
    assert model.state.time_s > 1000.0


def test_the_newest_word_is_one_of_the_newest_era() -> None:
    model = fleet()
    model.time_s = 4000.0
    model.plan(bring(1, "hallway"))
    hear(model, seen("living_room", 3999.0))
    assert where(model) == "living_room"
    model.time_s = 0.0
    hear(model, seen("kitchen", 1.0))
    assert where(model) == "kitchen"
    # What somebody saw before the clock was set back comes late, on each way.
    late = seen("living_room", 4001.0)
    hear(model, late)
    model.receive(events.FactPut, fact=late)
    assert where(model) == "kitchen"
    hear(model, seen("hallway", 2.0))
    assert where(model) == "hallway"


def test_the_newest_word_holds_on_whatever_way_it_came() -> None:
    model = fleet()
    model.time_s = 100.0
    model.plan(bring(1, "hallway"))
    hear(model, seen("hallway", 90.0))
    model.receive(events.FactPut, fact=seen("kitchen", 80.0))
    assert where(model) == "hallway"
    say(model, KITCHEN, said_s=85.0)
    assert where(model) == "hallway"
    hear(model, seen("living_room", 89.0))
    assert where(model) == "hallway"
    model.receive(events.FactPut, fact=seen("living_room", 91.0))
    assert where(model) == "living_room"
    say(model, KITCHEN, said_s=92.0)
    assert where(model) == "kitchen"
    # Without a time, somebody says it now.
    model.receive(events.FactPut, fact=seen("hallway", 0.0))
    assert where(model) == "hallway"


def test_success_of_long_ago_does_not_overrule_what_was_seen_since() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.succeed(model.orders()[0])
    (pick,) = model.orders()
    model.start(pick)
    ended_s = model.time_s
    model.time_s += 5.0
    model.learn("cup_1", AT, "living_room")
    model.report(pick, ReportState.SUCCEEDED, ended_s=ended_s)
    assert where(model) == "living_room"


def test_the_same_sentence_said_again_is_news() -> None:
    model = fleet()
    model.time_s = 100.0
    say(model, KITCHEN, said_s=100.0)
    model.receive(events.FactPut, fact=seen("hallway", 101.0))
    say(model, KITCHEN, said_s=100.0)
    assert where(model) == "hallway"
    say(model, KITCHEN, said_s=102.0)
    assert where(model) == "kitchen"
    known = model.state.fact(AT, "cup_1")
    assert known is not None
    assert known.time_s == 102.0


def test_a_sentence_that_is_understood_later_is_of_when_it_was_said() -> None:
    model = fleet()
    model.time_s = 100.0
    say(model, "The red cup is in the kitchen.", said_s=100.0)
    model.receive(events.FactPut, fact=seen("hallway", 101.0))
    red = model.state.objects["cup_1"]
    renamed = red.__class__(object="cup_1", kind="cup", label="red cup", ordinal=1)
    model.receive(events.ObjectPut, object=renamed)
    assert model.state.statement_states["s"].facts
    assert where(model) == "hallway"


def without_journal(model: FleetModel) -> State:
    """A planner that starts beside the keys that another one has left."""
    at: dict[str, Any] = {"time_s": 500.0, "wall_time_s": 500.0, "monotonic_s": 1.0}
    state = State()
    left = tuple(d for d in model.documents.values() if isinstance(d, StatementStatus))
    state, _ = step(state, events.PriorStateLoaded(statements=left, **at))
    started = events.PlannerStarted(epoch=2, incarnation="n", logic=LOGIC, lineage="n", **at)
    state, _ = step(state, started)
    for place in model.state.places.values():
        state, _ = step(state, events.PlacePut(place=place, **at))
    for thing in model.state.objects.values():
        state, _ = step(state, events.ObjectPut(object=thing, **at))
    return state


def test_a_planner_without_its_journal_believes_no_old_sentence_anew() -> None:
    at: dict[str, Any] = {"time_s": 501.0, "wall_time_s": 501.0, "monotonic_s": 2.0}
    for said_s in (100.0, 0.0):
        model = fleet()
        model.time_s = 100.0
        say(model, KITCHEN, said_s=said_s)
        told = events.StatementPut(statement=model.state.statements["s"], **at)
        later = events.FactPut(fact=seen("hallway", 150.0), **at)
        for order in ((told, later), (later, told)):
            state = without_journal(model)
            for event in order:
                state, _ = step(state, event)
            known = state.fact(AT, "cup_1")
            assert known is not None
            assert known.value == "hallway"


def test_a_host_clock_that_jumps_loses_no_robot() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    orders = model.orders()

    def at(wall_s: float, monotonic_s: float) -> dict[str, Any]:
        return {"time_s": model.time_s, "wall_time_s": wall_s, "monotonic_s": monotonic_s}

    started = events.PlannerStarted(
        epoch=2, incarnation="b", skills=model.state.skills, logic=LOGIC, **at(2000.0, 50.0)
    )
    model.apply(started)
    model.apply(events.WorkerDisconnected(robot="hsr", incarnation="i1", **at(2001.0, 51.0)))
    assert next_timer(model.state) == 81.0
    model.apply(events.TimerFired(**at(90000.0, 52.0)))
    assert [o.task for o in model.wanted()] == [o.task for o in orders]
    assert not lost(model.state, "hsr")
    model.apply(events.TimerFired(**at(90001.0, 81.0)))
    assert lost(model.state, "hsr")
    assert model.wanted() == []


def test_a_new_run_of_the_planner_waits_anew_for_robots_that_are_away() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.receive(events.WorkerDisconnected, robot="hsr", incarnation="i1")
    at: dict[str, Any] = {"time_s": 5.0, "wall_time_s": 1e6, "monotonic_s": 7.0}
    started = events.PlannerStarted(
        epoch=2, incarnation="b", skills=model.state.skills, logic=LOGIC, **at
    )
    model.apply(started)
    assert not lost(model.state, "hsr")
    assert next_timer(model.state) == 37.0
