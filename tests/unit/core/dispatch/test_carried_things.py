"""What is on or in something that moves concerns the plans that are about it."""

from __future__ import annotations

from msgspec.structs import replace

from fleet.core import events
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.goals import GoalState
from keyexpr_schema.payloads.world import Fact, Object, Statement
from tests.support.fleet_model import FleetModel
from tests.support.household import bring, carrier, manipulator

TRAY = Object(object="tray", kind="tray", label="tray", features=("supports",))
CUPBOARD = Object(
    object="cupboard", kind="cupboard", label="cupboard", features=("contains", "openable"),
    movable=False, home="kitchen",
)  # fmt: skip


def with_tray() -> FleetModel:
    """A cup on a tray in the kitchen, and robots that can do all there is."""
    able = ("navigate", "search", "pick", "place", "place_on_robot", "open", "look_into")
    model = FleetModel((replace(manipulator(), skills=able), carrier()), cups=1)
    for thing in (TRAY, CUPBOARD):
        model.receive(events.ObjectPut, object=thing)
    model.learn("tray", "at", "kitchen")
    model.learn("cup_1", "on", "tray")
    return model


def believed(model: FleetModel, name: str) -> object:
    return model.state.facts[FactKey(AT, name)].value


def test_what_is_on_a_thing_is_said_of_where_it_is() -> None:
    model = with_tray()
    assert believed(model, "cup_1") == "tray"
    assert FactKey("on", "cup_1") not in model.state.facts
    assert model.state.vocabulary().whereabouts["cup_1"] == "kitchen"
    assert model.state.vocabulary().rests["cup_1"] == "tray"
    model.learn("cup_1", "at", "hallway")
    assert believed(model, "cup_1") == "hallway"


def test_what_is_said_of_a_thing_before_it_is_known_counts_when_it_is() -> None:
    model = FleetModel((manipulator(),), cups=1)
    model.learn("cup_1", "on", "tray")
    assert believed(model, "cup_1") == "kitchen"
    model.receive(events.ObjectPut, object=TRAY)
    assert believed(model, "cup_1") == "tray"


def test_of_two_words_of_one_moment_the_finer_one_holds() -> None:
    model = with_tray()
    for relation, value in (("on", "tray"), ("at", "kitchen")):
        fact = Fact(subject="cup_1", relation=relation, value=value, source="hsr", time_s=99.0)
        model.receive(events.FactPut, fact=fact)
    assert believed(model, "cup_1") == "tray"
    fact = Fact(subject="cup_1", relation="at", value="kitchen", source="hsr", time_s=100.0)
    model.receive(events.FactPut, fact=fact)
    assert believed(model, "cup_1") == "kitchen"


def test_nothing_comes_to_be_in_itself() -> None:
    model = with_tray()
    model.learn("tray", "in", "cupboard")
    model.learn("cupboard", "on", "tray")
    assert believed(model, "cupboard") == "tray"
    assert believed(model, "tray") is None, "said before that it would be in what is on it"
    model.learn("tray", "on", "tray")
    assert believed(model, "tray") is None
    assert believed(model, "cup_1") == "tray"


def test_a_statement_that_says_less_does_not_make_it_less_known() -> None:
    model = with_tray()
    statement = Statement(statement="s", text="The cup 1 is in the kitchen", said_s=200.0)
    model.receive(events.StatementPut, statement=statement)
    assert believed(model, "cup_1") == "tray"
    statement = Statement(statement="s", text="The cup 1 is in the hallway", said_s=201.0)
    model.receive(events.StatementPut, statement=statement)
    assert believed(model, "cup_1") == "hallway"


def test_a_tray_that_was_moved_takes_the_plan_for_what_is_on_it_along() -> None:
    model = with_tray()
    model.plan(bring(1, "hallway"))
    assert [order.skill for order in model.orders()] == ["navigate"]
    model.learn("tray", "at", "living_room")
    assert model.plans["plan-1"].plan.revision == 2, "the cup is no longer where it is to be taken"
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert believed(model, "cup_1") == "hallway"


def test_a_tray_that_was_brought_there_brings_what_is_on_it() -> None:
    model = with_tray()
    model.plan(bring(1, "hallway"))
    model.learn("tray", "at", "hallway")
    model.finish()
    assert model.goal_state("g1") is GoalState.REACHED
    assert believed(model, "cup_1") == "tray"


def test_what_is_in_no_place_is_looked_for_in_what_is_closed() -> None:
    model = with_tray()
    model.learn("cup_1", "at", None)
    model.plan(bring(1, "hallway"))
    seen = []
    for _ in range(40):
        if not (orders := model.wanted()):
            break
        order = orders[0]
        seen.append(order.skill)
        if order.skill == "look_into":
            model.learn("cup_1", "at", "cupboard")
        model.succeed(order)
    assert seen.index("look_into") > max(i for i, skill in enumerate(seen) if skill == "search")
    assert "open" in seen
    assert model.goal_state("g1") is GoalState.REACHED
