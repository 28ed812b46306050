"""Programs of sentences with "if", with what is kept on the way: written, and run in rehearsal."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core import events
from fleet.core.model.programs import program_model
from fleet.core.model.world import WorldModel
from fleet.core.sentences import program_for
from fleet.errors import NotUnderstood
from fleet.jobshop.time_budget import TimeBudget
from fleet.planners import NoPlan, SymbolicPlanner
from fleet.planners.programs.rehearsal import Rehearsed, rehearse
from fleet.planners.programs.writer import write_program
from keyexpr_schema.facts import AT, FactKey
from keyexpr_schema.payloads.plans import PlanState
from keyexpr_schema.payloads.programs import Program
from keyexpr_schema.payloads.requests import Control, ControlRequest
from tests.support.fleet_model import fleet
from tests.support.household import at, bring, fact, home

FIND = "look for cup 1; if you find it bring it to the living room"
IF = "if cup 2 is in the kitchen, bring cup 1 to the living room"
BOTH = "Bring cup 1 to the living room. If cup 2 is in the kitchen, bring cup 2 to the hallway"
WORLD = home(cups=2)
LOST = home(cups=2, facts=(fact("cup_1", "at", None),))
MOVED = home(cups=2, facts=(fact("cup_2", "at", "hallway"),))


def program(text: str, world: WorldModel, robot: str = "hsr") -> Program:
    asked, _ = program_for(text, fleet().state.vocabulary(), robot)
    made = write_program(asked, world, robot, SymbolicPlanner(), TimeBudget(60.0))
    assert not isinstance(made, NoPlan), made.reason
    return made


def ends(made: Program, world: WorldModel, *wanted: object) -> Rehearsed | str:
    """What comes of it when it is run in this world: whether this holds then."""
    return rehearse(replace(made, stages=(wanted,), parts=()), world, "hsr")  # type: ignore[arg-type]


def test_what_is_asked_is_asked_when_the_program_runs() -> None:
    made = program(IF, WORLD)
    assert made.code.startswith(f'# {IF}\nif ask("at", "cup_2") == "kitchen":\n    navigate(')
    assert made.stages == ()
    assert isinstance(ends(made, WORLD, at("cup_1", "living_room")), Rehearsed)
    assert isinstance(ends(made, MOVED, at("cup_1", "kitchen")), Rehearsed)


def test_it_is_planned_for_what_is_not_so_yet() -> None:
    made = program(IF, MOVED)
    assert isinstance(ends(made, WORLD, at("cup_1", "living_room")), Rehearsed)
    assert isinstance(ends(made, MOVED, at("cup_1", "kitchen")), Rehearsed)


def test_what_is_done_in_any_case_must_hold_in_the_end() -> None:
    made = program(BOTH, WORLD)
    assert made.stages == ((at("cup_1", "living_room"),),)
    both = (at("cup_1", "living_room"), at("cup_2", "hallway"))
    assert isinstance(ends(made, WORLD, *both), Rehearsed)
    assert isinstance(ends(made, MOVED, *both), Rehearsed)
    model = program_model(made, WORLD.skills)
    assert model is not None
    after = dict(model.after)
    assert after[FactKey(AT, "cup_1")] == "living_room"
    assert after[FactKey(AT, "cup_2")] is None


def test_what_is_found_is_brought_and_what_is_not_is_no_failure() -> None:
    made = program(FIND, LOST)
    assert "found is None:\n    pass\n" in made.code
    assert "fail(" not in made.code
    assert isinstance(ends(made, LOST, at("cup_1", "living_room")), Rehearsed)
    known = program(FIND, WORLD)
    assert "search" not in known.code.partition("except")[0]
    assert isinstance(ends(known, WORLD, at("cup_1", "living_room")), Rehearsed)


def test_what_is_never_to_be_is_not_on_the_way() -> None:
    text = "bring cup 1 to the living room without entering the hallway"
    asked, _ = program_for(text, fleet().state.vocabulary(), "hsr")
    assert at("hsr", "hallway") in asked.never
    robot_there = replace(asked, never=(at("hsr", "living_room"),))
    made = write_program(robot_there, WORLD, "hsr", SymbolicPlanner(), TimeBudget(60.0))
    assert isinstance(made, NoPlan)
    assert "at(hsr) = living_room must never hold" in made.reason


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("when cup 2 is in the kitchen, bring cup 1 to the hallway", "give it as a goal"),
        ("bring cup 1 to the hallway in ten minutes", "is for later"),
        ("every two hours, bring cup 1 to the hallway", "again and again"),
        ("the locobot shall bring cup 1 to the hallway", "a task is for one robot: hsr"),
        ("keep cup 1 in the kitchen", "only what to keep"),
        ("where is cup 1?", "a question"),
        ("cup 1 is in the kitchen", "says what holds"),
    ],
)
def test_what_is_nothing_for_a_program_is_refused(text: str, says: str) -> None:
    with pytest.raises(NotUnderstood, match=says):
        program_for(text, fleet().state.vocabulary(), "hsr")


def test_the_robot_that_a_sentence_names_runs_it() -> None:
    _, robot = program_for("HSR, bring cup 1 to the hallway", fleet().state.vocabulary(), None)
    assert robot == "hsr"


def test_such_a_task_is_ordered_and_its_plan_ends() -> None:
    model = fleet()
    model.plan(bring(1, "hallway"))
    model.learn("cup_2", "at", None)
    text = "look for cup 2; if you find it bring it to the living room"
    request = ControlRequest(
        request="c", control=Control.ADD_TASK, plan="plan-1", skill="do",
        args={"robot": "hsr", "text": text},
    )  # fmt: skip
    model.receive(events.ControlRequested, request=request)
    assert model.replies["c"].accepted, model.replies["c"].sentence
    while not any(order.program for order in model.orders()):
        model.succeed(model.wanted()[0])
    order = next(order for order in model.orders() if order.program)
    assert order.program is not None
    assert len(order.program.parts) == 2
    model.finish()
    assert model.plans["plan-1"].state is PlanState.SUCCEEDED


EITHER = "If cup 2 is in the kitchen, bring it to the hallway. Otherwise bring it to the kitchen."


def test_what_is_done_otherwise_is_not_done_after_the_other() -> None:
    for world, place in ((WORLD, "hallway"), (MOVED, "kitchen")):
        for planned_in in (WORLD, MOVED):
            made = program(EITHER, planned_in)
            assert made.stages == ()
            assert isinstance(ends(made, world, at("cup_2", place)), Rehearsed)


def test_what_is_not_so_is_asked_by_a_program() -> None:
    made = program("If cup 2 is not in the kitchen, bring cup 1 to the living room", WORLD)
    assert 'if not (ask("at", "cup_2") == "kitchen"):' in made.code
    assert isinstance(ends(made, WORLD, at("cup_1", "kitchen")), Rehearsed)
    assert isinstance(ends(made, MOVED, at("cup_1", "living_room")), Rehearsed)


def test_what_is_done_where_nothing_is_found() -> None:
    made = program(f"{FIND}; otherwise bring cup 2 to the hallway", LOST)
    assert isinstance(ends(made, LOST, at("cup_1", "living_room")), Rehearsed)
    assert made.code.count("cup_2") > 0
    words = fleet().state.vocabulary()
    with pytest.raises(NotUnderstood, match=r"say .look for"):
        program_for("If you find cup 1, bring it to the hallway; otherwise bring cup 2 to the "
                    "hallway", words, "hsr")  # fmt: skip
    with pytest.raises(NotUnderstood, match="is for each time"):
        program_for("Whenever cup 2 is in the kitchen, bring it to the hallway", words, "hsr")
