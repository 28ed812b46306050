"""What a goal's sentence says besides what must hold: it is told, or believed, and never lost."""

from __future__ import annotations

from fleet.core import events
from keyexpr_schema.payloads.goals import Goal, GoalState, GoalStatus
from keyexpr_schema.payloads.world import Statement
from tests.support.fleet_model import FleetModel
from tests.support.household import manipulator


def say(model: FleetModel, text: str) -> GoalStatus:
    number = len(model.state.goals) + 1
    model.receive(events.GoalPut, goal=Goal(goal=f"g{number}", text=text, ordinal=number))
    return model.goal_states[f"g{number}"]


def test_a_remark_is_told_to_ask_for_nothing() -> None:
    status = say(FleetModel((manipulator(),), 1), "I am tired. Bring cup 1 to the hallway")
    assert status.state is GoalState.WAITING
    assert status.note == "'I am tired' asks for nothing"
    assert say(FleetModel((manipulator(),), 1), "Bring cup 1 to the hallway").note is None


def test_what_a_goal_presumes_is_believed_where_nothing_is_known() -> None:
    model = FleetModel((manipulator(),), 1)
    model.learn("cup_1", "at", None)
    status = say(model, "Bring cup 1 from the living room to the hallway")
    fact = model.state.fact("at", "cup_1")
    assert fact is not None
    assert (fact.value, fact.source) == ("living_room", "planner:g1")
    assert status.note is None


def test_what_a_goal_presumes_against_belief_is_told_and_not_believed() -> None:
    model = FleetModel((manipulator(),), 1)
    status = say(model, "Bring cup 1 from the living room to the hallway")
    assert status.note == (
        "it takes for granted that cup 1 is in the living room; "
        "believed is that cup 1 is in the kitchen"
    )
    fact = model.state.fact("at", "cup_1")
    assert fact is not None and fact.value == "kitchen"


def test_what_a_thing_lies_on_is_forgotten_once_it_is_elsewhere() -> None:
    model = FleetModel((manipulator(),), 1)
    model.receive(
        events.StatementPut,
        statement=Statement(statement="s1", text="Cup 1 is in the kitchen"),
    )
    model.learn("cup_1", "on", "floor")
    assert model.state.vocabulary().rests == {"cup_1": "floor"}
    model.learn("cup_1", "at", "hsr")
    assert model.state.vocabulary().rests == {}
