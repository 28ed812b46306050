"""Goals that stand by, and make one each time that something comes to hold."""

from __future__ import annotations

import pytest

from fleet.core import events
from fleet.core.events import decode_event
from fleet.core.step import replay
from keyexpr_schema.payloads.goals import Condition, Goal, GoalState, GoalStatus
from tests.support.fleet_model import FleetModel, fleet
from tests.support.household import at

TEXT = "Bring cup 1 to the hallway"
WHENEVER = (at("cup_2", "living_room"),)


def put(model: FleetModel, text: str = TEXT, name: str = "g", **more: object) -> GoalStatus:
    more = {"whenever": WHENEVER} | more
    goal = Goal(goal=name, text=text, said_s=model.time_s + 1.0, **more)  # type: ignore[arg-type]
    model.receive(events.GoalPut, goal=goal)
    return model.goal_states[name]


def runs(model: FleetModel) -> int:
    return model.goal_states["g"].runs


def test_it_makes_a_goal_each_time_that_it_comes_to_hold_and_not_while_it_does() -> None:
    model = fleet()
    status = put(model)
    assert (status.state, status.parts, status.conditions) == (GoalState.STANDING, (), ())
    for number in (1, 2):
        model.learn("cup_1", "at", "kitchen")
        model.learn("cup_2", "at", "living_room")
        assert model.goal_states["g"].parts == (f"g.{number}",)
        assert model.goal_states[f"g.{number}"].part_of == "g"
        model.finish()
        assert model.goal_state(f"g.{number}") is GoalState.REACHED
        model.learn("cup_1", "at", "kitchen")
        model.learn("cup_2", "at", "living_room")
        assert runs(model) == number, "it held all the time"
        model.learn("cup_2", "at", "kitchen")
    assert model.goal_state("g") is GoalState.STANDING
    assert replay(map(decode_event, model.journal)) == model.state


def test_what_holds_already_is_the_first_time() -> None:
    model = fleet()
    model.learn("cup_2", "at", "living_room")
    assert put(model).parts == ("g.1",)
    assert model.goal_state("g.1") is GoalState.RUNNING, "nobody is there to ask for a plan"


def test_what_nobody_knows_is_no_time() -> None:
    model = fleet()
    model.learn("cup_2", "at", "living_room")
    put(model)
    model.finish()
    model.learn("cup_2", "at", None)
    model.learn("cup_2", "at", "living_room")
    assert runs(model) == 1
    model.learn("cup_2", "at", "hallway")
    model.learn("cup_2", "at", None)
    model.learn("cup_2", "at", "living_room")
    assert runs(model) == 2


def test_a_time_that_comes_while_one_goes_on_is_made_up_for_after_it() -> None:
    model = fleet()
    put(model)
    model.learn("cup_2", "at", "living_room")
    for place in ("kitchen", "living_room", "kitchen", "living_room", "kitchen"):
        model.learn("cup_2", "at", place)
    assert (runs(model), model.goal_states["g"].again) == (1, True)
    model.finish()
    assert [model.goal_state(f"g.{n}") for n in (1, 2)] == [GoalState.REACHED] * 2
    assert (runs(model), model.goal_states["g"].again) == (2, False)


def test_it_is_asked_each_time_if_it_is_wanted_at_all() -> None:
    model = fleet()
    put(model, only_if=(at("cup_1", "kitchen"),))
    model.learn("cup_1", "at", "hallway")
    model.learn("cup_2", "at", "living_room")
    assert model.goal_state("g.1") is GoalState.NOT_NEEDED
    model.learn("cup_1", "at", "kitchen")
    model.learn("cup_2", "at", "kitchen")
    model.learn("cup_2", "at", "living_room")
    model.finish()
    assert model.goal_state("g.2") is GoalState.REACHED


def test_it_stands_by_for_what_is_not_so() -> None:
    model = fleet()
    elsewhere = Condition(relation="at", subject="cup_2", value="kitchen", negated=True)
    assert put(model, whenever=(elsewhere,)).parts == ()
    model.learn("cup_2", "at", "hallway")
    assert model.goal_states["g"].parts == ("g.1",)


def test_it_goes_on_through_a_crash_and_for_a_planner_without_a_journal() -> None:
    model = fleet()
    put(model)
    model.learn("cup_2", "at", "living_room")
    model.finish()
    model.crash()
    assert runs(model) == 1
    spec, status = model.state.goals["g"], model.goal_states["g"]
    other = fleet()
    other.learn("cup_2", "at", "living_room")
    other.receive(events.PriorStateLoaded, goals=(status,))
    other.receive(events.GoalPut, goal=spec)
    assert (runs(other), other.goal_states["g"].parts) == (1, ())
    other.learn("cup_2", "at", "kitchen")
    other.learn("cup_2", "at", "living_room")
    assert runs(other) == 2


def test_who_deletes_it_ends_what_it_has_made() -> None:
    model = fleet()
    put(model)
    model.learn("cup_2", "at", "living_room")
    model.receive(events.GoalDeleted, goal="g")
    model.finish_cancelling()
    model.learn("cup_2", "at", "kitchen")
    model.learn("cup_2", "at", "living_room")
    assert not model.state.goals


@pytest.mark.parametrize(
    ("text", "more", "says"),
    [
        (TEXT, {"every": "PT2H"}, "at what times it is done"),
        (TEXT, {"not_before_s": 10_000.0}, "when it is begun"),
        ("Keep cup 1 in the kitchen", {}, "what is kept is kept all the time"),
        (TEXT, {"whenever": (Condition(relation="fond", subject="hsr", value=True),)}, "'fond'"),
        (TEXT, {"always": (Condition(relation="at", subject="cup_2", value="kitchen",
                                     negated=True),)}, "and not what is not"),
    ],
)  # fmt: skip
def test_what_cannot_be_done_each_time_is_refused(
    text: str, more: dict[str, object], says: str
) -> None:
    status = put(fleet(), text, **more)
    assert status.state is GoalState.REJECTED
    assert says in (status.reason or "")
