"""Skills that a user adds: asked for by name, planned with, checked; nothing of ours changes."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from fleet.core.checker.plan_checker import CheckedPlan
from fleet.core.model.skill_file import skills_from_data
from fleet.core.model.skills import phrases_of
from fleet.core.model.world import WorldModel
from fleet.errors import NotUnderstood
from fleet.language import Vocabulary, read_goal
from fleet.planners.base import NoPlan, PlanningProblem
from fleet.planners.symbolic.engine.grounding import Grounding
from fleet.planners.symbolic.planner import SymbolicPlanner
from keyexpr_schema.facts import FactKey, Literal
from keyexpr_schema.ids import bare_name
from keyexpr_schema.payloads.goals import Condition, Goal
from keyexpr_schema.payloads.plans import Plan
from keyexpr_schema.payloads.world import Fact, Object
from tests.support.household import (
    PLACES,
    SKILLS,
    UNLOAD,
    at,
    bring,
    carrier,
    checked,
    cup,
    fact,
    manipulator,
)
from tests.support.language_house import WORDS, shown

OWN = {
    "vacuum": {
        "parameters": {"robot": "robot", "place": "place"},
        "needs": {"robot": ["drive"]},
        "before": ["at(robot) = place", "tidy(place) = true"],
        "after": ["clean(place) = true"],
    },
    "tidy_floor": {
        "parameters": {"robot": "robot", "place": "place"},
        "before": ["at(robot) = place", "holding(robot) = nothing"],
        "after": ["tidy(place) = true"],
    },
    "water": {
        "parameters": {"robot": "robot", "object": "object", "place": "place"},
        "before": ["at(robot) = place", "at(object) = place"],
        "after": ["watered(object) = true"],
    },
    "unload": UNLOAD,
}
ALL = {**SKILLS, **skills_from_data({"skills": OWN}, "mine.yaml")}
PHRASES = phrases_of(ALL)
STRATEGIES = ("big-dag", "per-goal", "monolithic")


def words() -> Vocabulary:
    return Vocabulary(WORDS.places, WORDS.objects, WORDS.robots, skill_phrases=PHRASES)


def world(*facts: Fact) -> WorldModel:
    robots = (manipulator("hsr"), carrier("locobot"), carrier("other"))
    robots = tuple(replace(spec, skills=(*spec.skills, *OWN)) for spec in robots)
    known = (fact("hsr", "holding", "nothing"), fact("cup_1", "at", "kitchen"))
    return WorldModel.of(ALL, PLACES, (cup(1),), robots, (*known, *facts))


def planned(strategy: str, model: WorldModel, *goals: Goal) -> Plan:
    problem = PlanningProblem("p", goals, model, strategy=strategy)
    made = SymbolicPlanner().plan(problem)
    assert isinstance(made, CheckedPlan), made
    return checked(made.plan, model).plan


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Vacuum the hallway", "clean(hallway)"),
        ("Please vacuum the kitchen and the lounge", "clean(kitchen); clean(living_room)"),
        ("vacuum every room", "clean(hallway); clean(kitchen); clean(living_room)"),
        ("tidy floor kitchen", "tidy(kitchen)"),
        (
            "Bring the book to the hallway, then vacuum the kitchen",
            "at(book) = hallway > clean(kitchen)",
        ),
        ("Water the red book", "watered(book)"),
        ("water a cup", "watered(cup_1|cup_2)"),
        ("Tidy up the cups", "at(cup_1) = kitchen; at(cup_2) = kitchen"),
    ],
)
def test_a_skill_is_asked_for_by_its_name(text: str, expected: str) -> None:
    assert shown(read_goal(text, words())) == expected


def test_what_it_cannot_be_done_to_is_refused() -> None:
    for text in ("Vacuum the dragon", "Vacuum the book", "Vacuum"):
        with pytest.raises(NotUnderstood, match="known are hallway, kitchen, living_room"):
            read_goal(text, words())
    with pytest.raises(NotUnderstood, match="'Vacuum' is not understood"):
        read_goal("Vacuum the hallway", WORDS)


def test_what_moves_things_has_sentences_of_its_own() -> None:
    household = ["charge", "close", "look into", "open", "search", "switch off", "switch on"]
    assert [phrase.verb for phrase in phrases_of(SKILLS)] == household
    assert [p.verb for p in PHRASES] == sorted([*household, "tidy floor", "vacuum", "water"])


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_need_of_ones_own_is_met_first(strategy: str) -> None:
    stages = read_goal("Vacuum the hallway", words()).stages
    goal = Goal(goal="g", text="", conditions=stages[0])
    plan = planned(strategy, world(), goal)
    assert [task.skill for task in plan.tasks] == ["navigate", "tidy_floor", "vacuum"]


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_what_rides_in_a_basket_is_driven_on(strategy: str) -> None:
    model = world(fact("cup_1", "at", "locobot"))
    plan = planned(strategy, replace_skills(model), bring(1, "living_room"))
    assert [task.skill for task in plan.tasks] == ["navigate"]
    assert list(plan.pins.values()) == ["locobot"]


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_what_lies_in_a_basket_is_taken_out_of_that_one(strategy: str) -> None:
    model = world(fact("cup_1", "at", "locobot"))
    goal = Goal(goal="g", text="", conditions=(at("cup_1", "hsr"),))
    plan = planned(strategy, model, goal)
    assert plan.tasks[-1].skill == "unload"
    taken_from = bare_name(plan.tasks[-1].args["carrier"])
    assert plan.pins.get(taken_from, taken_from) == "locobot"


def replace_skills(model: WorldModel) -> WorldModel:
    """The same world with the household's skills only."""
    return WorldModel(
        SKILLS, model.places, model.objects, model.robots, model.available, model.facts
    )


POLISH = skills_from_data(
    {
        "skills": {
            "polish": {
                "parameters": {"robot": "robot", "thing": "cup", "tool": "cloth", "place": "place"},
                "before": ["at(robot) = place", "at(thing) = place", "holding(robot) = tool"],
                "after": ["polished(thing) = true"],
            },
            "polish_together": {
                "parameters": {"robot": "robot", "partner": "robot", "thing": "tub"},
                "after": ["polished(thing) = true"],
            },
        }
    },
    "polish.yaml",
)


def polished(number: int, thing: str) -> Goal:
    wanted = Condition(relation="polished", subject=thing, value=True)
    return Goal(goal=f"g{number}", text=f"Polish {thing}", conditions=(wanted,), ordinal=number)


def polishing(*kinds: str) -> WorldModel:
    things = (cup(1), cup(2), *(Object(object=kind, kind=kind, label=kind) for kind in kinds))
    spec = manipulator()
    return WorldModel.of(
        {**SKILLS, **POLISH},
        PLACES,
        things,
        (replace(spec, skills=(*spec.skills, *POLISH)),),
        (
            fact("hsr", "holding", "nothing"),
            fact("cup_1", "at", "kitchen"),
            fact("cup_2", "at", "living_room"),
            *(fact(kind, "at", "hallway") for kind in kinds),
        ),
    )


@pytest.mark.parametrize("strategy", STRATEGIES)
def test_a_tool_that_one_goal_leaves_in_the_hand_serves_the_next(strategy: str) -> None:
    plan = planned(strategy, polishing("cloth"), polished(1, "cup_1"), polished(2, "cup_2"))
    assert [task.skill for task in plan.tasks].count("polish") == 2
    assert [task.skill for task in plan.tasks].count("pick") == 1


@pytest.mark.parametrize(
    ("goal", "reason"),
    [
        (polished(1, "cup_1"), "polish takes a cloth, and there is none"),
        (polished(1, "tub"), "polish_together takes 2 robots, and there is hsr"),
    ],
)
def test_a_tool_or_a_robot_that_there_is_not_is_what_is_missing(goal: Goal, reason: str) -> None:
    problem = PlanningProblem("p", (goal,), polishing("tub"))
    made = SymbolicPlanner().plan(problem)
    assert isinstance(made, NoPlan)
    assert reason in made.reason


def test_what_a_person_has_is_named_as_in_that_hand() -> None:
    world = polishing("cloth")
    anna = Object(object="anna", kind="person", label="Anna", movable=False, features=("person",))
    held = WorldModel.of(
        world.skills,
        PLACES,
        (*world.objects.values(), anna),
        tuple(world.robots.values()),
        (
            fact("hsr", "holding", "nothing"),
            fact("anna", "at", "kitchen"),
            fact("cup_1", "at", "anna"),
        ),
    )
    made = SymbolicPlanner().plan(PlanningProblem("p", (bring(1, "hallway"),), held))
    assert isinstance(made, NoPlan)
    assert "cup_1 is in the hand of anna" in made.reason


@pytest.mark.parametrize(("room", "fits"), [(1, False), (2, True)])
def test_no_more_is_wanted_somewhere_than_it_has_room_for(room: int, fits: bool) -> None:
    world = polishing()
    tray = Object(object="tray", kind="tray", label="tray", features=("contains",), room=room)
    spec = replace(manipulator(), skills=(*manipulator().skills, "place_in"))
    model = WorldModel.of(
        world.skills,
        PLACES,
        (*world.objects.values(), tray),
        (spec,),
        (
            fact("hsr", "holding", "nothing"),
            *(fact(name, "at", "kitchen") for name in ("tray", "cup_1", "cup_2")),
        ),
    )
    goals = tuple(
        Goal(
            goal=f"g{n}",
            text=f"Put cup {n} in the tray",
            conditions=(Condition(relation="in", subject=f"cup_{n}", value="tray"),),
            ordinal=n,
        )
        for n in (1, 2)
    )
    made = SymbolicPlanner().plan(PlanningProblem("p", goals, model))
    assert isinstance(made, CheckedPlan) is fits
    if isinstance(made, NoPlan):
        assert made.reason == "tray has room for 1, and cup_1, cup_2 are to be there"


def test_a_tool_is_taken_from_where_it_is_without_looking_at_every_detour() -> None:
    world = polishing("cloth")
    goal = [Literal(FactKey("polished", "cup_1"), True)]
    grounding = Grounding(world, dict(world.facts), goal, ["hsr"], {"hsr": None})
    picks = {
        (action.args["object"], action.args["place"])
        for action in grounding.actions
        if action.skill.name == "pick"
    }
    assert ("cloth", "hallway") in picks, "the cup is in the kitchen"
