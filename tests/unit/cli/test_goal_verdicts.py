"""The judge: goals against the truth."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from cli.demo.verdict import GoalVerdict, Verdict, all_agreed, concerned, goal_verdicts
from keyexpr_schema.payloads.goals import Condition, GoalState, GoalStatus
from keyexpr_schema.payloads.simulation import Truth
from keyexpr_schema.payloads.world import Object


def status(
    state: GoalState = GoalState.REACHED, relation: str = "at", subject: str = "cup_1"
) -> GoalStatus:
    return GoalStatus(
        goal="g",
        state=state,
        conditions=(Condition(relation=relation, subject=subject, value="hallway"),),
        reason=None if state is GoalState.REACHED else "the cup is gone",
    )


def truth(
    place: str | None = "hallway",
    support: str | None = "hallway_table",
    held_by: str | None = None,
    settled: bool = True,
) -> Truth:
    return Truth(
        object="cup_1",
        kind="cup",
        time_s=1.0,
        point_m=(5.0, 5.6, 0.6),
        place=place,
        support=support,
        held_by=held_by,
        settled=settled,
    )


def verdict(goal: GoalStatus, found: Truth | None, robots: dict[str, str | None]) -> GoalVerdict:
    (only,) = goal_verdicts({"g": goal}, {"cup_1": found} if found else {}, robots)
    return only


@pytest.mark.parametrize("support", ["hallway_table", "floor", "locobot"])
def test_an_object_that_lies_in_the_place_is_there_whatever_it_lies_on(support: str) -> None:
    found = verdict(status(), truth(support=support), {})
    assert found.physics is Verdict.HOLDS
    assert found.agreed
    assert found.sentence == f"cup_1 lies in hallway on {support}"


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (truth(place="kitchen", support="kitchen_table"), "lies in kitchen on kitchen_table, not"),
        (truth(held_by="hsr", support=None), "still in the hand of hsr"),
        (truth(settled=False), "has not come to rest"),
        (truth(place=None, support="floor"), "in no known place"),
    ],
)
def test_physics_overrules_a_planner_that_says_reached(found: Truth, words: str) -> None:
    said = verdict(status(), found, {})
    assert said.physics is Verdict.FAILS
    assert not said.agreed
    assert words in said.sentence
    assert "but the planner says it is reached" in said.sentence


def test_a_goal_that_holds_but_was_given_up_is_not_agreed() -> None:
    said = verdict(status(GoalState.FAILED), truth(), {})
    assert said.physics is Verdict.HOLDS
    assert not said.agreed
    assert "the planner says failed: the cup is gone" in said.sentence


def test_a_robot_stands_where_its_senses_say() -> None:
    goal = status(subject="hsr")
    assert verdict(goal, None, {"hsr": "hallway"}).agreed
    elsewhere = verdict(goal, None, {"hsr": "kitchen"})
    assert elsewhere.sentence.startswith("hsr stands in kitchen, not in hallway")
    assert not elsewhere.agreed


@pytest.mark.parametrize(
    "goal",
    [
        status(relation="clean"),
        status(subject="ghost"),
        GoalStatus(goal="g", state=GoalState.REACHED),
    ],
)
def test_what_physics_cannot_see_is_never_agreed(goal: GoalStatus) -> None:
    said = verdict(goal, truth(), {})
    assert said.physics is Verdict.NOT_JUDGED
    assert not said.agreed


def test_one_failing_condition_fails_the_goal() -> None:
    goal = GoalStatus(
        goal="g",
        state=GoalState.REACHED,
        conditions=(
            Condition(relation="at", subject="cup_1", value="hallway"),
            Condition(relation="at", subject="hsr", value="hallway"),
        ),
    )
    assert verdict(goal, truth(), {"hsr": "hallway"}).agreed
    assert verdict(goal, truth(), {"hsr": None}).physics is Verdict.FAILS


def test_no_goals_is_no_success() -> None:
    assert not all_agreed(())
    assert all_agreed(goal_verdicts({"g": status()}, {"cup_1": truth()}, {}))


def derived(relation: str, value: bool = True, *subjects: str) -> GoalStatus:
    condition = Condition(
        relation=relation, subject=(subjects or ("cup_1",))[0], value=value, any_of=subjects
    )
    return GoalStatus(goal="g", state=GoalState.REACHED, conditions=(condition,))


def test_one_subject_of_several_is_enough() -> None:
    goal = GoalStatus(
        goal="g",
        state=GoalState.REACHED,
        conditions=(
            Condition(
                relation="at", subject="cup_2", value="hallway", any_of=("cup_2", "cup_1", "ghost")
            ),
        ),
    )
    truths = {"cup_1": truth(), "cup_2": truth("kitchen")}
    (found,) = goal_verdicts({"g": goal}, truths, {})
    assert found.agreed
    assert found.sentence == "cup_1 lies in hallway on hallway_table"
    (nowhere,) = goal_verdicts(
        {"g": goal}, {"cup_1": truth("kitchen"), "cup_2": truth("kitchen")}, {}
    )
    assert nowhere.physics is Verdict.NOT_JUDGED  # nobody sees the ghost


@pytest.mark.parametrize(
    ("held_by", "wanted", "agreed"),
    [("hsr", True, True), (None, True, False), (None, False, True), ("hsr", False, False)],
)
def test_the_physics_sees_hands(held_by: str | None, wanted: bool, agreed: bool) -> None:
    said = verdict(derived("held", wanted), truth(held_by=held_by), {})
    assert said.agreed is agreed


@pytest.mark.parametrize(
    ("told", "agreed"), [("hallway", True), ("kitchen", False), (None, False), ("hsr", True)]
)
def test_what_is_found_is_where_the_fleet_says(told: str | None, agreed: bool) -> None:
    (said,) = goal_verdicts(
        {"g": derived("located")}, {"cup_1": truth()}, {"hsr": "hallway"}, {"cup_1": told}
    )
    assert said.agreed is agreed
    assert said.physics is not Verdict.NOT_JUDGED


def thing(name: str, part_of: str | None = None) -> Object:
    return Object(object=name, kind="thing", label=name, movable=False, part_of=part_of)


@pytest.mark.parametrize(
    ("relation", "value", "holds"),
    [
        ("at", "bowl", True),
        ("in", "bowl", True),
        ("on", "shelf", True),
        ("on", "table", False),
        ("at", "hallway", True),
        ("temperature", "hot", True),
        ("temperature", "cold", False),
    ],
)
def test_what_carries_a_thing_and_how_it_is_are_judged(
    relation: str, value: str, holds: bool
) -> None:
    truths = {
        "cup_1": replace(truth(support="bowl"), states={"temperature": "hot"}),
        "bowl": replace(truth(support="board"), object="bowl"),
    }
    objects = {name: thing(name) for name in ("bowl", "shelf", "table")}
    objects["board"] = thing("board", part_of="shelf")
    goal = GoalStatus(
        goal="g",
        state=GoalState.REACHED,
        conditions=(Condition(relation=relation, subject="cup_1", value=value),),
    )
    (said,) = goal_verdicts({"g": goal}, truths, {}, {}, objects)
    assert said.agreed is holds


def test_what_is_in_a_bowl_in_a_hand_is_still_in_a_hand() -> None:
    truths = {
        "cup_1": truth(support="bowl"),
        "bowl": replace(truth(support=None, held_by="hsr"), object="bowl"),
    }
    (said,) = goal_verdicts({"g": status()}, truths, {}, {}, {"bowl": thing("bowl")})
    assert "still in the hand of hsr" in said.sentence
    assert not said.agreed


def searched(subject: str, *visited: str) -> GoalVerdict:
    wanted = Condition(relation="searched", subject=subject, value=True)
    goal = GoalStatus(goal="g", state=GoalState.REACHED, conditions=(wanted,))
    (only,) = goal_verdicts(
        {"g": goal},
        {"cup_1": truth()},
        {"hsr": "kitchen"},
        wholes={"pantry": "hallway"},
        visited=visited,
    )
    return only


def test_what_was_searched_is_where_a_robot_has_really_been() -> None:
    """Not where it stands at the end: that is somewhere else by then."""
    assert searched("hallway", "kitchen", "hallway").agreed
    assert searched("hallway", "pantry").agreed  # a part of it
    assert searched("cup_1", "hallway").agreed  # it was looked into there
    never = searched("hallway", "kitchen")
    assert never.physics is Verdict.FAILS
    assert never.sentence == ("no robot has been in hallway (but the planner says it is reached)")


def test_only_what_goals_are_about_has_to_lie_still_and_what_carries_it() -> None:
    truths = {
        "cup_1": truth(support="tray"),
        "tray": truth(support="hallway_table"),
        "ball": truth(settled=False),
    }
    assert concerned([status()], truths) == {"cup_1", "tray"}
    assert concerned([status(subject="hsr")], truths) == set()
