"""What goals' sentences say besides what must hold, and what they can mean."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core import events
from keyexpr_schema.facts import AT, LOCATED, FactKey
from keyexpr_schema.payloads.goals import Goal, GoalState, Precedence
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import at, carrier, manipulator


def _told(text: str, **more: object) -> FleetModel:
    model = fleet()
    model.receive(events.GoalPut, goal=Goal(goal="g", text=text, **more))  # type: ignore[arg-type]
    return model


def test_what_must_always_hold_is_in_force_from_the_sentence() -> None:
    model = _told("Bring cup 1 to the hallway and keep cup 2 in the kitchen")
    assert model.goal_states["g"].conditions == (at("cup_1", "hallway"),)
    assert model.state.goals["g"].always == (at("cup_2", "kitchen"),)
    assert "always: cup 2 is in the kitchen" in (model.goal_states["g"].understood or "")
    model.plan()
    assert model.plans["plan-1"].plan.always == (at("cup_2", "kitchen"),)


def test_what_must_never_hold_is_added_to_what_was_put() -> None:
    own = at("cup_2", "hallway")
    text = "Bring cup 1 to the hallway without entering the living room"
    model = _told(text, never=(own,))
    never = model.state.goals["g"].never
    assert never[0] == own
    assert {c.value for c in never[1:]} == {"living_room"}


def test_urgent_words_and_spans_are_priority_and_due_time() -> None:
    model = _told("Bring cup 1 to the hallway within ten minutes, urgently", said_s=5.0)
    goal = model.state.goals["g"]
    assert (goal.priority, goal.due_s) == (1, 605.0)
    told = _told("Bring cup 1 to the hallway urgently", priority=7)
    assert told.state.goals["g"].priority == 7


def test_the_same_goal_put_again_changes_nothing() -> None:
    model = _told("Bring cup 1 to the hallway urgently")
    model.plan()
    before = model.state
    model.receive(events.GoalPut, goal=Goal(goal="g", text="Bring cup 1 to the hallway urgently"))
    assert model.state.goals == before.goals
    assert model.goal_states["g"].plan == "plan-1"


def test_facts_said_in_the_same_breath_are_believed() -> None:
    model = _told("Cup 1 is in the living room. Bring it to the hallway")
    fact = model.state.facts[FactKey(AT, "cup_1")]
    assert (fact.value, fact.source) == ("living_room", "planner:g")
    assert model.goal_states["g"].conditions == (at("cup_1", "hallway"),)


def test_a_sentence_that_can_mean_several_things_asks_which() -> None:
    model = FleetModel((manipulator(), carrier()), cups=2)
    goal = Goal(goal="g", text="Bring the cup to the hallway")
    model.receive(events.GoalPut, goal=goal)
    status = model.goal_states["g"]
    assert status.state is GoalState.REJECTED
    assert len(status.candidates) == 2
    assert all(word in (status.reason or "") for word in ("cup_1", "cup_2"))
    meant = next(words for words in status.candidates if "cup_2" in words)
    model.receive(events.GoalPut, goal=replace(goal, meant=meant))
    status = model.goal_states["g"]
    assert (status.state, status.candidates) == (GoalState.WAITING, ())
    assert status.conditions == (at("cup_2", "hallway"),)
    model.receive(events.GoalPut, goal=replace(goal, meant="something else"))
    assert len(model.goal_states["g"].candidates) == 2


def test_where_something_is_is_a_wish_to_have_it_found() -> None:
    (condition,) = _told("Where is cup 1?").goal_states["g"].conditions
    assert (condition.relation, condition.subject) == (LOCATED, "cup_1")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("How many cups are in the kitchen?", "ask it with `robotctl ask`"),
        ("Cup 1 is in the kitchen", "tell it with `robotctl world add`"),
        ("Bring cup 1 to the hallway every day at 7", "what time it was"),
        ("Every two hours, keep cup 1 in the kitchen", "at what times something is kept"),
    ],
)
def test_what_goals_cannot_be_is_said_in_a_sentence(text: str, says: str) -> None:
    status = _told(text).goal_states["g"]
    assert status.state is GoalState.REJECTED
    assert says in (status.reason or "")


def test_the_order_of_what_was_put_stays_with_what_the_sentence_adds() -> None:
    row = Precedence(first=at("cup_2", "hallway"), then=at("cup_1", "hallway"))
    model = _told("Bring cup 1 to the hallway urgently", sometime_before=(row,))
    assert model.state.goals["g"].sometime_before == (row,)
    model.receive(events.GoalDeleted, goal="g")
    assert "g" not in model.state.goals
    assert "g" not in model.state.goal_specs
