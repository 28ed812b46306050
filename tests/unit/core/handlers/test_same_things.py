"""What a goal that waits means stays about the same things while one of them is unknown."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from keyexpr_schema.payloads.goals import Goal, GoalState
from keyexpr_schema.payloads.world import Object
from tests.support.fleet_model import FleetModel
from tests.support.household import cup, manipulator


def numbered_from_zero() -> FleetModel:
    """Cups 0, 1 and 2, of which cup 0 is the first."""
    model = FleetModel((manipulator(),), cups=0)
    for number in range(3):
        model.receive(events.ObjectPut, object=cup_of(number))
        model.learn(f"cup_{number}", "at", "kitchen")
    return model


def cup_of(number: int) -> Object:
    return replace(cup(number), ordinal=number + 1)


def about(model: FleetModel) -> list[str]:
    return [row.subject for row in model.state.goal_states["g"].conditions]


def test_a_goal_does_not_come_to_mean_another_cup_while_its_own_is_unknown() -> None:
    model = numbered_from_zero()
    model.receive(events.GoalPut, goal=Goal(goal="g", text="Bring cup 1 to the hallway"))
    for number in (1, 0):
        model.receive(events.ObjectDeleted, object=f"cup_{number}")
    model.receive(events.ObjectPut, object=cup_of(0))
    assert about(model) == ["cup_1"]
    model.receive(events.ObjectPut, object=cup_of(1))
    assert about(model) == ["cup_1"]


def test_the_cup_stays_the_one_that_was_meant_when_another_comes_while_it_is_unknown() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.receive(events.GoalPut, goal=Goal(goal="g", text="Bring the cup to the hallway"))
    assert about(model) == ["cup_1"]
    model.receive(events.ObjectDeleted, object="cup_1")
    model.receive(events.ObjectPut, object=cup_of(2))
    assert about(model) == ["cup_1"]


def test_cup_1_is_not_the_first_of_cups_0_and_2() -> None:
    model = numbered_from_zero()
    model.receive(events.ObjectDeleted, object="cup_1")
    model.receive(events.GoalPut, goal=Goal(goal="g", text="Bring cup 1 to the hallway"))
    status = model.state.goal_states["g"]
    assert status.state is GoalState.REJECTED and "there is no number 1" in (status.reason or "")
    model.receive(events.ObjectPut, object=cup_of(1))
    assert about(model) == ["cup_1"]


def test_what_comes_is_taken_in_by_a_goal_that_waits() -> None:
    model = numbered_from_zero()
    model.receive(events.GoalPut, goal=Goal(goal="g", text="Bring every cup to the hallway"))
    model.receive(events.ObjectPut, object=cup_of(3))
    assert sorted(about(model)) == ["cup_0", "cup_1", "cup_2", "cup_3"]
