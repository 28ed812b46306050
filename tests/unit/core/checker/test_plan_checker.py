"""The plan checker against known-good and known-bad plans."""

from __future__ import annotations

import sys
from dataclasses import replace as model_replace
from itertools import pairwise
from types import FrameType

import pytest
from msgspec.structs import replace

from fleet.core.checker.plan_checker import CheckedPlan, check_allocation, check_plan
from fleet.core.model.skill_file import skills_from_data
from keyexpr_schema.ids import actor_arg
from keyexpr_schema.payloads.goals import Condition
from keyexpr_schema.payloads.plans import Plan, Task
from keyexpr_schema.payloads.world import Surface
from tests.support.errand_plans import errand_plan
from tests.support.household import PLACES, SKILLS, at, carrier, cup, fact, home, manipulator

A1, A2 = "?a1", "?a2"


def task(name: str, skill: str, actor: str, *after: str, **args: str) -> Task:
    return Task(
        task=name, skill=skill, actor=actor, after=after, args={"robot": actor_arg(actor), **args}
    )


def fetch(actor: str = "a1", cup_name: str = "cup_1", to: str = "hallway") -> list[Task]:
    return [
        task("go", "navigate", actor, to="kitchen"),
        task("pick", "pick", actor, "go", object=cup_name, place="kitchen"),
        task("carry", "navigate", actor, "pick", to=to),
        task("put", "place", actor, "carry", object=cup_name, place=to),
    ]


def handover() -> list[Task]:
    return [
        task("go", "navigate", "a1", to="kitchen"),
        task("pick", "pick", "a1", "go", object="cup_1", place="kitchen"),
        task("come", "navigate", "a2", to="kitchen"),
        task(
            "give", "place_on_robot", "a1", "pick", "come",
            object="cup_1", carrier=A2, place="kitchen",
        ),
        task("bring", "navigate", "a2", "give", to="living_room"),
    ]  # fmt: skip


def plan(tasks: list[Task], *conditions: Condition, **more: object) -> Plan:
    return Plan(plan="p", goals=("g",), conditions=conditions, tasks=tuple(tasks), **more)  # type: ignore[arg-type]


def codes(tasks: list[Task], *conditions: Condition, **world: object) -> list[str]:
    found = check_plan(plan(tasks, *conditions), home(**world))  # type: ignore[arg-type]
    return [violation.code for violation in found.violations]


def without(tasks: list[Task], name: str, **changes: object) -> list[Task]:
    return [replace(t, **changes) if t.task == name else t for t in tasks]


def test_a_fetch_and_a_handover_are_valid() -> None:
    assert codes(fetch(), at("cup_1", "hallway")) == []
    assert codes(handover(), at("cup_1", "living_room")) == []


def test_an_empty_plan_reaches_only_what_holds_already() -> None:
    assert codes([], at("cup_1", "kitchen")) == []
    assert codes([], at("cup_1", "hallway")) == ["goal-unmet"]


@pytest.mark.parametrize(
    ("name", "changes", "code"),
    [
        ("pick", {"skill": "grab"}, "unknown-skill"),
        ("pick", {"args": {"robot": A1, "object": "cup_9", "place": "kitchen"}}, "unknown-name"),
        ("pick", {"args": {"robot": A1, "object": "hallway", "place": "kitchen"}}, "wrong-type"),
        ("pick", {"args": {"robot": A1, "object": "cup_1"}}, "wrong-arguments"),
        ("pick", {"args": {"robot": A2, "object": "cup_1", "place": "kitchen"}}, "wrong-actor"),
        ("pick", {"after": ("nowhere",)}, "unknown-dependency"),
        ("go", {"after": ("put",)}, "cycle"),
        ("pick", {"task": "go"}, "duplicate-task"),
        ("pick", {"after": ()}, "robot-in-two-places"),
        ("go", {"args": {"robot": A1, "to": "hallway"}}, "condition-undone"),
        ("put", {"args": {"robot": A1, "object": "cup_2", "place": "hallway"}}, "condition-undone"),
    ],
)
def test_each_fault_is_named(name: str, changes: dict[str, object], code: str) -> None:
    assert code in codes(without(fetch(), name, **changes))


def test_a_violation_names_task_condition_and_says_why() -> None:
    tasks = [t for t in fetch() if t.task != "pick"]
    tasks = without(tasks, "carry", after=("go",))
    (violation,) = check_plan(
        plan(tasks), home(facts=(fact("hsr", "holding", "cup_2"),))
    ).violations
    assert violation.code == "no-robot"
    assert "holding(hsr) = cup_1" in violation.sentence

    tasks = fetch(cup_name="cup_2")
    world = home(facts=(fact("cup_2", "at", None),))
    (violation,) = check_plan(plan(tasks), world).violations
    assert (violation.code, violation.task) == ("condition-unmet", "pick")
    assert violation.condition == at("cup_2", "kitchen")
    assert "not known" in violation.sentence


def test_a_robot_cannot_carry_what_another_one_picked() -> None:
    tasks = without(fetch(), "carry", actor="a2", args={"robot": A2, "to": "hallway"})
    tasks = without(
        tasks, "put", actor="a2", args={"robot": A2, "object": "cup_1", "place": "hallway"}
    )
    found = check_plan(
        plan(tasks, at("cup_1", "hallway")), home((manipulator(), manipulator("r2")))
    )
    # Nobody can be a2: with empty hands it should hold the cup that a1 picked.
    assert any("holding" in violation.sentence for violation in found.violations)


def test_one_thing_in_a_hand_at_a_time() -> None:
    tasks = [
        *fetch()[:2],
        task("pick2", "pick", "a1", "pick", object="cup_2", place="kitchen"),
    ]
    assert codes(tasks) == ["condition-undone"]


def test_a_carrier_must_stay_until_it_has_been_given_the_cup() -> None:
    tasks = without(handover(), "bring", after=("come",))
    assert "robot-in-two-places" in codes(tasks)


def test_where_a_carrier_must_be_at_the_start_counts_at_the_end() -> None:
    tasks = [
        *fetch()[:2],
        task("stay", "search", "a2", place="kitchen"),
        task(
            "give", "place_on_robot", "a1", "pick", "stay",
            object="cup_1", carrier=A2, place="kitchen",
        ),
    ]  # fmt: skip
    here = (fact("locobot", "at", "kitchen"),)
    assert codes(tasks, at("cup_1", "kitchen"), facts=here) == []
    assert codes(tasks, at("cup_1", "kitchen")) == ["no-robot"]


def test_a_basket_takes_what_it_takes() -> None:
    second = [
        task("pick2", "pick", "a1", "give", object="cup_2", place="kitchen"),
        task(
            "give2", "place_on_robot", "a1", "pick2", object="cup_2", carrier=A2, place="kitchen"
        ),
    ]  # fmt: skip
    tasks = without([*handover(), *second], "bring", after=("give2",))
    goals = (at("cup_1", "living_room"), at("cup_2", "living_room"))
    assert codes(tasks, *goals) == []
    assert codes(tasks, *goals, robots=(manipulator(), carrier(basket=1))) == ["no-robot"]
    full = check_allocation(
        plan(tasks), home((manipulator(), carrier(basket=1))), {"a1": "hsr", "a2": "locobot"}
    )
    assert [violation.code for violation in full] == ["no-space"]


def test_giving_away_what_lies_in_a_basket_does_not_count_while_a_hand_holds_it() -> None:
    assert codes(fetch()[:3], at("cup_1", "hallway")) == ["goal-unmet"]


def test_weight_and_skills_decide_who_can_be_an_actor() -> None:
    assert codes(fetch(), robots=(carrier(),)) == ["no-robot"]
    assert codes(fetch(), robots=(manipulator(grip_kg=0.1),)) == ["no-robot"]
    heavy = check_plan(plan(fetch()), home((manipulator(grip_kg=0.1), manipulator("strong"))))
    assert isinstance(heavy, CheckedPlan)


def test_a_hand_must_reach_as_high_as_the_highest_surface() -> None:
    shelf = Surface(surface="shelf", x_m=0, y_m=0, z_m=1.4, yaw_rad=0, length_m=1, width_m=1)
    world = home((manipulator(),))
    high = replace(world.places["kitchen"], surfaces=(shelf,))
    world = model_replace(world, places={**world.places, "kitchen": high})
    (violation,) = check_plan(plan(fetch()), world).violations
    assert violation.code == "no-robot"
    assert "the highest surface in kitchen is at 1.4 m; hsr reaches 1 m" in violation.sentence
    tall = replace(manipulator(), capabilities={**manipulator().capabilities, "reach": 1.4})
    assert not check_plan(plan(fetch()), model_replace(world, robots={"hsr": tall})).violations


def test_a_robot_lacks_a_capability_or_a_skill() -> None:
    blind = replace(manipulator(), capabilities={"drive": 0.6, "grip": 1.2, "reach": 1.0})
    (violation,) = check_plan(plan(fetch()), home((blind,))).violations
    assert violation.sentence.endswith("hsr has no see")
    unable = replace(manipulator(), skills=("navigate", "place"))
    (violation,) = check_plan(plan(fetch()), home((unable,))).violations
    assert violation.sentence.endswith("hsr does not have the skill pick")


def test_a_task_needs_different_robots() -> None:
    tasks = without(handover(), "give", args={"robot": A1, "object": "cup_1", "carrier": A1,
                                              "place": "kitchen"})  # fmt: skip
    assert "robot-in-two-places" in codes(tasks)


def test_what_is_in_the_basket_at_the_start_takes_room() -> None:
    full = (fact("cup_2", "at", "locobot"),)
    robots = (manipulator(), carrier(basket=1))
    assert codes(handover(), robots=robots, facts=full) == ["no-robot"]
    bound = {"a1": "hsr", "a2": "locobot"}
    found = check_allocation(plan(handover()), home(robots, facts=full), bound)
    assert [violation.code for violation in found] == ["no-space"]


def test_an_open_end_reaches_no_goal() -> None:
    """Two tasks make it this and that in no order: neither is what the goal finds."""
    switch = {
        name: {
            "parameters": {"robot": "robot", "place": "place"},
            "after": [f"lit(place) = {value}"],
        }
        for name, value in (("light", "true"), ("darken", "false"))
    }
    robots = tuple(
        replace(manipulator(name), skills=(*manipulator().skills, *switch))
        for name in ("hsr", "r2")
    )
    world = model_replace(
        home(robots), skills={**SKILLS, **skills_from_data({"skills": switch}, "here")}
    )
    lit = Condition(relation="lit", subject="kitchen", value=True)
    one, two = (
        task("one", "light", "a1", place="kitchen"),
        task("two", "darken", "a2", place="kitchen"),
    )
    assert isinstance(check_plan(plan([one], lit), world), CheckedPlan)
    for tasks in ([one, two], [two, one]):
        assert [v.code for v in check_plan(plan(tasks, lit), world).violations] == ["goal-unmet"]
    ordered = [two, replace(one, after=("two",))]
    assert isinstance(check_plan(plan(ordered, lit), world), CheckedPlan)


def test_an_actor_that_must_hold_something_at_the_start() -> None:
    tasks = [
        task("go", "navigate", "a1", to="hallway"),
        task("put", "place", "a1", "go", object="cup_1", place="hallway"),
    ]
    holds = (fact("cup_1", "at", "hsr"), fact("hsr", "holding", "cup_1"))
    assert codes(tasks, at("cup_1", "hallway"), facts=holds) == []
    assert codes(tasks, at("cup_1", "hallway")) == ["no-robot"]


def test_an_able_robot_that_is_bound_to_what_it_cannot() -> None:
    world = home((manipulator(), manipulator("weak", grip_kg=0.1)))
    found = check_allocation(plan(fetch()), world, {"a1": "weak"})
    assert [violation.code for violation in found] == ["no-robot"]
    assert "cup_1 weighs 0.15 kg; weak lifts 0.1 kg" in found[0].sentence


def test_an_allocated_plan_is_checked_with_robots_for_actors() -> None:
    both = [
        *fetch(),
        *(
            replace(
                t,
                task=f"{t.task}2",
                actor="a2",
                after=tuple(f"{b}2" for b in t.after),
                args={**t.args, "robot": A2, **({"object": "cup_2"} if "object" in t.args else {})},
            )
            for t in fetch()
        ),
    ]
    world = home()
    one_robot = {"a1": "hsr", "a2": "hsr"}
    assert isinstance(check_plan(plan(both), world), CheckedPlan)
    assert check_allocation(plan(both), world, one_robot)
    assert not check_allocation(plan(both), world, one_robot, {"go2": ("put",)})
    wrong = check_allocation(plan(fetch()), world, {"a1": "locobot"})
    assert "no-robot" in [violation.code for violation in wrong]


def test_a_pin_is_kept() -> None:
    pinned = plan(fetch(), pins={"a1": "r2"})
    world = home((manipulator(), manipulator("r2")))
    assert not check_allocation(pinned, world, {"a1": "r2"})
    assert check_allocation(pinned, world, {"a1": "hsr"})


def test_a_thousand_tasks_are_checked_within_the_timeout() -> None:
    tasks = []
    for number in range(250):
        for t in fetch():
            name = f"{t.task}{number}"
            after = tuple(f"{before}{number}" for before in t.after)
            if t.task == "go" and number:
                after = (f"put{number - 1}",)
            object_ = {"object": f"cup_{number + 1}"} if "object" in t.args else {}
            tasks.append(replace(t, task=name, after=after, args={**t.args, **object_}))
    world = home(cups=250)
    assert isinstance(check_plan(plan(tasks), world), CheckedPlan)


def test_twice_the_work_of_one_robot_costs_twice_as_much_to_check() -> None:
    """Each of its tasks writes where it is: nothing is compared pair by pair."""

    def calls(goals: int) -> int:
        checked, world = errand_plan(goals, robots=1)
        done = [task.task for task in checked.tasks]
        behind = {later: (before,) for before, later in pairwise(done)}
        allocation = dict.fromkeys(checked.actors, "r0")
        seen = 0

        def count(frame: FrameType, event: str, arg: object) -> None:
            nonlocal seen
            seen += event in ("call", "c_call")

        sys.setprofile(count)
        try:
            violations = check_allocation(checked, world, allocation, behind)
        finally:
            sys.setprofile(None)
        assert not violations
        return seen

    assert calls(120) < 2.5 * calls(60)


def test_places_of_the_household_are_what_the_plans_speak_of() -> None:
    assert {place.place for place in PLACES} == {"kitchen", "hallway", "living_room"}
    assert cup(1).object == "cup_1"
