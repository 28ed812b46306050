"""The planner's core as a whole: missions, crashes, and events that mean nothing."""

from __future__ import annotations

import pytest

from fleet.core import events
from fleet.core.effects import MakePlan, Publish
from fleet.core.state import State
from fleet.core.step import step
from keyexpr_schema.keyspace import FACT, PLACE, PLAN_STATUS
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.tasks import ReportState
from keyexpr_schema.payloads.world import Fact
from tests.support.fleet_model import BOTH, fleet
from tests.support.household import bring


def test_a_mission_from_goals_to_reached() -> None:
    model = fleet()
    model.plan(*BOTH)
    assert {order.robot for order in model.orders()} == {"hsr", "locobot"}
    model.finish()
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED
    assert [model.goal_state(g) for g in ("g1", "g2")] == [GoalState.REACHED] * 2
    assert model.replies["r0"].accepted


def test_a_goal_is_reached_as_soon_as_it_is_and_not_when_the_plan_ends() -> None:
    model = fleet()
    model.plan(*BOTH)
    while model.goal_state("g2") is not GoalState.REACHED:
        model.succeed(model.orders()[-1])
    assert model.plans["plan-1"].state is PlanState.RUNNING


def test_a_crash_of_the_planner_changes_nothing_but_the_epoch_of_orders() -> None:
    model = fleet()
    model.plan(*BOTH)
    before = model.orders()
    model.crash()
    after = model.orders()
    assert [(o.task, o.attempt) for o in before] == [(o.task, o.attempt) for o in after]
    assert {order.epoch for order in after} == {2}
    model.finish()
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED


def test_a_planner_without_a_journal_does_nothing_a_second_time() -> None:
    model = fleet()
    model.plan(*BOTH)
    model.finish()
    fresh = State()
    remembered = events.PriorStateLoaded(
        time_s=0.0, wall_time_s=0.0,
        answers=tuple(model.replies.values()),
        goals=tuple(model.goal_states.values()),
        plans=("plan-1",),
    )  # fmt: skip
    fresh, _ = step(fresh, remembered)
    for line in model.journal:
        event = events.decode_event(line)
        if isinstance(event, events.PlanRequested | events.GoalPut):
            fresh, effects = step(fresh, event)
            assert not any(isinstance(effect, MakePlan) for effect in effects)
    proposed = events.PlanProposed(plan=model.plans["plan-1"].plan, time_s=0.0, wall_time_s=0.0)
    fresh, effects = step(fresh, proposed)
    assert effects == ()
    assert fresh.goal_states["g1"].state is GoalState.REACHED


def test_an_event_without_meaning_changes_nothing() -> None:
    model = fleet()
    state, effects = step(model.state, events.GoalDeleted(goal="x", time_s=1e9, wall_time_s=1e12))
    assert state is model.state
    assert effects == ()


def test_only_documents_of_the_planner_are_published() -> None:
    model = fleet()
    model.plan(*BOTH)
    model.finish()
    kinds = {effect.key.name for effect in model.effects if isinstance(effect, Publish)}
    assert PLAN_STATUS.name in kinds
    assert PLACE.name not in kinds


@pytest.mark.parametrize("name", ["planner", "planner_bot", "planner:s1"])
def test_what_somebody_says_whose_name_begins_like_the_planners_is_not_the_planners(
    name: str,
) -> None:
    model = fleet()
    said = Fact(subject="cup_1", relation="at", value="hallway", source=name, time_s=9.0)
    model.receive(events.FactPut, fact=said)
    assert model.state.fact("at", "cup_1") == said
    assert not [e for e in model.effects if isinstance(e, Publish) and e.key is FACT]


def test_what_the_planner_concludes_it_publishes() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    (order,) = model.orders()
    model.report(order, ReportState.SUCCEEDED, ended_s=9.0)  # and no word of what is so now
    (fact,) = [e.payload for e in model.effects if isinstance(e, Publish) and e.key is FACT]
    assert (fact.relation, fact.subject, fact.value) == ("at", "hsr", "kitchen")
